//! Turns a scenario into a world and into the parameters of the pilots.

use crate::error::RuntimeError;
use crate::fault_plan::fault_plan;
use skein_agent::PilotParams;
use skein_agent::detection::Braking;
use skein_agent::guidance::GuidanceParams;
use skein_agent::safety::SafetyParams;
use skein_agent::sensing_errors::SensingErrors;
use skein_leader::channel_params::ChannelParams;
use skein_leader::election::ElectionParams;
use skein_leader::params::{Between, Destination, Objective, PlannerParams, Strategy};
use skein_leader::routes::RouteParams;
use skein_leader::slots::Reformation;
use skein_protocol::formation::HOLD_SPEED_MPS;
use skein_protocol::scale::Scale;
use skein_protocol::{DroneId, SimTime, Vec2, Vec3};
use skein_scenario::{
    Between as BetweenKey, End, Failsafe, FaultKind, OutlineSensing, Parts, Reformation as ReformationKey, Scenario,
    Strategy as StrategyKey, Thrust,
};
use skein_world::{ClockErrors, EnergyModel, PositionError, RangingErrors, SensorErrors, World, WorldParams};
use std::sync::Arc;

/// Number of drones in a scenario.
#[must_use]
pub fn drones(scenario: &Scenario) -> usize {
    scenario.formation.drones as usize
}

/// Length of a tick, ns of simulated time.
#[must_use]
pub fn dt_ns(scenario: &Scenario) -> i64 {
    (scenario.time.dt_s * 1e9).round() as i64
}

/// The world at the start of the mission: every drone is at its start, at the formation's altitude, and flies at nominal
/// speed along its course.
///
/// # Errors
/// [`RuntimeError::Scenario`] and [`RuntimeError::Shape`]. A checked scenario gives no error.
pub fn world(scenario: &Scenario) -> Result<World, RuntimeError> {
    let shapes = scenario.shapes().map_err(RuntimeError::Shape)?;
    Ok(World::new(world_params(scenario)?, &starts(scenario), &shapes)?)
}

/// Position (m) and velocity (m/s) of each drone at the start of the mission, world frame.
#[must_use]
pub fn starts(scenario: &Scenario) -> Vec<(Vec3, Vec3)> {
    let velocity = (scenario.course().direction() * scenario.drone.speed_mps).push(0.0);
    let start = |place: Vec2| (place.push(scenario.altitude_m()), velocity);
    scenario.starts().into_iter().map(start).collect()
}

/// The parameters of the world.
///
/// # Errors
/// [`RuntimeError::Shape`]. A checked scenario gives no error.
pub fn world_params(scenario: &Scenario) -> Result<WorldParams, RuntimeError> {
    let drone = &scenario.drone;
    Ok(WorldParams {
        dt_ns: dt_ns(scenario),
        timeout_s: scenario.timeout_s(),
        without_way: without_way(scenario)?,
        speed_max_mps: drone.speed_max_mps,
        acceleration_max_mps2: drone.acceleration_max_mps2,
        braking_mps2: scenario.braking_mps2(),
        safe_distance_m: drone.safe_distance_m,
        clearance_m: scenario.avoidance.clearance_m,
        planning_distance_m: scenario.avoidance.planning_distance_m,
        reaction_time_s: scenario.drone.reaction_time_s,
        detection_range_m: scenario.sensors.detection_range_m,
        ranging_m: scenario.sensors.ranging.then_some(scenario.ranging_m()),
        sensors: sensor_errors(scenario),
        channel: scenario.channel(),
        locality: scenario.radio().locality(),
        failsafe: match scenario.faults.failsafe {
            Failsafe::Hover => skein_world::Failsafe::Hover,
            Failsafe::Land => skein_world::Failsafe::Land,
        },
        end: end(scenario),
        parts: parts(scenario),
        arrival_error_m: scenario.mission.arrival_error_m,
        hold_speed_mps: scale(scenario).speed(HOLD_SPEED_MPS),
        course: scenario.course(),
        shape: scenario.formation_shape(),
        spacing_m: scenario.formation.spacing_m,
        energy: EnergyModel {
            wind_mps: scenario.energy.wind_mps.into(),
            thrust: scenario.energy.thrust == Thrust::Acceleration,
        },
        faults: fault_plan(scenario),
        pilots: scenario.pilot_names(),
    })
}

/// How small the swarm is.
fn scale(scenario: &Scenario) -> Scale {
    Scale::of(scenario.drone.safe_distance_m, scenario.drone.speed_mps)
}

/// The errors of sensors and clocks.
fn sensor_errors(scenario: &Scenario) -> SensorErrors {
    let sensors = &scenario.sensors;
    SensorErrors {
        seed: scenario.seed,
        position: PositionError {
            std_m: sensors.position_std_m,
            correlation_s: sensors.position_correlation_s,
            max_m: scenario.position_noise_max_m(),
        },
        ranging: RangingErrors {
            std_m: sensors.ranging_std_m,
            bearing_std_rad: sensors.ranging_bearing_std_rad,
            velocity_std_mps: sensors.ranging_velocity_std_mps,
            outlier_share: sensors.ranging_outlier_share,
            outlier_m: sensors.ranging_outlier_m,
            dropout_share: sensors.ranging_dropout_share,
            latency_s: sensors.ranging_latency_s,
            field_rad: sensors.ranging_field_rad,
            occlusion: sensors.ranging_occlusion,
        },
        obstacle_error_max_m: sensors.obstacle_error_max_m,
        view_m: (sensors.outline == OutlineSensing::Seen).then_some(sensors.detection_range_m),
        clock: ClockErrors { offset_max_s: sensors.clock_offset_max_s, drift_max_ppm: sensors.clock_drift_max_ppm },
    }
}

/// What ends the mission.
fn end(scenario: &Scenario) -> skein_world::End {
    match (scenario.mission.end, destination(scenario)) {
        (End::Time, _) => skein_world::End::Time { duration_s: scenario.mission.duration_s.unwrap_or_default() },
        (End::Pilots, _) => skein_world::End::Pilots,
        (_, Destination::Hold { stop_x_m }) => skein_world::End::Hold { stop_x_m },
        (_, Destination::Goal { front_m }) => skein_world::End::Goal { front_m: scenario.course().to_world(front_m) },
    }
}

/// What has to be in formation at the end.
fn parts(scenario: &Scenario) -> skein_world::PartsRule {
    match scenario.mission.parts {
        Parts::One => skein_world::PartsRule::One,
        Parts::Each => skein_world::PartsRule::Each { reach_m: scenario.radio().beacon_range_m() },
    }
}

/// The drones that have no way to their destination; none if a scheduled kill may take such a drone out of the mission, or if
/// places do not end it.
fn without_way(scenario: &Scenario) -> Result<Vec<DroneId>, RuntimeError> {
    if matches!(scenario.mission.end, End::Time | End::Pilots) {
        return Ok(Vec::new());
    }
    if scenario.fault_plan.iter().any(|event| event.kind == FaultKind::Kill) {
        return Ok(Vec::new());
    }
    let drones = scenario.drones_without_a_way().map_err(RuntimeError::Shape)?;
    Ok(drones.into_iter().map(DroneId).collect())
}

/// Where the mission ends, in the frame of its course.
#[must_use]
pub fn destination(scenario: &Scenario) -> Destination {
    match (scenario.mission.end, scenario.mission.goal_m) {
        (End::Goal, Some(goal)) => Destination::Goal { front_m: scenario.course().from_world(goal.into()) },
        _ => Destination::Hold { stop_x_m: scenario.mission.stop_x_m },
    }
}

/// The parameters of one pilot, in the frame of the mission's course. `incarnation` counts the processes of the drone, from 1; `start` is the time of its first tick.
#[must_use]
pub fn pilot_params(scenario: &Scenario, me: DroneId, incarnation: u32, start: SimTime) -> PilotParams {
    let (drone, protocol) = (&scenario.drone, &scenario.protocol);
    let mut params = PilotParams {
        me,
        drones: scenario.formation.drones,
        incarnation,
        start,
        dt_s: scenario.time.dt_s,
        tick_s: scenario.time.dt_s,
        guidance: GuidanceParams {
            speed_mps: drone.speed_mps,
            speed_change_mps: drone.speed_change_mps,
            reform_speed_max_mps: scenario.reform_speed_max_mps(),
            braking_mps2: scenario.braking_mps2(),
        },
        safety: SafetyParams {
            safe_distance_m: drone.safe_distance_m,
            clearance_m: scenario.avoidance.clearance_m,
            acceleration_max_mps2: drone.acceleration_max_mps2,
            braking_mps2: scenario.braking_mps2(),
            gain_per_s: scenario.guidance.filter_gain_per_s,
            margin: scenario.guidance.filter_margin,
            reaction_time_s: drone.reaction_time_s,
            dt_s: scenario.time.dt_s,
            scale: scale(scenario),
        },
        altitude_m: scenario.altitude_m(),
        detection_range_m: scenario.sensors.detection_range_m,
        speed_max_mps: drone.speed_max_mps,
        ranging_m: scenario.ranging_m(),
        apart_by_words: scenario.apart_by_words(),
        sensing: SensingErrors {
            position_m: scenario.position_error_max_m(),
            obstacle_m: scenario.sensors.obstacle_error_max_m,
            clock_s: scenario.clock_error_max_s(),
            partial_outlines: scenario.sensors.outline == OutlineSensing::Seen,
        },
        starts_m: if scenario.apart_by_words() { starts_on_course(scenario) } else { [].into() },
        braking: Braking { deceleration_mps2: scenario.braking_mps2(), reaction_time_s: drone.reaction_time_s },
        planner: planner(scenario),
        election: ElectionParams {
            heartbeat_period_s: protocol.heartbeat_period_s,
            leader_timeout_s: protocol.leader_timeout_s,
            wait_s: protocol.election_wait_s,
        },
        velocity_gain_per_s: scenario.guidance.velocity_gain_per_s,
        precedence_share: scenario.guidance.precedence_share,
        queue: scenario.guidance.queue,
        beacon_period_s: scenario.beacon_period_s(),
        beacon_period_max_s: scenario.beacon_period_max_s(),
        separation_period_s: scenario.separation_period_s(skein_agent::separation::messages(drones(scenario))),
        repeat_period_s: protocol.repeat_period_s,
        channel: ChannelParams {
            bandwidth_bytes_per_s: scenario.bandwidth_bytes_per_s(),
            carrier_sense_m: scenario.carrier_sense_m(),
            drones: scenario.channel_drones(),
        },
        peer_timeout_s: protocol.peer_timeout_s,
    };
    params.planner.speed_on_sight_mps = params.speed_on_sight_mps(reaction_ticks(scenario));
    params
}

/// The start position of each drone in the frame of the mission's course, m.
fn starts_on_course(scenario: &Scenario) -> Arc<[Vec2]> {
    scenario.starts().into_iter().map(|start| scenario.course().from_world(start)).collect()
}

/// Delay from a command to its effect, in ticks.
pub(crate) fn reaction_ticks(scenario: &Scenario) -> u32 {
    (scenario.drone.reaction_time_s / scenario.time.dt_s).round() as u32
}

fn planner(scenario: &Scenario) -> PlannerParams {
    let (drone, avoidance) = (&scenario.drone, &scenario.avoidance);
    PlannerParams {
        drones: scenario.formation.drones,
        strategy: match scenario.strategy {
            StrategyKey::LookAhead => Strategy::LookAhead(Objective {
                energy_per_kj: scenario.objective.energy_per_kj,
                time_per_s: scenario.objective.time_per_s,
            }),
            StrategyKey::PaperRule => Strategy::PaperRule,
            StrategyKey::ShortestPath => Strategy::ShortestPath,
            StrategyKey::Fixed { left, right } => Strategy::Fixed { left: left as usize, right: right as usize },
        },
        speed_mps: drone.speed_mps,
        headway_s: avoidance.headway_factor * drone.safe_distance_m / drone.speed_mps,
        by_words: scenario.apart_by_words(),
        // Follows from the other parameters of the pilot.
        speed_on_sight_mps: f64::INFINITY,
        routes: RouteParams {
            clearance_m: avoidance.clearance_m + scenario.sensors.obstacle_error_max_m,
            half_gap_m: scenario.half_gap_m(),
            planning_distance_m: (avoidance.planning_distance_m + scenario.sensors.obstacle_error_max_m)
                .max(scenario.half_gap_m()),
            scale: scale(scenario),
        },
        shape: scenario.formation_shape(),
        spacing_m: scenario.formation.spacing_m,
        reformation: match scenario.mission.reformation {
            ReformationKey::Optimal => Reformation::Optimal,
            ReformationKey::Tps => Reformation::Tps { lambda_m2: scenario.mission.tps_lambda },
            ReformationKey::Greedy => Reformation::Greedy,
            ReformationKey::Identity => Reformation::Identity,
        },
        arrival_error_m: scenario.mission.arrival_error_m,
        safe_distance_m: drone.safe_distance_m,
        course_y_m: scenario.course().from_world(scenario.formation.start_m.into()).y,
        destination: destination(scenario),
        between: match scenario.mission.between {
            BetweenKey::CloseUp => Between::CloseUp,
            BetweenKey::GoOn => Between::GoOn,
        },
        radio_range_m: scenario.radio().beacon_range_m(),
        debounce_s: scenario.protocol.debounce_s,
    }
}
