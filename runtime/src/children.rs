//! The child processes of a launcher.

use crate::child_args::{ChildArgs, lighten};
use crate::clock::Clock;
use crate::drone_range::DroneRange;
use crate::error::RuntimeError;
use crate::launch::{ProcessInfo, ProcessRole};
use crate::process_state::is_stopped;
use crate::program::Program;
use crate::programs::Programs;
use rustix::event::{Timespec, epoll};
use rustix::io::retry_on_intr;
use rustix::process::{Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, kill_process, pidfd_open, waitid};
use skein_protocol::DroneId;
use std::fmt;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

/// What a child process is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ChildRole {
    World,
    Drones(DroneRange),
}

impl fmt::Display for ChildRole {
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

struct Running {
    role: ChildRole,
    child: Child,
    /// Watched by [`Children::ends`] for as long as it is open.
    _pidfd: OwnedFd,
}

impl Running {
    fn flies(&self, drone: DroneId) -> bool {
        matches!(self.role, ChildRole::Drones(range) if range.ids().any(|id| id == drone))
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }
}

/// Processes that were started and not yet reaped. Dropping this kills and reaps all of them.
pub(crate) struct Children<'l> {
    programs: Programs<'l>,
    args: ChildArgs,
    patience: Duration,
    running: Vec<Running>,
    /// Reports the ends of processes. The cost of a wait does not depend on their number.
    ends: OwnedFd,
}

impl<'l> Children<'l> {
    /// No processes yet. All that are started get these arguments.
    pub(crate) fn new(programs: Programs<'l>, args: ChildArgs, patience: Duration) -> Result<Self, RuntimeError> {
        let ends = epoll::create(epoll::CreateFlags::CLOEXEC)
            .map_err(|error| RuntimeError::system("watching processes")(error.into()))?;
        Ok(Self { programs, args, patience, running: Vec::new(), ends })
    }

    /// Starts a process. Call this from one thread that lives as long as the run: a child dies with the thread that
    /// started it.
    pub(crate) fn spawn(&mut self, role: ChildRole, clock: Clock) -> Result<(), RuntimeError> {
        let mut child = self
            .command(role, clock)
            .spawn()
            .map_err(RuntimeError::system(format!("starting {role} as {}", self.program(role))))?;
        match watch(&self.ends, &child) {
            Ok(pidfd) => {
                self.running.push(Running { role, child, _pidfd: pidfd });
                Ok(())
            }
            Err(error) => {
                // No one else would end it.
                let _ = (child.kill(), child.wait());
                Err(RuntimeError::system(format!("watching {role}"))(error.into()))
            }
        }
    }

    fn command(&self, role: ChildRole, clock: Clock) -> Command {
        let mut command = self.program(role).command();
        match role {
            ChildRole::World => {
                let patience_s = self.patience.as_secs_f64().to_string();
                command.args(["world", "--clock", &clock.to_string(), "--patience", &patience_s])
            }
            ChildRole::Drones(DroneRange { first, count, incarnation, first_tick }) => command.args([
                "drone",
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
        self.args.append_to(&mut command);
        // A terminal's Ctrl-C must reach the launcher alone, and stdout is the launcher's: what a pilot prints goes to stderr.
        command.stdin(Stdio::null()).stdout(std::io::stderr()).process_group(0);
        lighten(&mut command);
        command
    }

    /// The program of a process.
    pub(crate) fn program(&self, role: ChildRole) -> &Program {
        match role {
            ChildRole::World => self.programs.launcher(),
            ChildRole::Drones(range) => self.programs.of(range.first),
        }
    }

    /// Whether one process can fly both drones.
    pub(crate) fn share(&self, one: DroneId, other: DroneId) -> bool {
        self.programs.share(one, other)
    }

    /// Waits for a process to end, at most `limit`. Reaps all processes that have ended and returns how they ended.
    pub(crate) fn wait_any(&mut self, limit: Duration) -> Vec<(ChildRole, ExitStatus)> {
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

    /// Whether the process of a drone flies others, too.
    pub(crate) fn flies_others(&self, drone: DroneId) -> bool {
        let process = self.running.iter().find(|running| running.flies(drone));
        process.is_some_and(|running| matches!(running.role, ChildRole::Drones(range) if range.count > 1))
    }

    /// Kills the process of a drone and reaps it. Returns all drones that were in it, or `None` if there is no such process.
    pub(crate) fn kill_drone(&mut self, drone: DroneId) -> Option<DroneRange> {
        let index = self.running.iter().position(|running| running.flies(drone))?;
        let mut running = self.running.remove(index);
        // The process may have ended by itself just now. The wait succeeds either way.
        let _ = running.child.kill();
        let ChildRole::Drones(range) = running.role else { return None };
        running.child.wait().is_ok().then_some(range)
    }

    /// Stops the process of a drone and waits until it is stopped. Returns false if there is no such process.
    pub(crate) fn freeze_drone(&self, drone: DroneId) -> bool {
        let Some(pid) = self.pid_of(drone) else { return false };
        // A process that has ended instead is left for `wait_any` to reap.
        let wanted = WaitIdOptions::STOPPED | WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        let wait = || retry_on_intr(|| waitid(WaitId::Pid(pid), wanted));
        let stopped = || wait().ok().flatten().is_some_and(|status| status.stopped());
        kill_process(pid, Signal::STOP).is_ok() && stopped()
    }

    /// Continues the stopped process of a drone. Returns false if there is no such process.
    pub(crate) fn resume_drone(&self, drone: DroneId) -> bool {
        self.pid_of(drone).is_some_and(|pid| kill_process(pid, Signal::CONT).is_ok())
    }

    /// Whether the world's process is stopped (SIGSTOP). A process under a debugger is not.
    pub(crate) fn world_is_stopped(&self) -> bool {
        let world = self.running.iter().find(|running| running.role == ChildRole::World);
        world.is_some_and(|running| is_stopped(running.child.id()))
    }

    /// Continues all stopped processes, so that they can end.
    pub(crate) fn resume_all(&self) {
        for running in &self.running {
            // This fails only for a process that has ended, which needs no signal.
            let _ = kill_process(running.pid(), Signal::CONT);
        }
    }

    fn pid_of(&self, drone: DroneId) -> Option<Pid> {
        self.running.iter().find(|running| running.flies(drone)).map(Running::pid)
    }

    /// Kills and reaps all processes.
    pub(crate) fn kill_all(&mut self) {
        for running in &mut self.running {
            let _ = running.child.kill();
        }
        for mut running in self.running.drain(..) {
            let _ = running.child.wait();
        }
    }

    /// Whether no process is left.
    pub(crate) fn is_empty(&self) -> bool {
        self.running.is_empty()
    }

    /// The processes that are left, once per drone.
    pub(crate) fn list(&self) -> impl Iterator<Item = ProcessInfo> + '_ {
        self.running.iter().flat_map(|running| {
            let (role, ids) = match running.role {
                ChildRole::World => (ProcessRole::World, vec![None]),
                ChildRole::Drones(range) => (ProcessRole::Drone, range.ids().map(|id| Some(id.0)).collect()),
            };
            let pid = running.child.id();
            ids.into_iter().map(move |id| ProcessInfo { role, id, pid })
        })
    }
}

impl Drop for Children<'_> {
    fn drop(&mut self) {
        self.kill_all();
    }
}

/// Adds a process to those whose end is reported.
fn watch(ends: impl AsFd, child: &Child) -> rustix::io::Result<OwnedFd> {
    let pidfd = pidfd_open(Pid::from_child(child), PidfdFlags::empty())?;
    epoll::add(ends, &pidfd, epoll::EventData::new_u64(0), epoll::EventFlags::IN)?;
    Ok(pidfd)
}
