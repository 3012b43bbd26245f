//! Whoever dies, whenever: the others keep their distance on their own senses, and get there.

use skein_protocol::frame::Frame;
use skein_protocol::record::{FaultKind, Outcome};
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime};
use skein_runtime::mission;
use skein_scenario::{Scenario, Source};

/// What became of a mission in which one drone's process died.
#[derive(Debug)]
struct Fate {
    outcome: Outcome,
    separation_m: f64,
    clearance_m: f64,
}

fn scenario(name: &str, overrides: &[(&str, &str)]) -> Scenario {
    let path = format!("{}/../scenarios/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let overrides: Vec<(String, String)> = overrides.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    Scenario::parse(&text, Source { name: &path, stem: name }, &overrides).unwrap()
}

/// Flies with one drone's process gone from tick `at` on.
fn fly(scenario: &Scenario, dead: DroneId, at: u64) -> Fate {
    let mut world = mission::world(scenario).unwrap();
    let mut cockpits: Vec<_> =
        (0..scenario.formation.drones).map(|id| mission::cockpit(scenario, DroneId(id), 1, SimTime::ZERO)).collect();
    let mut stats = LinkStats::default();
    while world.ended().is_none() {
        let tick = world.tick();
        let down = world.downlink().view();
        let mut answers: Vec<(DroneId, Slot, Vec<Frame>)> = Vec::new();
        for (cockpit, id) in cockpits.iter_mut().zip(0..).filter(|(_, id)| tick < at || DroneId(*id) != dead) {
            let mut slot = Slot::default();
            cockpit.receive(&down, &mut stats);
            let frames = cockpit.step(&down, &mut slot, &mut stats).to_vec();
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
    Fate {
        outcome: world.ended().unwrap(),
        separation_m: world.min_separation_m(),
        clearance_m: world.min_clearance_m(),
    }
}

fn all_get_there(name: &str, overrides: &[(&str, &str)]) {
    let scenario = scenario(name, overrides);
    let mut failed = Vec::new();
    for drone in 0..8 {
        for at in (40..2600).step_by(100) {
            let fate = fly(&scenario, DroneId(drone), at);
            if fate.outcome != Outcome::Reached {
                failed.push(format!("{name}, drone {drone} dead at tick {at}: {fate:?}"));
            }
        }
    }
    assert!(failed.is_empty(), "{} failed:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn any_drone_may_die_at_any_time_in_s2() {
    all_get_there("s2-right", &[]);
}

#[test]
fn any_drone_may_die_at_any_time_in_s1() {
    all_get_there("s1-right", &[]);
}
