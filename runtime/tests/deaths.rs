//! Whoever dies, whenever: the others keep their distance on their own senses, and get there.
#![allow(clippy::unwrap_used)]

use skein_protocol::frame::Frame;
use skein_protocol::record::{FaultKind, Outcome};
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use skein_runtime::mission;
use skein_runtime::pilot_host::StepScratch;
use skein_scenario::{Scenario, ScenarioSource};
use skein_world::World;

fn scenario(name: &str) -> Scenario {
    let path = format!("{}/../scenarios/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    Scenario::parse(&text, ScenarioSource { name: &path, stem: name }, &[]).unwrap()
}

/// Flies to the end with one drone's process gone from tick `at` on.
fn fly(scenario: &Scenario, dead: DroneId, at: u64) -> World {
    let mut world = mission::world(scenario).unwrap();
    let mut cockpits: Vec<_> =
        (0..scenario.formation.drones).map(|id| mission::pilot_host(scenario, DroneId(id), 1, SimTime::ZERO)).collect();
    let (mut desk, mut stats) = (StepScratch::default(), LinkStats::default());
    while world.ended().is_none() {
        let tick = world.tick();
        let down = world.downlink().view();
        let mut answers: Vec<(DroneId, Slot, Vec<Frame>)> = Vec::new();
        for (pilot_host, id) in cockpits.iter_mut().zip(0..).filter(|(_, id)| tick < at || DroneId(*id) != dead) {
            let mut slot = Slot::default();
            let said = pilot_host.step(&down, &mut desk, &mut slot, &mut stats);
            let frames = said.iter().map(Message::encode).collect();
            answers.push((DroneId(id), slot, frames));
        }
        if tick == at {
            world.mark_dead(dead, FaultKind::Kill, false, "");
        }
        for (id, slot, frames) in &answers {
            world.take_slot(*id, slot);
            world.take_frames(*id, frames);
        }
        world.advance();
    }
    world
}

/// Every drone, at moments from before the first plan to the closed formation.
fn all_get_there(name: &str) {
    let scenario = scenario(name);
    let mut failed = Vec::new();
    for drone in 0..scenario.formation.drones {
        for at in (40..2600).step_by(100) {
            let world = fly(&scenario, DroneId(drone), at);
            let separation_m = world.min_separation_m();
            if world.ended() != Some(Outcome::Reached) || separation_m < scenario.drone.safe_distance_m {
                let (end, clearance_m) = (world.ended(), world.min_clearance_m());
                failed.push(format!("drone {drone} dead at tick {at}: {end:?}, {separation_m} m, {clearance_m} m"));
            }
        }
    }
    assert!(failed.is_empty(), "{name}, {} failed:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn any_drone_may_die_at_any_time_in_s2() {
    all_get_there("s2-right");
}

#[test]
fn any_drone_may_die_at_any_time_in_the_tight_formation_of_s1() {
    all_get_there("s1-right");
}
