//! What a process needs from its machine: a core, and enough file descriptors.

use crate::error::BusError;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// Whether processes are pinned to cores.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PinMode {
    /// Process i runs on core i modulo the number of cores it may use.
    #[default]
    Auto,
    /// The system's scheduler chooses the cores.
    Off,
}

/// Number of cores that this process may use.
///
/// # Errors
/// [`BusError::System`].
pub fn allowed_cores() -> Result<usize, BusError> {
    Ok(cores(&affinity()?).count())
}

/// Pins the calling thread, and the threads and processes that it starts from now on, to core `index` modulo the number
/// of cores it may use. Does nothing with [`PinMode::Off`].
///
/// # Errors
/// [`BusError::System`].
pub fn pin_to_core(index: usize, mode: PinMode) -> Result<(), BusError> {
    if mode == PinMode::Off {
        return Ok(());
    }
    let allowed = affinity()?;
    let count = cores(&allowed).count().max(1);
    if let Some(core) = cores(&allowed).nth(index % count) {
        let mut wanted = CpuSet::new();
        wanted.set(core);
        sched_setaffinity(None, &wanted).map_err(BusError::system("pin this process to a core"))?;
    }
    Ok(())
}

/// Raises the limit of open files to what the system allows this user, and returns it; `u64::MAX` if there is none.
///
/// # Errors
/// [`BusError::System`].
pub fn raise_file_limit() -> Result<u64, BusError> {
    let limit = getrlimit(Resource::Nofile);
    if limit.current != limit.maximum {
        let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
        setrlimit(Resource::Nofile, raised).map_err(BusError::system("raise the limit of open files (`ulimit -n`)"))?;
    }
    Ok(limit.maximum.unwrap_or(u64::MAX))
}

fn affinity() -> Result<CpuSet, BusError> {
    sched_getaffinity(None).map_err(BusError::system("read the cores this process may use"))
}

fn cores(set: &CpuSet) -> impl Iterator<Item = usize> + '_ {
    (0..CpuSet::MAX_CPU).filter(|&core| set.is_set(core))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pinned_thread_has_one_of_the_allowed_cores() {
        std::thread::spawn(|| {
            let before = allowed_cores().unwrap();
            pin_to_core(5, PinMode::Off).unwrap();
            assert_eq!(allowed_cores().unwrap(), before);
            pin_to_core(before + 1, PinMode::Auto).unwrap();
            assert_eq!(allowed_cores().unwrap(), 1);
        })
        .join()
        .unwrap();
    }

    #[test]
    fn the_soft_limit_is_raised_to_the_hard_limit() {
        let limit = raise_file_limit().unwrap();
        let now = getrlimit(Resource::Nofile);
        assert_eq!(now.current, now.maximum);
        assert_eq!(now.current.unwrap_or(u64::MAX), limit);
    }
}
