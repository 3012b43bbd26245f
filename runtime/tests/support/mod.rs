//! What several tests of the runtime share.
#![allow(dead_code, reason = "each test uses a part of it")]

use skein_protocol::frame::Frame;
use skein_protocol::record::FaultKind;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime, Tick};
use skein_runtime::{DroneFactory, PilotHost, PilotRegistry, StepScratch, mission};
use skein_scenario::{Scenario, ScenarioSource};
use skein_world::World;

/// A scenario file below `scenarios`, such as `paper/s2-right`, with these keys set.
pub(crate) fn scenario(name: &str, sets: &[(&str, &str)]) -> Scenario {
    let path = format!("{}/../scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    parse(&std::fs::read_to_string(&path).unwrap(), sets)
}

/// A scenario from text, with these keys set.
pub(crate) fn parse(text: &str, sets: &[(&str, &str)]) -> Scenario {
    let sets: Vec<_> = sets.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    Scenario::parse(text, ScenarioSource { name: "test", stem: "test" }, &sets)
        .unwrap_or_else(|errors| panic!("{errors}"))
}

/// The drones of a scenario before their first tick, with the paper's pilot.
pub(crate) fn pilot_hosts(scenario: &Scenario) -> Vec<PilotHost> {
    let pilots = PilotRegistry::built_in().unwrap();
    let factory = DroneFactory::new(scenario, &pilots);
    (0..scenario.formation.drones).map(|id| factory.pilot_host(DroneId(id), 1, SimTime::ZERO).unwrap()).collect()
}

/// Flies to the end. `killed` names a drone whose process ends in a tick: from then on it does not answer.
pub(crate) fn fly_to_the_end(scenario: &Scenario, killed: Option<(DroneId, Tick)>) -> World {
    let mut world = mission::world(scenario).unwrap();
    let mut pilot_hosts = pilot_hosts(scenario);
    let (mut scratch, mut stats) = (StepScratch::default(), LinkStats::default());
    while world.ended().is_none() {
        let tick = world.tick();
        let is_dead = |id: u32| killed.is_some_and(|(dead, at)| tick >= at && DroneId(id) == dead);
        let down = world.downlink().view();
        let mut answers: Vec<(DroneId, Slot, Vec<Frame>)> = Vec::new();
        for (pilot_host, id) in pilot_hosts.iter_mut().zip(0..).filter(|(_, id)| !is_dead(*id)) {
            let mut slot = Slot::default();
            let said = pilot_host.step(&down, &mut scratch, &mut slot, &mut stats);
            answers.push((DroneId(id), slot, said.frames().collect()));
        }
        if let Some((dead, _)) = killed.filter(|(_, at)| tick == *at) {
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
