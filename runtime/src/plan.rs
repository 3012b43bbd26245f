//! The faults of a scenario as the world's plan.

use skein_protocol::{DroneId, Vec2};
use skein_scenario::{Fault as Keys, FaultEvent, FaultKind, FaultTarget, Scenario, Sensor};
use skein_world::faults::{Effect, Fault, FaultPlan, FaultTrigger, Noise, When, Whom, Wind};

/// How long a gust lasts unless the scenario says, s.
const GUST_S: f64 = 1.0;

/// What is to go wrong in a mission.
pub(crate) fn faults(scenario: &Scenario) -> FaultPlan {
    let drones = scenario.formation.drones;
    let fault = |keys: &Keys| Fault {
        effect: effect(keys, drones),
        when: when(keys),
        whom: whom(keys),
        for_s: keys.for_s.unwrap_or(f64::INFINITY),
    };
    FaultPlan { seed: scenario.seed, faults: scenario.fault_plan.iter().map(fault).collect() }
}

fn effect(keys: &Keys, drones: u32) -> Effect {
    let vector = |key: Option<[f64; 2]>| key.map_or_else(Vec2::zeros, Vec2::from);
    match keys.kind {
        FaultKind::Kill => Effect::Kill,
        FaultKind::Freeze => Effect::Freeze,
        FaultKind::Restart => Effect::Restart,
        FaultKind::Slow => Effect::Slow(keys.reaction_time_s.unwrap_or(0.0)),
        FaultKind::Deaf => Effect::Deaf,
        FaultKind::Mute => Effect::Mute,
        FaultKind::Partition => {
            let sides = keys.sides.as_ref().map(|sides| sides.of(drones)).unwrap_or_default();
            Effect::Partition(sides.into_iter().map(ids).collect())
        }
        FaultKind::Blind => Effect::Blind {
            obstacles: keys.sensor != Some(Sensor::Ranging),
            ranging: keys.sensor != Some(Sensor::Obstacles),
        },
        FaultKind::Noise => Effect::Noise(Noise {
            position_bias_m: vector(keys.position_bias_m),
            position_std_m: keys.position_std_m.unwrap_or(0.0),
            velocity_bias_mps: vector(keys.velocity_bias_mps),
            velocity_std_mps: keys.velocity_std_mps.unwrap_or(0.0),
        }),
        FaultKind::Wind => Effect::Wind(Wind {
            acceleration_mps2: vector(keys.wind_mps2),
            gust_mps2: keys.gust_mps2.unwrap_or(0.0),
            gust_s: keys.gust_s.unwrap_or(GUST_S),
        }),
    }
}

fn when(keys: &Keys) -> When {
    let Some(event) = keys.on else { return When::At(keys.at_s.unwrap_or(0.0)) };
    let event = match event {
        FaultEvent::Detected => FaultTrigger::Detected,
        FaultEvent::Grouped => FaultTrigger::Grouped,
        FaultEvent::Queued => FaultTrigger::Queued,
        FaultEvent::Gate => FaultTrigger::Gate,
        FaultEvent::Passed => FaultTrigger::Passed,
        FaultEvent::Reforming => FaultTrigger::Reforming,
        FaultEvent::LeaderElected => FaultTrigger::LeaderElected,
        FaultEvent::GroupLeaderElected => FaultTrigger::GroupLeaderElected,
    };
    When::On { event, stage: keys.stage as usize, after_s: keys.after_s }
}

fn whom(keys: &Keys) -> Whom {
    match (keys.drone, &keys.drones, keys.target) {
        (Some(drone), _, _) => Whom::Drones(ids(vec![drone])),
        (_, Some(drones), _) => Whom::Drones(ids(drones.clone())),
        (_, _, Some(FaultTarget::Leader)) => Whom::Leader,
        (_, _, Some(FaultTarget::GroupLeader(group))) => Whom::GroupLeader(group),
        (_, _, Some(FaultTarget::FirstInQueue)) => Whom::FirstInQueue,
        (_, _, Some(FaultTarget::LastInQueue)) => Whom::LastInQueue,
        (_, _, Some(FaultTarget::Member)) => Whom::Member,
        (_, _, Some(FaultTarget::Random)) => Whom::Random,
        (_, _, Some(FaultTarget::All) | None) => Whom::All,
    }
}

fn ids(drones: Vec<u32>) -> Vec<DroneId> {
    drones.into_iter().map(DroneId).collect()
}
