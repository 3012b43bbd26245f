//! The processes a launcher has started. All are gone when this is dropped.

use crate::drone_process::DroneRange;
use crate::supervisor::{Launch, ProcessInfo};
use crate::{Clock, PilotKind, RuntimeError};
use rustix::event::{Timespec, epoll};
use rustix::io::retry_on_intr;
use rustix::process::{Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, kill_process, pidfd_open, waitid};
use skein_bus::{Control, Domain, PinMode};
use skein_protocol::DroneId;
use std::fmt;
use std::os::fd::OwnedFd;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// What a child process is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    World,
    Drones(DroneRange),
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::World => f.write_str("the world"),
            Self::Drones(DroneRange { first, count: 1, .. }) => write!(f, "drone {first}"),
            Self::Drones(DroneRange { first, count, .. }) => {
                write!(f, "the process of drones {first} to {}", first.0 + count - 1)
            }
        }
    }
}

/// Settings of the C library, in the environment.
const TUNABLES: &str = "GLIBC_TUNABLES";
/// No restartable sequences, which nobody here uses: the kernel would look at and write a page of the process at each switch
/// to it, cold by then.
const NO_RSEQ: &str = "glibc.pthread.rseq=0";

/// Spares a child what costs it at each switch and nobody uses.
pub fn lighten(command: &mut Command) {
    command.env(TUNABLES, tunables(std::env::var(TUNABLES).ok()));
}

/// The settings for a child: of one that is there twice the last counts, so nothing that somebody set is overruled.
fn tunables(inherited: Option<String>) -> String {
    match inherited.filter(|settings| !settings.is_empty()) {
        Some(settings) => format!("{NO_RSEQ}:{settings}"),
        None => NO_RSEQ.to_owned(),
    }
}

struct Running {
    role: Role,
    child: Child,
    /// Closed with it: then nobody watches it any more.
    _pidfd: OwnedFd,
}

impl Running {
    fn is_of(&self, drone: DroneId) -> bool {
        matches!(self.role, Role::Drones(range) if range.ids().any(|id| id == drone))
    }
}

/// Processes that were started and not yet reaped.
pub(crate) struct Children {
    executable: PathBuf,
    domain: PathBuf,
    control: i32,
    pin: PinMode,
    pilot: PilotKind,
    running: Vec<Running>,
    /// Tells of ends; what it costs does not depend on how many there are.
    ends: OwnedFd,
}

impl Children {
    pub(crate) fn new(launch: &Launch<'_>, domain: &Domain, control: &Control) -> Result<Self, RuntimeError> {
        let ends = epoll::create(epoll::CreateFlags::CLOEXEC);
        Ok(Self {
            executable: launch.executable.clone(),
            domain: domain.path().to_owned(),
            // The segment that the launcher made has a descriptor.
            control: control.fd().unwrap_or(-1),
            pin: launch.pin,
            pilot: launch.pilot,
            running: Vec::new(),
            ends: ends.map_err(|error| RuntimeError::system("watching processes")(error.into()))?,
        })
    }

    /// Starts a process. To be called from one thread that lives as long as the run: children die with the thread that
    /// started them.
    pub(crate) fn spawn(&mut self, role: Role, clock: Clock) -> Result<(), RuntimeError> {
        let mut command = Command::new(&self.executable);
        match role {
            Role::World => command.args(["world", "--clock", &clock.to_string()]),
            Role::Drones(DroneRange { first, count, incarnation, first_tick }) => command.args([
                "drone",
                "--pilot",
                self.pilot.name(),
                "--id",
                &first.to_string(),
                "--count",
                &count.to_string(),
                "--incarnation",
                &incarnation.to_string(),
                "--first-tick",
                &first_tick.to_string(),
            ]),
        };
        command.arg("--domain").arg(&self.domain);
        command.args(["--control", &self.control.to_string(), "--parent", &std::process::id().to_string()]);
        command.args(["--pin", if self.pin == PinMode::Auto { "auto" } else { "off" }]);
        // A terminal's Ctrl-C must reach the launcher alone, and stdout is the launcher's.
        command.stdin(Stdio::null()).stdout(Stdio::null()).process_group(0);
        lighten(&mut command);
        let child = command
            .spawn()
            .map_err(RuntimeError::system(format!("starting {role} as {}", self.executable.display())))?;
        let pid = Pid::from_child(&child);
        let watch = |pidfd: OwnedFd| {
            let none = epoll::EventData::new_u64(0);
            epoll::add(&self.ends, &pidfd, none, epoll::EventFlags::IN).map(|()| pidfd)
        };
        let pidfd = pidfd_open(pid, PidfdFlags::empty()).and_then(watch);
        // Owned by `running` even if watching fails, so that it is killed and reaped.
        let pidfd = match pidfd {
            Ok(pidfd) => pidfd,
            Err(error) => {
                let mut child = child;
                let _ = (child.kill(), child.wait());
                return Err(RuntimeError::system(format!("watching {role}"))(error.into()));
            }
        };
        self.running.push(Running { role, child, _pidfd: pidfd });
        Ok(())
    }

    /// Waits, at most `limit`, until a process has ended; reaps all that have, and tells how they ended.
    pub(crate) fn wait_any(&mut self, limit: Duration) -> Vec<(Role, ExitStatus)> {
        let timeout = Timespec { tv_sec: limit.as_secs() as _, tv_nsec: limit.subsec_nanos().into() };
        let mut one = [epoll::Event { flags: epoll::EventFlags::empty(), data: epoll::EventData::new_u64(0) }];
        if !matches!(epoll::wait(&self.ends, &mut one[..], Some(&timeout)), Ok(1..)) {
            return Vec::new();
        }
        let mut ended = Vec::new();
        self.running.retain_mut(|running| match running.child.try_wait() {
            Ok(Some(status)) => {
                ended.push((running.role, status));
                false
            }
            _ => true,
        });
        ended
    }

    /// Kills a drone's process and reaps it; all drones that were in it, `None` if there is none.
    pub(crate) fn kill_drone(&mut self, drone: DroneId) -> Option<DroneRange> {
        let place = self.running.iter().position(|running| running.is_of(drone))?;
        let mut running = self.running.remove(place);
        // It may have ended by itself just now: the wait tells either way.
        let _ = running.child.kill();
        let Role::Drones(range) = running.role else { return None };
        running.child.wait().is_ok().then_some(range)
    }

    /// Stops a drone's process; true once it is stopped, false if there is none.
    pub(crate) fn freeze_drone(&self, drone: DroneId) -> bool {
        let Some(pid) = self.pid_of(drone) else { return false };
        // Not reaped here, should it have ended: that is the watcher's.
        let wanted = WaitIdOptions::STOPPED | WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        let wait = || retry_on_intr(|| waitid(WaitId::Pid(pid), wanted));
        let stopped = || wait().ok().flatten().is_some_and(|status| status.stopped());
        kill_process(pid, Signal::STOP).is_ok() && stopped()
    }

    /// Lets a drone's process go on; false if there is none.
    pub(crate) fn resume_drone(&self, drone: DroneId) -> bool {
        self.pid_of(drone).is_some_and(|pid| kill_process(pid, Signal::CONT).is_ok())
    }

    /// Lets all processes that are stopped go on, so that they can end.
    pub(crate) fn resume_all(&self) {
        for running in &self.running {
            // Whoever has ended needs no signal.
            let _ = kill_process(Pid::from_child(&running.child), Signal::CONT);
        }
    }

    fn pid_of(&self, drone: DroneId) -> Option<Pid> {
        self.running.iter().find(|running| running.is_of(drone)).map(|running| Pid::from_child(&running.child))
    }

    pub(crate) fn kill_all(&mut self) {
        for running in &mut self.running {
            let _ = running.child.kill();
        }
        for mut running in self.running.drain(..) {
            let _ = running.child.wait();
        }
    }

    pub(crate) fn any(&self) -> bool {
        !self.running.is_empty()
    }

    pub(crate) fn list(&self) -> impl Iterator<Item = ProcessInfo> + '_ {
        self.running.iter().flat_map(|running| {
            let (role, ids) = match running.role {
                Role::World => ("world", vec![None]),
                Role::Drones(range) => ("drone", range.ids().map(|id| Some(id.0)).collect()),
            };
            let pid = running.child.id();
            ids.into_iter().map(move |id| ProcessInfo { role, id, pid })
        })
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.kill_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_somebody_set_is_kept_and_comes_last() {
        assert_eq!(tunables(None), NO_RSEQ);
        assert_eq!(tunables(Some(String::new())), NO_RSEQ);
        let set = "glibc.pthread.rseq=1".to_owned();
        assert_eq!(tunables(Some(set)), "glibc.pthread.rseq=0:glibc.pthread.rseq=1");
    }
}
