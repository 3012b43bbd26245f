//! Turns the faults of a scenario into the world's fault plan.

use skein_protocol::{DroneId, Vec2};
use skein_scenario::{Fault as Keys, FaultEvent, FaultKind, FaultTarget, Scenario, Sensor};
use skein_world::RangingErrors;
use skein_world::faults::{
    ClockDrift, Fault, FaultEffect, FaultPlan, FaultTargets, FaultTime, FaultTrigger, Noise, PositionDrift, Wind,
};

/// How long a gust lasts if the scenario does not say, s. The key `gust_s` documents this default.
const GUST_S: f64 = 1.0;

/// The faults of a mission, in the order of the scenario file.
pub(crate) fn fault_plan(scenario: &Scenario) -> FaultPlan {
    let drones = scenario.formation.drones;
    let fault = |keys: &Keys| Fault {
        effect: effect(keys, drones),
        time: time(keys),
        targets: targets(keys, scenario),
        for_s: keys.for_s.unwrap_or(f64::INFINITY),
    };
    FaultPlan { seed: scenario.seed, faults: scenario.fault_plan.iter().map(fault).collect() }
}

/// How many new processes drones may get in flight.
pub(crate) fn restarts(scenario: &Scenario) -> usize {
    let plan = fault_plan(scenario);
    let restarts = plan.faults.iter().filter(|fault| fault.effect == FaultEffect::Restart);
    let targets = restarts.map(|fault| match &fault.targets {
        FaultTargets::Drones(ids) => ids.len(),
        FaultTargets::All => scenario.formation.drones as usize,
        _ => 1,
    });
    targets.sum()
}

fn effect(keys: &Keys, drones: u32) -> FaultEffect {
    let vector = |key: Option<[f64; 2]>| key.map_or_else(Vec2::zeros, Vec2::from);
    match keys.kind {
        FaultKind::HostDown if keys.for_s.is_some() => FaultEffect::Restart,
        FaultKind::Kill | FaultKind::HostDown => FaultEffect::Kill,
        FaultKind::Freeze | FaultKind::HostCut => FaultEffect::Freeze,
        FaultKind::Restart => FaultEffect::Restart,
        FaultKind::Slow => FaultEffect::Slow(keys.reaction_time_s.unwrap_or(0.0)),
        FaultKind::Deaf => FaultEffect::Deaf,
        FaultKind::Mute => FaultEffect::Mute,
        FaultKind::Partition => {
            let sides = keys.sides.as_ref().map(|sides| sides.of(drones)).unwrap_or_default();
            FaultEffect::Partition(sides.into_iter().map(ids).collect())
        }
        FaultKind::Blind => FaultEffect::Blind {
            obstacles: keys.sensor != Some(Sensor::Ranging),
            ranging: keys.sensor != Some(Sensor::Obstacles),
        },
        FaultKind::Ranging => FaultEffect::Ranging(ranging(keys)),
        FaultKind::Gnss => FaultEffect::Gnss(PositionDrift {
            bias_m: vector(keys.position_bias_m),
            drift_mps: vector(keys.position_drift_mps),
            max_m: keys.position_error_max_m.unwrap_or(f64::INFINITY),
        }),
        FaultKind::Clock => FaultEffect::Clock(ClockDrift {
            offset_s: keys.clock_offset_s.unwrap_or(0.0),
            drift_ppm: keys.clock_drift_ppm.unwrap_or(0.0),
        }),
        FaultKind::Noise => FaultEffect::Noise(Noise {
            position_bias_m: vector(keys.position_bias_m),
            position_std_m: keys.position_std_m.unwrap_or(0.0),
            velocity_bias_mps: vector(keys.velocity_bias_mps),
            velocity_std_mps: keys.velocity_std_mps.unwrap_or(0.0),
        }),
        FaultKind::Wind => FaultEffect::Wind(Wind {
            acceleration_mps2: vector(keys.wind_mps2),
            gust_mps2: keys.gust_mps2.unwrap_or(0.0),
            gust_s: keys.gust_s.unwrap_or(GUST_S),
        }),
    }
}

fn ranging(keys: &Keys) -> RangingErrors {
    let ideal = RangingErrors::default();
    RangingErrors {
        std_m: keys.ranging_std_m.unwrap_or(ideal.std_m),
        bearing_std_rad: keys.ranging_bearing_std_rad.unwrap_or(ideal.bearing_std_rad),
        velocity_std_mps: keys.ranging_velocity_std_mps.unwrap_or(ideal.velocity_std_mps),
        outlier_share: keys.ranging_outlier_share.unwrap_or(ideal.outlier_share),
        outlier_m: keys.ranging_outlier_m.unwrap_or(ideal.outlier_m),
        dropout_share: keys.ranging_dropout_share.unwrap_or(ideal.dropout_share),
        latency_s: keys.ranging_latency_s.unwrap_or(ideal.latency_s),
        field_rad: keys.ranging_field_rad.unwrap_or(ideal.field_rad),
        occlusion: keys.ranging_occlusion.unwrap_or(ideal.occlusion),
    }
}

fn time(keys: &Keys) -> FaultTime {
    let Some(event) = keys.on else { return FaultTime::At(keys.at_s.unwrap_or(0.0)) };
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
    FaultTime::On { event, stage: keys.stage as usize, after_s: keys.after_s }
}

fn targets(keys: &Keys, scenario: &Scenario) -> FaultTargets {
    if let Some(host) = &keys.host {
        let hosts = scenario.hosts_of_drones().into_iter().zip(0..);
        return FaultTargets::Drones(ids(hosts
            .filter(|(name, _)| name.as_ref() == Some(host))
            .map(|(_, id)| id)
            .collect()));
    }
    match (keys.drone, &keys.drones, keys.target) {
        (Some(drone), _, _) => FaultTargets::Drones(ids(vec![drone])),
        (_, Some(drones), _) => FaultTargets::Drones(ids(drones.clone())),
        (_, _, Some(FaultTarget::Leader)) => FaultTargets::Leader,
        (_, _, Some(FaultTarget::GroupLeader(group))) => FaultTargets::GroupLeader(group),
        (_, _, Some(FaultTarget::FirstInQueue)) => FaultTargets::FirstInQueue,
        (_, _, Some(FaultTarget::LastInQueue)) => FaultTargets::LastInQueue,
        (_, _, Some(FaultTarget::Member)) => FaultTargets::Member,
        (_, _, Some(FaultTarget::Random)) => FaultTargets::Random,
        (_, _, Some(FaultTarget::All) | None) => FaultTargets::All,
    }
}

fn ids(drones: Vec<u32>) -> Vec<DroneId> {
    drones.into_iter().map(DroneId).collect()
}
