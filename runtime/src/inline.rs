//! The inline runtime: the same pilots and the same world, stepped by function calls in one thread. The oracle for
//! determinism, and the engine for large sweeps.

use crate::pilot_host::{PilotHost, StepScratch};
use crate::{PilotKind, RunEnd, RuntimeError, mission};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::Frame;
use skein_protocol::record::RecordSink;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use skein_scenario::Scenario;
use skein_world::faults::ProcessCommand;
use std::time::Instant;

/// One drone and what it answered in the current tick.
struct DroneHandle {
    /// `None`: its process is gone.
    pilot_host: Option<PilotHost>,
    frozen: bool,
    slot: Slot,
    frames: Vec<Frame>,
    stats: LinkStats,
}

/// Flies a mission in this thread. `interrupted` is asked in every tick whether to stop: it gives the signal's number.
///
/// # Errors
/// [`RuntimeError::Scenario`] if no world can be made of the scenario.
pub fn run(
    scenario: &Scenario,
    sink: &mut dyn RecordSink,
    interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    run_with(scenario, PilotKind::Swarm, sink, interrupted)
}

/// The same with pilots of another kind.
///
/// # Errors
/// [`RuntimeError::Scenario`] if no world can be made of the scenario.
pub fn run_with(
    scenario: &Scenario,
    pilot: PilotKind,
    sink: &mut dyn RecordSink,
    mut interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    let (yard, mut desk) = (mission::DroneFactory::new(scenario, pilot), StepScratch::default());
    let started = Instant::now();
    let mut world = mission::world(scenario)?;
    let seat = |id| DroneHandle {
        pilot_host: Some(yard.pilot_host(DroneId(id), 1, SimTime::ZERO)),
        frozen: false,
        slot: Slot::default(),
        frames: Vec::new(),
        stats: LinkStats::default(),
    };
    let mut handles: Vec<DroneHandle> = (0..scenario.formation.drones).map(seat).collect();
    let startup_s = started.elapsed().as_secs_f64();
    let (opened, mut signal, mut sink_error) = (Instant::now(), None, None);
    while world.ended().is_none() {
        let start = world.now();
        world.process_commands().iter().for_each(|&order| {
            carry_out(order, &mut handles, |id, incarnation| yard.pilot_host(id, incarnation, start))
        });
        let down = world.downlink().view();
        handles.iter_mut().for_each(|seat| seat.answer(&down, &mut desk));
        for (seat, id) in handles.iter().zip(0..).filter(|(seat, _)| seat.flies()) {
            world.take_slot(DroneId(id), &seat.slot);
            world.take_frames(DroneId(id), &seat.frames);
        }
        world.advance();
        keep(sink, &world, &mut sink_error);
        signal = interrupted();
        if let Some(number) = signal {
            world.abort(&format!("interrupted by signal {number}"));
        }
    }
    let wall_s = opened.elapsed().as_secs_f64();
    let mut stats = LinkStats::default();
    handles.iter().for_each(|seat| stats.merge(&seat.stats));
    world.finish(&stats, wall_s);
    keep(sink, &world, &mut sink_error);
    Ok(RunEnd { startup_s, signal, sink_error, ..RunEnd::default() })
}

impl DroneHandle {
    /// Whether it has a process, and one that is not stopped.
    fn flies(&self) -> bool {
        self.pilot_host.is_some() && !self.frozen
    }

    fn answer(&mut self, down: &DownlinkView<'_>, desk: &mut StepScratch) {
        let Some(pilot_host) = self.pilot_host.as_mut().filter(|_| !self.frozen) else { return };
        let said = pilot_host.step(down, desk, &mut self.slot, &mut self.stats);
        self.frames.clear();
        self.frames.extend(said.iter().map(Message::encode));
    }
}

/// Does to a pilot what the process runtime does to a process; `make` makes a new one.
fn carry_out(order: ProcessCommand, handles: &mut [DroneHandle], make: impl Fn(DroneId, u32) -> PilotHost) {
    match order {
        ProcessCommand::Kill(id) => {
            let seat = &mut handles[id.index()];
            (seat.pilot_host, seat.frozen) = (None, false);
        }
        ProcessCommand::Freeze(id) => handles[id.index()].frozen = true,
        ProcessCommand::Resume(id) => handles[id.index()].frozen = false,
        ProcessCommand::Restart(id, incarnation) => {
            handles[id.index()].pilot_host = Some(make(id, incarnation));
        }
    }
}

/// An error stops the recording, never the mission.
fn keep(sink: &mut dyn RecordSink, world: &skein_world::World, error: &mut Option<String>) {
    if error.is_none() {
        *error = sink.take(world.record()).err().map(|error| error.to_string());
    }
}
