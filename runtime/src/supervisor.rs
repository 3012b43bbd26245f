//! The launcher's part of a run in processes: it makes the domain, starts the world and the drones, records, and looks
//! after them until the last one has ended.

use crate::children::{Children, Role};
use crate::drone_process::{DroneRange, scenario_path};
use crate::world_process::DISMISSED;
use crate::{Clock, PilotKind, RunEnd, RuntimeError, mission};
use skein_bus::{
    Control, ControlSpec, Domain, PinMode, ProcessRequest, RecordSubscriber, RequestKind, Services, WaitMode,
    WorldState, allowed_cores, clean_dead_nodes, raise_file_limit,
};
use skein_protocol::record::{RecordSink, RecordView};
use skein_protocol::{DroneId, Tick};
use skein_scenario::Scenario;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::{Duration, Instant};

/// How a run in processes is started.
pub struct Launch<'a> {
    /// What is flown.
    pub scenario: &'a Scenario,
    /// What paces it.
    pub clock: Clock,
    /// Whether processes keep to one core each.
    pub pin: PinMode,
    /// How they wait for each other.
    pub wait: WaitMode,
    /// What flies the drones.
    pub pilot: PilotKind,
    /// Drones in a process, from 1. With more than one no fault of the scenario may end or stop a process.
    pub per_process: u32,
    /// The executable that knows the roles `world` and `drone`.
    pub executable: PathBuf,
    /// Told who is there: once all are ready and before the first tick, and again, with those that are gone, when a
    /// drone got a new process.
    pub on_ready: &'a mut dyn FnMut(&[ProcessInfo]) -> Result<(), String>,
    /// Asked about once a millisecond whether to stop: it gives the signal's number.
    pub interrupted: &'a mut dyn FnMut() -> Option<i32>,
}

/// A process of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProcessInfo {
    /// `launcher`, `world` or `drone`.
    pub role: &'static str,
    /// The drone's number; `None` for the others.
    pub id: Option<u32>,
    /// Its process id.
    pub pid: u32,
}

/// Processes that are not ready after this were kept from it: the base, and more for each drone.
const START_LIMIT: Duration = Duration::from_secs(20);
const START_LIMIT_PER_DRONE: Duration = Duration::from_millis(100);
/// How long processes may take to end by themselves.
const END_LIMIT: Duration = Duration::from_secs(2);
/// Between two looks at records, orders and signals; a death is noticed at once.
const LOOK: Duration = Duration::from_millis(1);

/// Flies a mission, a process each for the world and every drone, and hands each tick's record to `sink`.
///
/// # Errors
/// [`RuntimeError`] if it could not be started. What goes wrong in flight stands in [`RunEnd::failure`].
pub fn run(launch: Launch<'_>, sink: &mut dyn RecordSink) -> Result<RunEnd, RuntimeError> {
    let started = Instant::now();
    raise_file_limit()?;
    let drones = mission::drones(launch.scenario);
    let domain = Domain::create(&launch.scenario.name)?;
    let per_process = launch.per_process.max(1) as usize;
    let cores = match launch.pin {
        PinMode::Auto => allowed_cores()?.min(drones.div_ceil(per_process) + 1),
        PinMode::Off => 1,
    };
    let control = Control::create(ControlSpec { drones, cores, per_process, wait: launch.wait })?;
    let services = Services::create(&domain, drones, per_process, "launcher")?;
    let record = services.record_subscriber()?;
    let path = scenario_path(domain.path());
    let json = serde_json::to_vec(launch.scenario).map_err(|error| RuntimeError::Process(error.to_string()))?;
    std::fs::write(&path, json).map_err(RuntimeError::system(format!("writing {}", path.display())))?;
    let mut supervisor = Supervisor {
        children: Children::new(&launch, &domain, &control)?,
        end: RunEnd::default(),
        domain: &domain,
        processes: Vec::new(),
        incarnations: vec![1; drones],
        world_ended: None,
        control,
        record,
        sink,
        launch,
    };
    supervisor.start(drones)?;
    supervisor.end.startup_s = started.elapsed().as_secs_f64();
    supervisor.watch();
    supervisor.wind_up();
    Ok(supervisor.end)
}

struct Supervisor<'l, 's, 'd> {
    launch: Launch<'l>,
    domain: &'d Domain,
    control: Control,
    record: RecordSubscriber,
    sink: &'s mut dyn RecordSink,
    children: Children,
    /// All that were started.
    processes: Vec<ProcessInfo>,
    /// Of each drone's newest process.
    incarnations: Vec<u32>,
    world_ended: Option<ExitStatus>,
    end: RunEnd,
}

impl Supervisor<'_, '_, '_> {
    /// Starts everybody, waits until all are ready, tells who is there, and lets the world begin.
    fn start(&mut self, drones: usize) -> Result<(), RuntimeError> {
        self.children.spawn(Role::World, self.launch.clock)?;
        let (drones_u32, step) = (drones as u32, self.launch.per_process.max(1));
        for first in (0..drones_u32).step_by(step as usize) {
            let count = step.min(drones_u32 - first);
            let range = DroneRange { first: DroneId(first), count, incarnation: 1, first_tick: 0 };
            self.children.spawn(Role::Drones(range), self.launch.clock)?;
        }
        let limit = Instant::now() + START_LIMIT + START_LIMIT_PER_DRONE * drones as u32;
        let mut ready = 0;
        while ready < drones || self.control.world_state() == WorldState::Starting {
            if let Some((role, how)) = self.children.wait_any(LOOK).into_iter().next() {
                return Err(RuntimeError::Process(format!("{role} ended before the first tick: {how}")));
            }
            if let Some(signal) = (self.launch.interrupted)() {
                self.end.signal = Some(signal);
                return Ok(());
            }
            if Instant::now() > limit {
                let waited = limit.elapsed() + START_LIMIT;
                return Err(RuntimeError::Process(format!(
                    "only {ready} of {drones} drones were ready after {waited:.0?}"
                )));
            }
            while ready < drones && self.control.ready(ready).is_some() {
                ready += 1;
            }
        }
        self.record.connect()?;
        self.processes.push(ProcessInfo { role: "launcher", id: None, pid: std::process::id() });
        self.processes.extend(self.children.list());
        (self.launch.on_ready)(&self.processes).map_err(RuntimeError::Process)?;
        self.control.give_go();
        Ok(())
    }

    /// Records and looks after everybody until the world has ended, or does not end although it was asked to.
    fn watch(&mut self) {
        let mut asked = None;
        loop {
            self.reap();
            if let Some(how) = self.world_ended {
                self.take_records(true);
                self.end.failure = Some(format!("the world ended in flight: {how}"));
                return;
            }
            let finished = self.control.world_state() == WorldState::Finished;
            self.take_records(finished);
            if finished {
                self.control.request_stop(DISMISSED);
                return;
            }
            self.carry_out_orders();
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

    /// Takes what the world has recorded: with `all`, however long a slow disk takes. Otherwise that keeps nobody from
    /// being looked after; in lockstep the world waits then.
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
            if self.end.sink_error.is_none() {
                let taken = RecordView::parse(sample.bytes()).map_err(|error| error.to_string());
                self.end.sink_error =
                    taken.and_then(|view| self.sink.take(view).map_err(|error| error.to_string())).err();
            }
        }
    }

    /// Waits a little for processes to end, and tells the world of drones that have.
    fn reap(&mut self) {
        for (role, how) in self.children.wait_any(LOOK) {
            match role {
                Role::Drones(range) => range.ids().for_each(|id| self.control.mark_dead(id.index())),
                Role::World => self.world_ended = Some(how),
            }
        }
    }

    /// What the world asks for in a tick. The reply to a restart is the new incarnation, to all else 1; 0 if there is no
    /// such process.
    fn carry_out_orders(&mut self) {
        let Some(ProcessRequest { kind, drone, tick }) = self.control.next_request(Duration::ZERO) else { return };
        let reply = match kind {
            RequestKind::Kill => u32::from(self.kill(drone)),
            RequestKind::Freeze => {
                self.control.freeze(drone.index());
                u32::from(self.children.freeze_drone(drone))
            }
            RequestKind::Resume => {
                self.control.set_resume_from(drone.index(), tick);
                u32::from(self.children.resume_drone(drone))
            }
            RequestKind::Restart => self.restart(drone, tick).unwrap_or_else(|error| {
                tracing::error!(%error, "drone {drone} was not started again");
                0
            }),
        };
        self.control.answer_request(reply);
    }

    fn kill(&mut self, drone: DroneId) -> bool {
        let killed = self.children.kill_drone(drone);
        killed.into_iter().flat_map(|range| range.ids()).for_each(|id| self.control.mark_dead(id.index()));
        killed.is_some()
    }

    /// Starts a new process for a dead drone and waits until it is ready to answer `tick`; gives its incarnation.
    fn restart(&mut self, id: DroneId, first_tick: Tick) -> Result<u32, RuntimeError> {
        let drone = id.index();
        let nobody = || RuntimeError::Process(format!("there is no drone {id}"));
        let incarnation = self.incarnations.get(drone).ok_or_else(nobody)? + 1;
        // Its predecessor still has its places in the services.
        clean_dead_nodes(self.domain)?;
        self.control.revive(drone, first_tick);
        let range = DroneRange { first: id, count: 1, incarnation, first_tick };
        self.children.spawn(Role::Drones(range), self.launch.clock)?;
        let limit = Instant::now() + START_LIMIT;
        while self.control.ready(drone) != Some(incarnation) {
            self.reap();
            if self.control.is_dead(drone) || self.world_ended.is_some() || Instant::now() > limit {
                return Err(RuntimeError::Process("its new process did not get ready".to_owned()));
            }
        }
        self.incarnations[drone] = incarnation;
        self.processes.extend(self.children.list().filter(|process| process.id == Some(id.0)));
        (self.launch.on_ready)(&self.processes).map_err(RuntimeError::Process)?;
        Ok(incarnation)
    }

    /// Nobody outlives the run: drones end by themselves when the mission is closed, or are killed.
    fn wind_up(&mut self) {
        self.control.close();
        self.children.resume_all();
        if self.end.failure.is_some() {
            self.children.kill_all();
        }
        let limit = Instant::now() + END_LIMIT;
        while self.children.any() && Instant::now() < limit {
            self.children.wait_any(LOOK);
        }
        self.children.kill_all();
        self.take_records(true);
        self.end.calls = self.control.calls();
    }
}
