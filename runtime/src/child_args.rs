//! What a launcher passes to its child processes in their arguments and environment.

use crate::error::RuntimeError;
use crate::process_state::is_stopped;
use crate::scenario_file;
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use skein_bus::{Control, Domain, PinMode};
use skein_scenario::Scenario;
use std::os::fd::RawFd;
use std::path::PathBuf;
use std::process::Command;

/// Arguments that every child process gets from its launcher.
#[derive(Clone, Debug)]
pub struct ChildArgs {
    /// Folder of the run's domain.
    pub domain: PathBuf,
    /// File descriptor of the control segment, inherited from the launcher.
    pub control: RawFd,
    /// Process id of the launcher.
    pub parent: u32,
    /// Whether the process stays on one core.
    pub pin: PinMode,
}

impl ChildArgs {
    /// The arguments for children of this process.
    pub(crate) fn of_this_process(domain: &Domain, control: &Control, pin: PinMode) -> Self {
        Self {
            domain: domain.path().to_owned(),
            // A segment that this process has created always has a descriptor.
            control: control.fd().unwrap_or(-1),
            parent: std::process::id(),
            pin,
        }
    }

    /// Appends these arguments to the command that starts a child.
    pub(crate) fn append_to(&self, command: &mut Command) {
        command.arg("--domain").arg(&self.domain);
        command.args(["--control", &self.control.to_string(), "--parent", &self.parent.to_string()]);
        let pin = if self.pin == PinMode::Auto { "auto" } else { "off" };
        command.args(["--pin", pin]);
    }

    /// Ties this process to its launcher: when the launcher dies, the kernel kills this process.
    ///
    /// # Errors
    /// [`RuntimeError::LauncherGone`] if the launcher has ended already, [`RuntimeError::System`] if the kernel refuses.
    pub fn bind_to_parent(&self) -> Result<(), RuntimeError> {
        end_with_parent(self.parent, Signal::KILL)
    }

    /// Whether the launcher is stopped, as by Ctrl-Z.
    pub(crate) fn launcher_is_stopped(&self) -> bool {
        is_stopped(self.parent)
    }

    /// The scenario as the launcher resolved it.
    ///
    /// # Errors
    /// As [`scenario_file::read`].
    pub fn scenario(&self) -> Result<Scenario, RuntimeError> {
        scenario_file::read(&self.domain)
    }
}

/// Has the kernel send this process a signal when its parent ends. `parent` is the process that it was started by.
///
/// # Errors
/// [`RuntimeError::LauncherGone`] if the parent has ended already, [`RuntimeError::System`] if the kernel refuses.
pub fn end_with_parent(parent: u32, signal: Signal) -> Result<(), RuntimeError> {
    set_parent_process_death_signal(Some(signal))
        .map_err(|error| RuntimeError::system("asking for a signal when the parent process ends")(error.into()))?;
    // The parent may have died before that call.
    if getppid().map(|pid| pid.as_raw_nonzero().get().unsigned_abs()) != Some(parent) {
        return Err(RuntimeError::LauncherGone { pid: parent });
    }
    Ok(())
}

/// Environment variable with settings of the C library.
const TUNABLES: &str = "GLIBC_TUNABLES";

/// Switches restartable sequences off. No child uses them, and with them the kernel touches a page of the process at
/// each switch to it; that page is no longer in the cache by then.
const NO_RSEQ: &str = "glibc.pthread.rseq=0";

/// Sets the environment of a child process so that the kernel has less to do at each switch to it.
pub fn lighten(command: &mut Command) {
    command.env(TUNABLES, tunables(std::env::var(TUNABLES).ok()));
}

/// The settings for a child. The C library takes the last one of a name, so that what the user has set wins.
fn tunables(inherited: Option<String>) -> String {
    match inherited.filter(|settings| !settings.is_empty()) {
        Some(settings) => format!("{NO_RSEQ}:{settings}"),
        None => NO_RSEQ.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_of_the_user_are_kept_and_come_last() {
        assert_eq!(tunables(None), NO_RSEQ);
        assert_eq!(tunables(Some(String::new())), NO_RSEQ);
        let set = "glibc.pthread.rseq=1".to_owned();
        assert_eq!(tunables(Some(set)), "glibc.pthread.rseq=0:glibc.pthread.rseq=1");
    }
}
