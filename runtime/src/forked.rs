//! What is said of processes that a pilot forks.

/// What a process says that the pilot of a drone forked, and that did not end before the pilot returned.
pub(crate) fn copy_came_back(drone: u32) -> String {
    format!(
        "process {}, which the pilot of drone {drone} forked, is ended: only the process that forked it flies the drone; \
         a forked process must end (as by os._exit) before the pilot returns",
        std::process::id()
    )
}
