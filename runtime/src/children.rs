//! The child processes of a launcher.

use crate::child_args::{ChildArgs, lighten};
use crate::clock::Clock;
use crate::drone_range::DroneRange;
use crate::error::RuntimeError;
use crate::host_share::{HostReport, HostShare};
use crate::launch::{ProcessInfo, ProcessRole};
use crate::process_state::is_stopped;
use crate::program::Program;
use crate::programs::Programs;
use crate::relay_line::{RelayLine, RelayRequest};
use rustix::event::{Timespec, epoll};
use rustix::io::retry_on_intr;
use rustix::process::{Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, kill_process, pidfd_open, waitid};
use skein_protocol::{DroneId, Tick};
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
    /// A process in the place of drones that fly on another machine: the host's number, and the drones.
    Relay(usize, DroneRange),
}

impl ChildRole {
    /// The drones in whose place the process is.
    pub(crate) fn drones(self) -> Option<DroneRange> {
        match self {
            Self::World => None,
            Self::Drones(range) | Self::Relay(_, range) => Some(range),
        }
    }
}

impl fmt::Display for ChildRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::World => f.write_str("the world"),
            Self::Relay(_, DroneRange { first, count, .. }) => {
                write!(f, "the relay of drones {first} to {}", first.0 + count - 1)
            }
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
    /// The line to a relay.
    line: Option<RelayLine>,
    /// Watched by [`Children::ends`] for as long as it is open.
    _pidfd: OwnedFd,
}

impl Running {
    fn flies(&self, drone: DroneId) -> bool {
        matches!(self.role, ChildRole::Drones(range) if range.has(drone))
    }

    fn relays(&self, drone: DroneId) -> bool {
        matches!(self.role, ChildRole::Relay(_, range) if range.has(drone))
    }

    fn pid(&self) -> Pid {
        Pid::from_child(&self.child)
    }
}

/// Processes that were started and not yet reaped. Dropping this kills and reaps all of them.
pub(crate) struct Children<'l> {
    programs: Programs<'l>,
    hosts: &'l [HostShare],
    args: ChildArgs,
    patience: Duration,
    /// The last reports of relays that have ended, with the number of the host.
    reports: Vec<(usize, HostReport)>,
    running: Vec<Running>,
    /// Reports the ends of processes. The cost of a wait does not depend on their number.
    ends: OwnedFd,
}

impl<'l> Children<'l> {
    /// No processes yet. All that are started get these arguments.
    pub(crate) fn new(
        programs: Programs<'l>,
        hosts: &'l [HostShare],
        args: ChildArgs,
        patience: Duration,
    ) -> Result<Self, RuntimeError> {
        let ends = epoll::create(epoll::CreateFlags::CLOEXEC)
            .map_err(|error| RuntimeError::system("watching processes")(error.into()))?;
        Ok(Self { programs, hosts, args, patience, reports: Vec::new(), running: Vec::new(), ends })
    }

    /// Starts a process. Call this from one thread that lives as long as the run: a child dies with the thread that
    /// started it.
    pub(crate) fn spawn(&mut self, role: ChildRole, clock: Clock) -> Result<(), RuntimeError> {
        let mut command = self.command(role, clock);
        let mut line = None;
        if let ChildRole::Relay(..) = role {
            let (own, other) = RelayLine::pair()?;
            line = Some(own);
            command.stdin(other);
        }
        let mut child =
            command.spawn().map_err(RuntimeError::system(format!("starting {role} as {}", self.program(role))))?;
        match watch(&self.ends, &child) {
            Ok(pidfd) => {
                self.running.push(Running { role, child, line, _pidfd: pidfd });
                Ok(())
            }
            Err(error) => {
                // No one else would end it.
                let _ = (child.kill(), child.wait());
                Err(RuntimeError::system(format!("watching {role}"))(error.into()))
            }
        }
    }

    /// Starts the processes of the drones from `first` on and below `end`, each with up to `per_process` drones, in this incarnation
    /// and from this tick on.
    pub(crate) fn spawn_drones(
        &mut self,
        (mut first, end): (u32, u32),
        per_process: u32,
        (incarnation, first_tick): (u32, Tick),
        clock: Clock,
    ) -> Result<(), RuntimeError> {
        while first < end {
            // A process has the drones from a multiple of `per_process` on, or fewer if they fly different programs.
            let most = (first + per_process - first % per_process).min(end);
            let others = (first..most).take_while(|&id| self.share(DroneId(first), DroneId(id)));
            let count = others.count() as u32;
            self.spawn(ChildRole::Drones(DroneRange { first: DroneId(first), count, incarnation, first_tick }), clock)?;
            first += count;
        }
        Ok(())
    }

    fn command(&self, role: ChildRole, clock: Clock) -> Command {
        let mut command = self.program(role).command();
        match role {
            ChildRole::World => {
                let patience_s = self.patience.as_secs_f64().to_string();
                command.args(["world", "--clock", &clock.to_string(), "--patience", &patience_s])
            }
            ChildRole::Drones(range) => range.append_to(command.arg("drone")),
            ChildRole::Relay(host, range) => {
                let patience_s = self.patience.as_secs_f64().to_string();
                command.args([
                    "--host",
                    &self.hosts[host].name,
                    "--clock",
                    &clock.to_string(),
                    "--patience",
                    &patience_s,
                ]);
                range.append_to(&mut command)
            }
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
            ChildRole::Relay(host, _) => &self.hosts[host].relay,
        }
    }

    /// Whether one process can fly both drones.
    fn share(&self, one: DroneId, other: DroneId) -> bool {
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
                if let (ChildRole::Relay(host, _), Some(line)) = (running.role, &mut running.line) {
                    self.reports.extend(line.report().map(|report| (host, report)));
                }
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

    /// Whether a relay is in the drone's place.
    pub(crate) fn is_relayed(&self, drone: DroneId) -> bool {
        self.running.iter().any(|running| running.relays(drone))
    }

    /// Has a request carried out on the host of a drone; the reply. `None` if there is no relay, or it did not answer in time.
    pub(crate) fn ask_host(&mut self, request: RelayRequest, limit: Duration) -> Option<u32> {
        let relay = self.running.iter_mut().find(|running| running.relays(DroneId(request.drone)))?;
        relay.line.as_mut()?.ask(request, limit)
    }

    /// Kills the relay of a drone and reaps it. Returns all drones in whose place it was.
    pub(crate) fn kill_relay(&mut self, drone: DroneId) -> Option<DroneRange> {
        let index = self.running.iter().position(|running| running.relays(drone))?;
        let mut running = self.running.remove(index);
        // As in `kill_drone`.
        let _ = running.child.kill();
        running.child.wait().is_ok().then_some(running.role.drones()?)
    }

    /// The last reports of relays that have ended, with the number of the host.
    pub(crate) fn reports(&mut self) -> Vec<(usize, HostReport)> {
        std::mem::take(&mut self.reports)
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
                ChildRole::Drones(range) | ChildRole::Relay(_, range) => {
                    (ProcessRole::Drone, range.ids().map(|id| Some(id.0)).collect())
                }
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
