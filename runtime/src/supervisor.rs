//! The launcher's part of a run in processes. It creates the domain, starts the world and the drones, records, carries out
//! what the world requests of processes, and ends when all of them have ended.

use crate::child_args::ChildArgs;
use crate::children::{ChildRole, Children};
use crate::drone_range::DroneRange;
use crate::error::RuntimeError;
use crate::launch::{Launch, ProcessInfo, ProcessRole};
use crate::programs::Programs;
use crate::relay_line::RelayRequest;
use crate::run_end::RunEnd;
use crate::tuning::{
    END_LIMIT, HOST_REQUEST_LIMIT, HOST_RESTART_LIMIT, HUNG_AFTER, RESTART_READY_LIMIT, START_LIMIT,
    START_LIMIT_PER_DRONE, STOPPED_POLL, SUPERVISOR_POLL,
};
use crate::world_process::DISMISSED;
use crate::{fault_plan, mission, scenario_file};
use skein_bus::{
    Control, ControlSpec, Domain, PinMode, ProcessRequest, RecordSubscriber, RequestKind, Services, SpareRoom,
    WorldState, allowed_cores, clean_dead_nodes, outlive_file_limit, raise_file_limit,
};
use skein_protocol::record::{RecordSink, RecordView};
use skein_protocol::{DroneId, Tick};
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// Flies a mission with one process for the world and one for each drone (or for [`Launch::per_process`] of them), and
/// hands the record of each tick to `sink`.
///
/// # Errors
/// [`RuntimeError`] if the run could not be started. What fails in flight is in [`RunEnd::failure`].
pub fn run(launch: Launch<'_>, sink: &mut dyn RecordSink) -> Result<RunEnd, RuntimeError> {
    let started = Instant::now();
    outlive_file_limit();
    raise_file_limit()?;
    let domain = Domain::create(&launch.scenario.name)?;
    let mut supervisor = Supervisor::new(launch, &domain, sink)?;
    supervisor.start()?;
    supervisor.end.startup_s = started.elapsed().as_secs_f64();
    supervisor.watch();
    supervisor.shut_down();
    Ok(supervisor.end)
}

struct Supervisor<'l, 's, 'd> {
    launch: Launch<'l>,
    domain: &'d Domain,
    control: Control,
    record: RecordSubscriber,
    sink: &'s mut dyn RecordSink,
    children: Children<'l>,
    /// All that were started, those that have ended included.
    processes: Vec<ProcessInfo>,
    /// The incarnation of each drone's newest process.
    incarnations: Vec<u32>,
    world_ended: Option<ExitStatus>,
    /// When the supervisor last looked whether the world is stopped.
    looked: Instant,
    /// Since when the world has been stopped.
    stopped_since: Option<Instant>,
    end: RunEnd,
    /// Shared memory for restarted processes, if the scenario restarts any.
    spare: Option<SpareRoom>,
    /// Keeps the services open for as long as the run lasts.
    services: Services,
}

impl<'l, 's, 'd> Supervisor<'l, 's, 'd> {
    /// Sets up what the processes share, and starts none.
    fn new(launch: Launch<'l>, domain: &'d Domain, sink: &'s mut dyn RecordSink) -> Result<Self, RuntimeError> {
        let drones = mission::drones(launch.scenario);
        let per_process = launch.per_process.max(1) as usize;
        let cores = match launch.pin {
            PinMode::Auto => allowed_cores()?.min(drones.div_ceil(per_process) + 1),
            PinMode::Off => 1,
        };
        let control = Control::create(ControlSpec { drones, cores, per_process, wait: launch.wait })?;
        // A relay sends what all drones of its host say.
        let senders = launch.hosts.iter().map(|host| host.count as usize).fold(per_process, usize::max);
        let services = Services::create(domain, drones, senders, "launcher")?;
        let record = services.record_subscriber()?;
        let restarts = fault_plan::restarts(launch.scenario);
        let spare = (restarts > 0).then(|| SpareRoom::keep(domain, senders, restarts)).transpose()?;
        scenario_file::write(domain.path(), launch.scenario)?;
        let args = ChildArgs::of_this_process(domain, &control, launch.pin);
        Ok(Self {
            children: Children::new(
                Programs::new(launch.scenario, launch.program),
                launch.hosts,
                args,
                launch.patience,
            )?,
            launch,
            domain,
            control,
            record,
            sink,
            processes: Vec::new(),
            incarnations: vec![1; drones],
            world_ended: None,
            looked: Instant::now(),
            stopped_since: None,
            end: RunEnd::default(),
            spare,
            services,
        })
    }

    fn drones(&self) -> usize {
        self.incarnations.len()
    }

    /// Starts all processes, waits until they are ready, reports them to the caller, and lets the world begin.
    fn start(&mut self) -> Result<(), RuntimeError> {
        self.spawn_all()?;
        if !self.wait_ready()? {
            return Ok(());
        }
        self.record.connect()?;
        self.services.reserve()?;
        self.processes.push(ProcessInfo { role: ProcessRole::Launcher, id: None, pid: std::process::id() });
        self.processes.extend(self.children.list());
        (self.launch.on_ready)(&self.processes).map_err(RuntimeError::OnReady)?;
        self.control.give_go();
        Ok(())
    }

    fn spawn_all(&mut self) -> Result<(), RuntimeError> {
        self.children.spawn(ChildRole::World, self.launch.clock)?;
        let (drones, per_process) = (self.drones() as u32, self.launch.per_process.max(1));
        let hosts = self.launch.hosts;
        for (number, host) in hosts.iter().enumerate() {
            let range = DroneRange { first: host.first, count: host.count, incarnation: 1, first_tick: 0 };
            self.children.spawn(ChildRole::Relay(number, range), self.launch.clock)?;
        }
        let here = |id: &u32| !hosts.iter().any(|host| host.flies(DroneId(*id)));
        let first = (0..drones).find(here).unwrap_or(drones);
        self.children.spawn_drones((first, drones), per_process, (1, 0), self.launch.clock)
    }

    /// Waits until all processes are ready. Returns false if a signal interrupted the wait.
    fn wait_ready(&mut self) -> Result<bool, RuntimeError> {
        let (begun, drones) = (Instant::now(), self.drones());
        let limit = START_LIMIT + START_LIMIT_PER_DRONE * drones as u32;
        let mut ready = 0;
        while ready < drones || self.control.world_state() == WorldState::Starting {
            if let Some((role, status)) = self.children.wait_any(SUPERVISOR_POLL).into_iter().next() {
                return Err(self.ended_early(role, status));
            }
            if let Some(signal) = (self.launch.interrupted)() {
                self.end.signal = Some(signal);
                return Ok(false);
            }
            let waited = begun.elapsed();
            if waited > limit {
                return Err(RuntimeError::NotReady { ready, drones, waited });
            }
            while ready < drones && self.control.ready(ready).is_some() {
                ready += 1;
            }
        }
        Ok(true)
    }

    /// Why a process ended before the first tick.
    fn ended_early(&self, role: ChildRole, status: ExitStatus) -> RuntimeError {
        let Some(found) = self.control.refused() else {
            return RuntimeError::EndedEarly { process: role.to_string(), status };
        };
        let pilot = match role {
            ChildRole::World | ChildRole::Relay(..) => String::new(),
            ChildRole::Drones(range) => {
                let names = self.launch.scenario.pilot_names();
                names.get(range.first.index()).map(|name| format!(", pilot {name:?}")).unwrap_or_default()
            }
        };
        let program = self.children.program(role).to_string();
        RuntimeError::OtherVersion { process: format!("{role}{pilot}"), program, found }
    }

    /// Records and serves the world's requests until the world has ended, or does not end although it was asked to.
    fn watch(&mut self) {
        let mut asked = None;
        loop {
            self.reap();
            if let Some(status) = self.world_ended {
                self.take_records(true);
                self.end.failure = Some(format!("the world ended in flight: {status}"));
                return;
            }
            if self.world_is_hung() {
                self.take_records(true);
                self.end.failure = Some(format!("the world was stopped for {HUNG_AFTER:.0?} and was killed"));
                return;
            }
            let finished = self.control.world_state() == WorldState::Finished;
            self.take_records(finished);
            if finished {
                self.control.request_stop(DISMISSED);
                return;
            }
            self.serve_request();
            if let (None, Some(signal)) = (self.end.signal, (self.launch.interrupted)()) {
                self.end.signal = Some(signal);
            }
            if let (None, Some(signal)) = (asked, self.end.signal) {
                self.control.request_stop(signal.unsigned_abs());
                asked = Some(Instant::now());
            }
            if asked.is_some_and(|since| since.elapsed() > END_LIMIT) {
                return;
            }
        }
    }

    /// Whether the world's process has been stopped for too long. No part of the run stops it, and all wait for it.
    fn world_is_hung(&mut self) -> bool {
        if self.looked.elapsed() < STOPPED_POLL {
            return false;
        }
        self.looked = Instant::now();
        if !self.children.world_is_stopped() {
            self.stopped_since = None;
            return false;
        }
        self.stopped_since.get_or_insert(self.looked).elapsed() > HUNG_AFTER
    }

    /// Hands records to the sink: all that are there with `all`, however slow the disk is, otherwise only while the sink is
    /// ready. A slow sink therefore does not delay the supervisor. In lockstep the world waits for it.
    fn take_records(&mut self, all: bool) {
        while all || self.sink.ready() {
            let sample = match self.record.receive() {
                Ok(Some(sample)) => sample,
                Ok(None) => return,
                Err(error) => {
                    self.end.sink_error.get_or_insert_with(|| error.to_string());
                    return;
                }
            };
            let taken = RecordView::parse(sample.bytes()).map_err(|error| error.to_string());
            let taken = taken.and_then(|view| self.sink.take(view).map_err(|error| error.to_string()));
            if let Err(error) = taken {
                self.end.bad_records += 1;
                self.end.sink_error.get_or_insert(error);
            }
        }
    }

    /// Waits shortly for processes to end, and marks the drones of those that have ended as dead.
    fn reap(&mut self) {
        for (role, status) in self.children.wait_any(SUPERVISOR_POLL) {
            match role {
                ChildRole::Drones(range) => {
                    range.ids().for_each(|id| self.control.set_end(id.index(), status));
                    self.mark_dead(range);
                }
                // All drones of the host are dead, and the scenario says which host that is.
                ChildRole::Relay(_, range) => self.mark_dead(range),
                ChildRole::World => self.world_ended = Some(status),
            }
        }
    }

    fn mark_dead(&self, range: DroneRange) {
        for id in range.ids() {
            self.control.mark_dead(id.index());
        }
    }

    /// Carries out what the world requests, and replies: with the new incarnation to a restart, with 1 to anything else,
    /// and with 0 if there is no such process.
    fn serve_request(&mut self) {
        let Some(ProcessRequest { kind, drone, tick }) = self.control.next_request(Duration::ZERO) else { return };
        let reply = match kind {
            RequestKind::Restart => self.try_restart(drone, tick),
            _ if self.children.is_relayed(drone) => self.ask_host(kind, drone, tick),
            RequestKind::Kill => u32::from(self.kill_drone(drone)),
            RequestKind::KillProcess => u32::from(self.kill(drone)),
            RequestKind::Freeze => {
                self.control.freeze(drone.index());
                u32::from(self.children.freeze_drone(drone))
            }
            RequestKind::Resume => {
                self.control.set_resume_from(drone.index(), tick);
                u32::from(self.children.resume_drone(drone))
            }
        };
        self.control.answer_request(reply);
    }

    /// Has a host do to one of its drones what the world requests. A host that does not answer is given up.
    fn ask_host(&mut self, kind: RequestKind, drone: DroneId, tick: Tick) -> u32 {
        match kind {
            RequestKind::Freeze => self.control.freeze(drone.index()),
            RequestKind::Resume => self.control.set_resume_from(drone.index(), tick),
            _ => {}
        }
        let reply = self.children.ask_host(RelayRequest::new(kind, drone.0, tick, 0), HOST_REQUEST_LIMIT);
        if reply.is_none() {
            let given_up = self.children.kill_relay(drone);
            given_up.into_iter().for_each(|range| self.mark_dead(range));
        } else if matches!(kind, RequestKind::Kill | RequestKind::KillProcess) {
            self.control.mark_dead(drone.index());
        }
        reply.unwrap_or(0)
    }

    /// Starts a new process for a dead drone. Returns its incarnation, or 0 if the drone is dead again.
    fn try_restart(&mut self, drone: DroneId, tick: Tick) -> u32 {
        let restarted = self.restart(drone, tick).unwrap_or_else(|error| {
            tracing::warn!(%error, "drone {drone} is dead again");
            self.kill(drone);
            self.control.mark_dead(drone.index());
            0
        });
        if let Some(Err(error)) = self.spare.as_ref().map(SpareRoom::keep_rest) {
            tracing::warn!(%error, "there may be no room for the next restart");
        }
        restarted
    }

    /// Ends a drone: its process, unless others fly in it.
    fn kill_drone(&mut self, drone: DroneId) -> bool {
        if self.children.flies_others(drone) {
            self.control.mark_dead(drone.index());
            return true;
        }
        self.kill(drone)
    }

    fn kill(&mut self, drone: DroneId) -> bool {
        let killed = self.children.kill_drone(drone);
        if let Some(range) = killed {
            self.mark_dead(range);
        }
        killed.is_some()
    }

    /// Starts a new process for a dead drone and waits until it is ready to answer `first_tick`. Returns its incarnation.
    fn restart(&mut self, id: DroneId, first_tick: Tick) -> Result<u32, RuntimeError> {
        let drone = id.index();
        let incarnation = self.incarnations.get(drone).map_or(0, |incarnation| incarnation + 1);
        let failed = || RuntimeError::NotRestarted { drone: id, incarnation };
        if incarnation == 0 {
            return Err(failed());
        }
        // The world counts this incarnation, too, whatever becomes of it.
        self.incarnations[drone] = incarnation;
        // The ended process still holds its places in the services.
        clean_dead_nodes(self.domain)?;
        self.spare.as_ref().map_or(Ok(()), SpareRoom::give)?;
        self.control.revive(drone, first_tick);
        let range = DroneRange { first: id, count: 1, incarnation, first_tick };
        self.start_again(range)?;
        let limit = Instant::now() + RESTART_READY_LIMIT;
        while self.control.ready(drone) != Some(incarnation) {
            self.reap();
            self.end.signal = self.end.signal.or_else(|| (self.launch.interrupted)());
            let hopeless = self.control.is_dead(drone) || self.world_ended.is_some() || self.end.signal.is_some();
            if hopeless || Instant::now() > limit {
                return Err(failed());
            }
        }
        // The world connects to the new ports next.
        self.services.reserve()?;
        self.processes.extend(self.children.list().filter(|process| process.id == Some(id.0)));
        if let Err(error) = (self.launch.on_ready)(&self.processes) {
            // The drone flies nevertheless.
            tracing::warn!(%error, "the new process of drone {id} is not listed");
        }
        Ok(incarnation)
    }

    /// Starts the new process, on the drone's host if it has one. A host that had gone may be back: it gets a new relay.
    fn start_again(&mut self, range: DroneRange) -> Result<(), RuntimeError> {
        let DroneRange { first: drone, incarnation, first_tick, .. } = range;
        if self.children.is_relayed(drone) {
            let request = RelayRequest::new(RequestKind::Restart, drone.0, first_tick, incarnation);
            let reply = self.children.ask_host(request, HOST_RESTART_LIMIT);
            let failed = RuntimeError::NotRestarted { drone, incarnation };
            return if reply == Some(incarnation) { Ok(()) } else { Err(failed) };
        }
        let host = self.launch.hosts.iter().position(|host| host.flies(drone));
        let role = host.map_or(ChildRole::Drones(range), |host| ChildRole::Relay(host, range));
        self.children.spawn(role, self.launch.clock)
    }

    /// Ends all processes: drones end by themselves when the mission is closed, and those that do not are killed.
    fn shut_down(&mut self) {
        self.control.close();
        self.children.resume_all();
        if self.end.failure.is_some() {
            self.children.kill_all();
        }
        let limit = Instant::now() + END_LIMIT;
        while !self.children.is_empty() && Instant::now() < limit {
            self.children.wait_any(SUPERVISOR_POLL);
        }
        self.end.hosts = vec![None; self.launch.hosts.len()];
        for (host, report) in self.children.reports() {
            self.end.hosts[host].get_or_insert(report);
        }
        self.children.kill_all();
        self.take_records(true);
        self.end.calls = self.control.calls();
    }
}
