//! From a scenario to what the report needs to know of it.

use crate::exit::Failure;
use skein_report::{MissionEnd, RunFacts};
use skein_scenario::{End, Failsafe, Scenario};
use skein_world::params::landing_s;

/// What the record of this run does not tell.
pub fn facts(scenario: &Scenario, runtime: &str, clock: &str) -> Result<RunFacts, Failure> {
    Ok(RunFacts {
        scenario: scenario.name.clone(),
        strategy: scenario.strategy.to_string(),
        seed: scenario.seed,
        runtime: runtime.to_owned(),
        clock: clock.to_owned(),
        drones: scenario.formation.drones,
        dt_s: scenario.time.dt_s,
        shape: scenario.formation_shape(),
        spacing_m: scenario.formation.spacing_m,
        end: match (scenario.mission.end, scenario.mission.goal_m) {
            (End::Goal, Some(front_m)) => MissionEnd::Goal { front_m },
            _ => MissionEnd::Hold,
        },
        course_y_m: scenario.formation.start_m[1],
        safe_distance_m: scenario.drone.safe_distance_m,
        clearance_m: scenario.avoidance.clearance_m,
        planning_distance_m: scenario.avoidance.planning_distance_m,
        arrival_error_m: scenario.mission.arrival_error_m,
        radio_range_m: scenario.radio.range_m,
        landing_s: (scenario.faults.failsafe == Failsafe::Land).then(landing_s),
        obstacles: scenario.shapes().map_err(Failure::usage)?,
    })
}
