//! The inline runtime: the same pilots and the same world, stepped by function calls in one thread. The oracle for
//! determinism, and the engine for large sweeps.

use crate::cockpit::Cockpit;
use crate::{RunEnd, RuntimeError, mission};
use skein_protocol::frame::Frame;
use skein_protocol::record::RecordSink;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime};
use skein_scenario::Scenario;
use std::time::Instant;

/// One drone and what it answered in the current tick.
struct Seat {
    cockpit: Cockpit,
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
    mut interrupted: impl FnMut() -> Option<i32>,
) -> Result<RunEnd, RuntimeError> {
    let started = Instant::now();
    let mut world = mission::world(scenario)?;
    let seat = |id| Seat {
        cockpit: mission::cockpit(scenario, DroneId(id), 1, SimTime::ZERO),
        slot: Slot::default(),
        frames: Vec::new(),
        stats: LinkStats::default(),
    };
    let mut seats: Vec<Seat> = (0..scenario.formation.drones).map(seat).collect();
    let startup_s = started.elapsed().as_secs_f64();
    let (opened, mut signal, mut sink_error) = (Instant::now(), None, None);
    while world.ended().is_none() {
        let down = world.downlink().view();
        for seat in &mut seats {
            seat.cockpit.receive(&down, &mut seat.stats);
            let frames = seat.cockpit.step(&down, &mut seat.slot, &mut seat.stats);
            seat.frames.clear();
            seat.frames.extend_from_slice(frames);
        }
        for (seat, id) in seats.iter().zip(0..) {
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
    Ok(RunEnd { startup_s, signal, sink_error, failure: None })
}

/// An error stops the recording, never the mission.
fn keep(sink: &mut dyn RecordSink, world: &skein_world::World, error: &mut Option<String>) {
    if error.is_none() {
        *error = sink.take(world.record()).err();
    }
}
