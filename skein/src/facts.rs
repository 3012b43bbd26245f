//! From a scenario to what the report needs to know of it.

use crate::exit::Failure;
use crate::outlook;
use skein_leader::routes::{Route, Routes, Side};
use skein_protocol::{DroneId, SimTime};
use skein_report::scene::{SceneFacts, SetOutline};
use skein_report::{MissionEnd, RunFacts};
use skein_runtime::mission;
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
        scene: scene(scenario)?,
    })
}

/// What a picture shows beside the drones.
fn scene(scenario: &Scenario) -> Result<SceneFacts, Failure> {
    let pilot = mission::pilot_params(scenario, DroneId(0), 1, SimTime::ZERO);
    let sets = outlook::sets(scenario)?.into_iter().map(|set| SetOutline {
        obstacles: set.obstacles.iter().map(|id| id.0).collect(),
        gate_x_m: set.routes.gate_x_m(),
        hulls_m: hulls(&set.routes),
        routes_m: (0..set.routes.count()).map(|route| way(set.routes.route(route))).collect(),
    });
    Ok(SceneFacts {
        radio: scenario.radio(),
        detection_range_m: scenario.sensors.detection_range_m,
        // Twice the stopping distance, and the clearance: what the pilot's own rule comes to.
        danger_m: [
            scenario.avoidance.clearance_m,
            2.0 * pilot.braking.reaction_m(1.0),
            2.0 * pilot.braking.braking_m(1.0),
        ],
        sets: sets.collect(),
    })
}

/// Inflated obstacles, each once: the rightmost route has all of them on its left, the others one more to the right each.
fn hulls(routes: &Routes) -> Vec<Vec<[f64; 2]>> {
    let mut hulls: Vec<Vec<[f64; 2]>> = Vec::new();
    for wall in (0..routes.count()).flat_map(|route| routes.route(route).walls()) {
        let hull: Vec<[f64; 2]> = wall.outline.iter().map(|&corner| corner.into()).collect();
        if !hulls.contains(&hull) {
            hulls.push(hull);
        }
    }
    hulls
}

/// The corners that a route passes: of a way around everything, the taut ones; of a way between two obstacles, the middle.
fn way(route: &Route) -> Vec<[f64; 2]> {
    let corners = route.constraints();
    let side = |side| corners.iter().filter(move |corner| corner.side == side).map(|corner| [corner.x_m, corner.y_m]);
    let (above, below): (Vec<_>, Vec<_>) = (side(Side::Above).collect(), side(Side::Below).collect());
    if above.is_empty() || below.is_empty() {
        let outward = if below.is_empty() { 1.0 } else { -1.0 };
        return taut(corners.iter().map(|corner| [corner.x_m, corner.y_m]), outward);
    }
    let middle_m = (above.iter().map(|corner| corner[1]).fold(f64::NEG_INFINITY, f64::max)
        + below.iter().map(|corner| corner[1]).fold(f64::INFINITY, f64::min))
        / 2.0;
    [corners.first(), corners.last()].into_iter().flatten().map(|corner| [corner.x_m, middle_m]).collect()
}

/// The upper convex chain of points that come by x, with `outward` = 1; with −1 the lower one.
fn taut(points: impl Iterator<Item = [f64; 2]>, outward: f64) -> Vec<[f64; 2]> {
    let mut chain: Vec<[f64; 2]> = Vec::new();
    for point in points {
        while let [.., a, b] = chain[..] {
            let turn = (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]);
            if turn * outward < 0.0 {
                break;
            }
            chain.pop();
        }
        chain.push(point);
    }
    chain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_taut_way_passes_outside_of_every_corner() {
        let corners = [[0.0, 0.0], [1.0, 3.0], [2.0, 1.0], [3.0, 4.0], [4.0, 0.0]];
        assert_eq!(taut(corners.into_iter(), 1.0), [[0.0, 0.0], [1.0, 3.0], [3.0, 4.0], [4.0, 0.0]]);
        assert_eq!(taut(corners.into_iter(), -1.0), [[0.0, 0.0], [4.0, 0.0]]);
    }
}
