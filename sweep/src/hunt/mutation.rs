//! Small changes of a mission.

use crate::splitmix::SplitMix64;
use skein_scenario::{Fault, FaultKind, Obstacle, Scenario, ScenarioSource};
use std::f64::consts::TAU;

/// Attempts to find a change that leaves the scenario valid.
const ATTEMPTS: u64 = 20;
/// Most changes of one neighbour.
const MOST_CHANGES: u32 = 3;
/// Longest shift of an obstacle or of the goal, in safe distances.
const SHIFT: f64 = 1.0;
/// Most faults of a neighbour.
const MOST_FAULTS: usize = 3;
/// A fault that is added begins within this time, s. Most flights are under way then.
const FAULT_WITHIN_S: f64 = 60.0;
/// Greatest error of a broken sensor, in safe distances.
const ERROR: f64 = 0.1;
/// Greatest latency of a broken ranging sensor, s.
const LATENCY_S: f64 = 2.0;
/// Narrowest field of view of a broken ranging sensor, rad.
const FIELD_RAD: f64 = 0.5;
/// Greatest offset of a faulty clock, s.
const CLOCK_OFFSET_S: f64 = 1.0;

/// A valid scenario that differs a little from `parent`. It depends on the two keys only. `None` if no attempt is valid.
pub(super) fn neighbour(parent: &Scenario, seed: u64, number: u64) -> Option<Scenario> {
    (0..ATTEMPTS).find_map(|attempt| {
        let mut rng = SplitMix64::keyed(seed, number * ATTEMPTS + attempt);
        let mut scenario = parent.clone();
        for _ in 0..rng.integer(1, MOST_CHANGES) {
            change(&mut scenario, &mut rng);
        }
        checked(&scenario)
    })
}

/// The scenario, read again from its own text, if it is valid.
fn checked(scenario: &Scenario) -> Option<Scenario> {
    let text = scenario.to_toml().ok()?;
    Scenario::parse(&text, ScenarioSource { name: "neighbour", stem: "neighbour" }, &[]).ok()
}

fn change(scenario: &mut Scenario, rng: &mut SplitMix64) {
    let shift_m = SHIFT * scenario.drone.safe_distance_m;
    let obstacles = scenario.obstacles.len() as u32;
    match rng.integer(0, 12) {
        0 => scenario.seed = u64::from(rng.integer(1, 1_000_000)),
        1 => scenario.formation.drones = (scenario.formation.drones + rng.integer(0, 4)).saturating_sub(2).max(1),
        2 => scale(&mut scenario.formation.spacing_m, rng),
        3 => scale(&mut scenario.drone.speed_mps, rng),
        4 => scale(&mut scenario.drone.acceleration_max_mps2, rng),
        5 => scale(&mut scenario.sensors.detection_range_m, rng),
        6 => {
            scenario.formation.start_jitter_m =
                rng.between(0.0, 0.5) * (scenario.formation.spacing_m - scenario.drone.safe_distance_m)
        }
        7 => scenario.radio.loss = rng.between(0.0, 0.6),
        8 => shift_goal(scenario, rng, shift_m),
        9 => shift_fault(scenario, rng),
        10 => add_fault(scenario, rng),
        _ if obstacles > 0 => {
            let obstacle = &mut scenario.obstacles[rng.integer(0, obstacles - 1) as usize];
            if rng.integer(0, 1) == 0 { shift(obstacle, rng, shift_m) } else { resize(obstacle, rng) }
        }
        _ => {
            let mut reform_mps = scenario.reform_speed_max_mps();
            scale(&mut reform_mps, rng);
            scenario.mission.reform_speed_max_mps = Some(reform_mps);
        }
    }
}

fn scale(value: &mut f64, rng: &mut SplitMix64) {
    *value *= rng.between(0.8, 1.25);
}

fn shift_goal(scenario: &mut Scenario, rng: &mut SplitMix64, by_m: f64) {
    for coordinate in scenario.mission.goal_m.iter_mut().flatten() {
        *coordinate += rng.between(-by_m, by_m);
    }
}

fn shift_fault(scenario: &mut Scenario, rng: &mut SplitMix64) {
    let count = scenario.fault_plan.len() as u32;
    if count > 0 {
        let fault = &mut scenario.fault_plan[rng.integer(0, count - 1) as usize];
        for time_s in [&mut fault.at_s, &mut fault.for_s].into_iter().flatten() {
            *time_s = (*time_s + rng.between(-2.0, 2.0)).max(0.1);
        }
    }
}

/// Adds a fault that the safety of the other drones must not depend on.
fn add_fault(scenario: &mut Scenario, rng: &mut SplitMix64) {
    if scenario.fault_plan.len() >= MOST_FAULTS || scenario.formation.drones < 2 {
        return;
    }
    let drone = rng.integer(0, scenario.formation.drones - 1);
    let (at_s, for_s) = (rng.between(0.1, FAULT_WITHIN_S), rng.between(0.5, 20.0));
    let (kind, for_s) = match rng.integer(0, 7) {
        0 => (FaultKind::Kill, None),
        1 => (FaultKind::Freeze, Some(for_s)),
        2 => (FaultKind::Restart, Some(for_s)),
        3 => (FaultKind::Deaf, Some(for_s)),
        4 => (FaultKind::Mute, Some(for_s)),
        5 => (FaultKind::Ranging, Some(for_s)),
        6 => (FaultKind::Gnss, Some(for_s)),
        _ => (FaultKind::Clock, Some(for_s)),
    };
    let mut fault = Fault::of_drone(kind, drone, at_s, for_s);
    mislead(&mut fault, rng, ERROR * scenario.drone.safe_distance_m);
    scenario.fault_plan.push(fault);
}

/// Draws the errors of a sensor's or a clock's fault. Distances are wrong by up to `by_m`, m.
fn mislead(fault: &mut Fault, rng: &mut SplitMix64, by_m: f64) {
    match fault.kind {
        FaultKind::Ranging => {
            fault.ranging_std_m = Some(rng.between(0.0, 0.5 * by_m));
            fault.ranging_outlier_share = Some(rng.between(0.0, 0.3));
            fault.ranging_outlier_m = Some(rng.between(0.0, by_m));
            fault.ranging_dropout_share = Some(rng.between(0.0, 0.5));
            fault.ranging_latency_s = Some(rng.between(0.0, LATENCY_S));
            fault.ranging_field_rad = Some(rng.between(FIELD_RAD, TAU));
            fault.ranging_occlusion = Some(rng.integer(0, 1) == 1);
        }
        FaultKind::Gnss => fault.position_bias_m = Some([0, 1].map(|_| rng.between(-0.5 * by_m, 0.5 * by_m))),
        FaultKind::Clock => fault.clock_offset_s = Some(rng.between(-CLOCK_OFFSET_S, CLOCK_OFFSET_S)),
        _ => {}
    }
}

fn shift(obstacle: &mut Obstacle, rng: &mut SplitMix64, by_m: f64) {
    let offset = [rng.between(-by_m, by_m), rng.between(-by_m, by_m)];
    let by_offset = |point: &mut [f64; 2]| *point = [point[0] + offset[0], point[1] + offset[1]];
    match obstacle {
        Obstacle::Rectangle { centre_m, .. }
        | Obstacle::Circle { centre_m, .. }
        | Obstacle::Ellipse { centre_m, .. } => {
            by_offset(centre_m);
        }
        Obstacle::Polygon { vertices_m, .. } => vertices_m.iter_mut().for_each(by_offset),
    }
}

fn resize(obstacle: &mut Obstacle, rng: &mut SplitMix64) {
    match obstacle {
        Obstacle::Circle { radius_m, .. } => scale(radius_m, rng),
        Obstacle::Rectangle { half_size_m: sizes_m, rotation_rad, .. }
        | Obstacle::Ellipse { semi_axes_m: sizes_m, rotation_rad, .. } => {
            scale(&mut sizes_m[0], rng);
            scale(&mut sizes_m[1], rng);
            *rotation_rad += rng.between(-0.2, 0.2);
        }
        Obstacle::Polygon { vertices_m, .. } => {
            let count = vertices_m.len().max(1) as f64;
            let centre = vertices_m.iter().fold([0.0, 0.0], |c, v| [c[0] + v[0] / count, c[1] + v[1] / count]);
            let factor = rng.between(0.8, 1.25);
            for vertex in vertices_m {
                *vertex = [0, 1].map(|axis| centre[axis] + (vertex[axis] - centre[axis]) * factor);
            }
        }
    }
}
