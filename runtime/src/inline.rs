//! The inline runtime: it steps the same pilots and the same world by function calls in one thread. It is the reference
//! for determinism, and the engine of large sweeps.

use crate::drone_factory::DroneFactory;
use crate::error::RuntimeError;
use crate::mission;
use crate::pilot_host::{PilotHost, StepScratch};
use crate::pilot_kind::PilotKind;
use crate::run_end::RunEnd;
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::Frame;
use skein_protocol::record::RecordSink;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime};
use skein_scenario::Scenario;
use skein_world::World;
use skein_world::faults::ProcessCommand;
use std::time::Instant;

/// Flies a mission with the paper's pilot in this thread. `interrupted` is called once per tick; it returns the number of a
/// signal that should stop the run.
///
/// # Errors
/// [`RuntimeError::Scenario`] and [`RuntimeError::Shape`] if no world can be made of the scenario.
pub fn run(
    scenario: &Scenario,
    sink: &mut dyn RecordSink,
    interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    run_with(scenario, PilotKind::Swarm, sink, interrupted)
}

/// As [`run`], with a pilot of the given kind.
///
/// # Errors
/// [`RuntimeError::Scenario`] and [`RuntimeError::Shape`] if no world can be made of the scenario.
pub fn run_with(
    scenario: &Scenario,
    pilot: PilotKind,
    sink: &mut dyn RecordSink,
    mut interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    let mut end = RunEnd::default();
    let started = Instant::now();
    let mut swarm = InlineSwarm::new(scenario, pilot)?;
    end.startup_s = started.elapsed().as_secs_f64();
    let opened = Instant::now();
    while swarm.world.ended().is_none() {
        swarm.tick();
        record(sink, &swarm.world, &mut end.sink_error);
        end.signal = interrupted();
        if let Some(number) = end.signal {
            swarm.world.abort(&format!("interrupted by signal {number}"));
        }
    }
    let wall_s = opened.elapsed().as_secs_f64();
    let stats = swarm.stats();
    swarm.world.finish(&stats, wall_s);
    record(sink, &swarm.world, &mut end.sink_error);
    Ok(end)
}

/// Hands the world's record to the sink. An error stops the recording, never the mission.
fn record(sink: &mut dyn RecordSink, world: &World, error: &mut Option<String>) {
    if error.is_none() {
        *error = sink.take(world.record()).err().map(|error| error.to_string());
    }
}

/// The world and all drones of a mission.
struct InlineSwarm<'s> {
    factory: DroneFactory<'s>,
    world: World,
    drones: Vec<InlineDrone>,
    scratch: StepScratch,
}

impl<'s> InlineSwarm<'s> {
    fn new(scenario: &'s Scenario, pilot: PilotKind) -> Result<Self, RuntimeError> {
        let factory = DroneFactory::new(scenario, pilot);
        let world = mission::world(scenario)?;
        let new_drone = |id| InlineDrone::new(factory.pilot_host(DroneId(id), 1, SimTime::ZERO));
        let drones = (0..scenario.formation.drones).map(new_drone).collect();
        Ok(Self { factory, world, drones, scratch: StepScratch::default() })
    }

    fn tick(&mut self) {
        let start = self.world.now();
        for &command in self.world.process_commands() {
            carry_out(command, &mut self.drones, &self.factory, start);
        }
        let down = self.world.downlink().view();
        for drone in &mut self.drones {
            drone.step(&down, &mut self.scratch);
        }
        for (drone, id) in self.drones.iter().zip(0..).filter(|(drone, _)| drone.flies()) {
            self.world.take_slot(DroneId(id), &drone.slot);
            self.world.take_frames(DroneId(id), &drone.frames);
        }
        self.world.advance();
    }

    /// What all radio receivers have counted.
    fn stats(&self) -> LinkStats {
        let mut sum = LinkStats::default();
        for drone in &self.drones {
            sum.merge(&drone.stats);
        }
        sum
    }
}

/// Does to a pilot what the supervisor does to a process.
fn carry_out(command: ProcessCommand, drones: &mut [InlineDrone], factory: &DroneFactory<'_>, start: SimTime) {
    match command {
        ProcessCommand::Kill(id) => {
            let drone = &mut drones[id.index()];
            (drone.pilot_host, drone.frozen) = (None, false);
        }
        ProcessCommand::Freeze(id) => drones[id.index()].frozen = true,
        ProcessCommand::Resume(id) => drones[id.index()].frozen = false,
        ProcessCommand::Restart(id, incarnation) => {
            drones[id.index()].pilot_host = Some(factory.pilot_host(id, incarnation, start));
        }
    }
}

/// One drone and its answer to the current tick.
struct InlineDrone {
    /// `None` once it was killed.
    pilot_host: Option<PilotHost>,
    frozen: bool,
    slot: Slot,
    frames: Vec<Frame>,
    stats: LinkStats,
}

impl InlineDrone {
    fn new(pilot_host: PilotHost) -> Self {
        Self {
            pilot_host: Some(pilot_host),
            frozen: false,
            slot: Slot::default(),
            frames: Vec::new(),
            stats: LinkStats::default(),
        }
    }

    /// Whether its pilot is neither killed nor frozen.
    fn flies(&self) -> bool {
        self.pilot_host.is_some() && !self.frozen
    }

    fn step(&mut self, down: &DownlinkView<'_>, scratch: &mut StepScratch) {
        let Some(pilot_host) = self.pilot_host.as_mut().filter(|_| !self.frozen) else { return };
        let said = pilot_host.step(down, scratch, &mut self.slot, &mut self.stats);
        self.frames.clear();
        self.frames.extend(said.frames());
    }
}
