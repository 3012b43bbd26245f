//! The processes a launcher has started. All are gone when this is dropped.

use crate::supervisor::{Launch, ProcessInfo};
use crate::{Clock, RuntimeError};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::retry_on_intr;
use rustix::process::{Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, kill_process, pidfd_open, waitid};
use skein_bus::{Control, Domain, PinMode};
use skein_protocol::{DroneId, Tick};
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
    Drone { id: DroneId, incarnation: u32, first_tick: Tick },
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::World => f.write_str("the world"),
            Self::Drone { id, .. } => write!(f, "drone {id}"),
        }
    }
}

struct Running {
    role: Role,
    child: Child,
    pidfd: OwnedFd,
}

impl Running {
    fn is_of(&self, drone: DroneId) -> bool {
        matches!(self.role, Role::Drone { id, .. } if id == drone)
    }
}

/// Processes that were started and not yet reaped.
pub(crate) struct Children {
    executable: PathBuf,
    domain: PathBuf,
    control: i32,
    pin: PinMode,
    running: Vec<Running>,
}

impl Children {
    pub(crate) fn new(launch: &Launch<'_>, domain: &Domain, control: &Control) -> Self {
        Self {
            executable: launch.executable.clone(),
            domain: domain.path().to_owned(),
            // The segment that the launcher made has a descriptor.
            control: control.fd().unwrap_or(-1),
            pin: launch.pin,
            running: Vec::new(),
        }
    }

    /// Starts a process. To be called from one thread that lives as long as the run: children die with the thread that
    /// started them.
    pub(crate) fn spawn(&mut self, role: Role, clock: Clock) -> Result<(), RuntimeError> {
        let mut command = Command::new(&self.executable);
        match role {
            Role::World => command.args(["world", "--clock", &clock.to_string()]),
            Role::Drone { id, incarnation, first_tick } => command.args([
                "drone",
                "--id",
                &id.to_string(),
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
        let child = command
            .spawn()
            .map_err(RuntimeError::system(format!("starting {role} as {}", self.executable.display())))?;
        let pid = Pid::from_child(&child);
        let pidfd = pidfd_open(pid, PidfdFlags::empty());
        // Owned by `running` even if watching fails, so that it is killed and reaped.
        let pidfd = match pidfd {
            Ok(pidfd) => pidfd,
            Err(error) => {
                let mut child = child;
                let _ = (child.kill(), child.wait());
                return Err(RuntimeError::system(format!("watching {role}"))(error.into()));
            }
        };
        self.running.push(Running { role, child, pidfd });
        Ok(())
    }

    /// Waits, at most `limit`, until a process has ended; reaps all that have, and tells how they ended.
    pub(crate) fn wait_any(&mut self, limit: Duration) -> Vec<(Role, ExitStatus)> {
        let mut fds: Vec<PollFd<'_>> = self.running.iter().map(|r| PollFd::new(&r.pidfd, PollFlags::IN)).collect();
        let timeout = Timespec { tv_sec: limit.as_secs() as _, tv_nsec: limit.subsec_nanos().into() };
        if !matches!(poll(&mut fds, Some(&timeout)), Ok(1..)) {
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

    /// Kills a drone's process and reaps it; false if there is none.
    pub(crate) fn kill_drone(&mut self, drone: DroneId) -> bool {
        let Some(place) = self.running.iter().position(|running| running.is_of(drone)) else { return false };
        let mut running = self.running.remove(place);
        // It may have ended by itself just now: the wait tells either way.
        let _ = running.child.kill();
        running.child.wait().is_ok()
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
        self.running.iter().map(|running| match running.role {
            Role::World => ProcessInfo { role: "world", id: None, pid: running.child.id() },
            Role::Drone { id, .. } => ProcessInfo { role: "drone", id: Some(id.0), pid: running.child.id() },
        })
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.kill_all();
    }
}
