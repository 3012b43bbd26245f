//! The inline runtime: the same pilots and the same world, stepped by function calls in one thread. The oracle for
//! determinism, and the engine for large sweeps.

use crate::cockpit::{Cockpit, Desk};
use crate::{PilotKind, RunEnd, RuntimeError, mission};
use skein_protocol::downlink::DownlinkView;
use skein_protocol::frame::Frame;
use skein_protocol::record::RecordSink;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use skein_scenario::Scenario;
use skein_world::faults::ProcessOrder;
use std::time::Instant;

/// One drone and what it answered in the current tick.
struct Seat {
    /// `None`: its process is gone.
    cockpit: Option<Cockpit>,
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
    let (yard, mut desk) = (mission::Yard::new(scenario, pilot), Desk::default());
    let started = Instant::now();
    let mut world = mission::world(scenario)?;
    let seat = |id| Seat {
        cockpit: Some(yard.cockpit(DroneId(id), 1, SimTime::ZERO)),
        frozen: false,
        slot: Slot::default(),
        frames: Vec::new(),
        stats: LinkStats::default(),
    };
    let mut seats: Vec<Seat> = (0..scenario.formation.drones).map(seat).collect();
    let startup_s = started.elapsed().as_secs_f64();
    let (opened, mut signal, mut sink_error) = (Instant::now(), None, None);
    while world.ended().is_none() {
        let start = world.now();
        world
            .orders()
            .iter()
            .for_each(|&order| carry_out(order, &mut seats, |id, incarnation| yard.cockpit(id, incarnation, start)));
        let down = world.downlink().view();
        seats.iter_mut().for_each(|seat| seat.answer(&down, &mut desk));
        for (seat, id) in seats.iter().zip(0..).filter(|(seat, _)| seat.flies()) {
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
    seats.iter().for_each(|seat| stats.merge(&seat.stats));
    world.finish(&stats, wall_s);
    keep(sink, &world, &mut sink_error);
    Ok(RunEnd { startup_s, signal, sink_error, ..RunEnd::default() })
}

impl Seat {
    /// Whether it has a process, and one that is not stopped.
    fn flies(&self) -> bool {
        self.cockpit.is_some() && !self.frozen
    }

    fn answer(&mut self, down: &DownlinkView<'_>, desk: &mut Desk) {
        let Some(cockpit) = self.cockpit.as_mut().filter(|_| !self.frozen) else { return };
        let said = cockpit.step(down, desk, &mut self.slot, &mut self.stats);
        self.frames.clear();
        self.frames.extend(said.iter().map(Message::encode));
    }
}

/// Does to a pilot what the process runtime does to a process; `make` makes a new one.
fn carry_out(order: ProcessOrder, seats: &mut [Seat], make: impl Fn(DroneId, u32) -> Cockpit) {
    match order {
        ProcessOrder::Kill(id) => {
            let seat = &mut seats[id.index()];
            (seat.cockpit, seat.frozen) = (None, false);
        }
        ProcessOrder::Freeze(id) => seats[id.index()].frozen = true,
        ProcessOrder::Resume(id) => seats[id.index()].frozen = false,
        ProcessOrder::Restart(id, incarnation) => {
            seats[id.index()].cockpit = Some(make(id, incarnation));
        }
    }
}

/// An error stops the recording, never the mission.
fn keep(sink: &mut dyn RecordSink, world: &skein_world::World, error: &mut Option<String>) {
    if error.is_none() {
        *error = sink.take(world.record()).err();
    }
}
