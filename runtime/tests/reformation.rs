//! Whatever method gives the slots to the drones, the formation closes.
#![allow(clippy::unwrap_used)]

use skein_protocol::frame::Frame;
use skein_protocol::record::Outcome;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use skein_runtime::mission;
use skein_runtime::pilot_host::StepScratch;
use skein_scenario::{Scenario, ScenarioSource};
use skein_world::World;

/// The digest of S2 flown with one method; the mission has to end in formation, the distances kept.
fn fly(name: &str, lambda: &str) -> u64 {
    let path = format!("{}/../scenarios/paper/s2-right.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap();
    let sets = [("mission.reformation", name), ("mission.tps_lambda", lambda)];
    let sets = sets.map(|(key, value)| (key.to_owned(), value.to_owned()));
    let scenario = Scenario::parse(&text, ScenarioSource { name: &path, stem: "s2-right" }, &sets).unwrap();
    let world = to_the_end(&scenario);
    let separation_m = world.min_separation_m();
    assert_eq!(world.ended(), Some(Outcome::Reached), "{name}");
    assert!(separation_m >= scenario.drone.safe_distance_m, "{name}: {separation_m} m");
    assert!(world.min_clearance_m() >= scenario.avoidance.clearance_m, "{name}: {} m", world.min_clearance_m());
    world.digest()
}

fn to_the_end(scenario: &Scenario) -> World {
    let mut world = mission::world(scenario).unwrap();
    let ids = 0..scenario.formation.drones;
    let mut cockpits: Vec<_> = ids.map(|id| mission::pilot_host(scenario, DroneId(id), 1, SimTime::ZERO)).collect();
    let (mut desk, mut stats) = (StepScratch::default(), LinkStats::default());
    while world.ended().is_none() {
        let down = world.downlink().view();
        let mut answers: Vec<(Slot, Vec<Frame>)> = Vec::new();
        for pilot_host in &mut cockpits {
            let mut slot = Slot::default();
            let said = pilot_host.step(&down, &mut desk, &mut slot, &mut stats);
            let frames = said.iter().map(Message::encode).collect();
            answers.push((slot, frames));
        }
        for (id, (slot, frames)) in (0..).zip(&answers) {
            world.take_slot(DroneId(id), slot);
            world.take_frames(DroneId(id), frames);
        }
        world.advance();
    }
    world
}

#[test]
fn s2_is_flown_to_the_end_with_each_method() {
    let optimal = fly("optimal", "0");
    assert_eq!(fly("tps", "0"), optimal, "free bending is not the optimum");
    assert_ne!(fly("tps", "1000"), optimal, "λ has no effect");
    assert_ne!(fly("greedy", "0"), optimal, "the method has no effect");
    // Nobody overtakes in this flight: the order of numbers is the optimum here.
    assert_eq!(fly("identity", "0"), optimal);
}
