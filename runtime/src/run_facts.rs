//! From a scenario to the facts of a run that its report needs and its record does not carry.

use crate::mission;
use skein_leader::obstacles::Obstacles;
use skein_leader::routes::{Route, Routes, Side};
use skein_protocol::shape::ShapeError;
use skein_protocol::{DroneId, ObstacleId, SimTime};
use skein_report::scene::{SceneFacts, SetOutline};
use skein_report::{MissionEnd, PilotEntry, RunFacts};
use skein_scenario::{DEFAULT_PILOT, End, FreeTable, PilotKeys, Scenario};

/// An obstacle set, and the routes past it that a leader finds which knows all obstacles of the scenario.
#[derive(Clone, Debug)]
pub struct SetPlan {
    /// The obstacles of the set.
    pub obstacles: Vec<ObstacleId>,
    /// The routes past the set, from right to left.
    pub routes: Routes,
}

/// The sets of the obstacles that are in the way at the formation's altitude, in flight order, with their routes in the frame of the
/// mission's course.
///
/// # Errors
/// [`ShapeError`] if an obstacle of the scenario is not a convex shape; never for a scenario that was checked.
pub fn obstacle_sets(scenario: &Scenario) -> Result<Vec<SetPlan>, ShapeError> {
    let shapes = scenario.shapes_in_the_way()?;
    let planner = mission::pilot_params(scenario, DroneId(0), 1, SimTime::ZERO).planner;
    let reach_m = 2.0 * planner.routes.planning_distance_m;
    let mut obstacles = Obstacles::new(scenario.formation.drones, reach_m);
    for (id, shape) in shapes {
        obstacles.learn(SimTime::ZERO, ObstacleId(id), shape.to_world(scenario.course().inverse()), DroneId(0));
    }
    let plan = |ids: Vec<ObstacleId>| {
        let routes = Routes::new(&obstacles.shapes(&ids).unwrap_or_default(), &planner.routes);
        SetPlan { obstacles: ids, routes }
    };
    Ok(obstacles.sets().iter().cloned().map(plan).collect())
}

/// The facts of a run of this scenario. `runtime` is `processes` or `inline`, `clock` is `lockstep`, `realtime` or
/// `realtime:SPEED`: both go into the summary as they are.
///
/// # Errors
/// [`ShapeError`] if an obstacle of the scenario is not a convex shape; never for a scenario that was checked.
pub fn run_facts(scenario: &Scenario, runtime: &str, clock: &str) -> Result<RunFacts, ShapeError> {
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
            (End::Goal | End::Hold, _) => MissionEnd::Hold,
            (End::Time, _) => MissionEnd::Time,
            (End::Pilots, _) => MissionEnd::Pilots,
        },
        course: scenario.course(),
        course_y_m: scenario.course().from_world(scenario.formation.start_m.into()).y,
        safe_distance_m: scenario.drone.safe_distance_m,
        clearance_m: scenario.avoidance.clearance_m,
        planning_distance_m: scenario.avoidance.planning_distance_m,
        arrival_error_m: scenario.mission.arrival_error_m,
        radio_range_m: scenario.radio.range_m,
        obstacles: scenario.shapes()?,
        pilots: pilot_groups(scenario).into_iter().map(|(_, entry)| entry).collect(),
        topics: Vec::new(),
        scene: scene(scenario)?,
    })
}

/// The scenario's pilots, each with its table, if it has one, and without the hash of its program.
pub(crate) fn pilot_groups(scenario: &Scenario) -> Vec<(Option<&PilotKeys>, PilotEntry)> {
    let tables = scenario.pilot_tables();
    let flown_by = |table: Option<usize>| {
        let drones = tables.iter().zip(0..).filter(|(of, _)| **of == table).map(|(_, drone)| drone);
        drones.collect::<Vec<u32>>()
    };
    let group = |table: Option<usize>| {
        let keys = table.and_then(|number| scenario.pilots.get(number));
        let (name, params) = keys.map_or((DEFAULT_PILOT, FreeTable::new()), |k| (k.shown_name(), k.params.clone()));
        (keys, PilotEntry { name: name.to_owned(), drones: flown_by(table), program: None, params })
    };
    let mut groups: Vec<_> = (0..scenario.pilots.len()).map(|number| group(Some(number))).collect();
    groups.extend(tables.contains(&None).then(|| group(None)));
    groups
}

/// What the recording and the page draw beside the drones.
fn scene(scenario: &Scenario) -> Result<SceneFacts, ShapeError> {
    let pilot = mission::pilot_params(scenario, DroneId(0), 1, SimTime::ZERO);
    let to_world = |line: Vec<[f64; 2]>| -> Vec<[f64; 2]> {
        line.into_iter().map(|point| scenario.course().to_world(point.into()).into()).collect()
    };
    let sets = obstacle_sets(scenario)?.into_iter().map(|set| SetOutline {
        obstacles: set.obstacles.iter().map(|id| id.0).collect(),
        gate_x_m: set.routes.gate_x_m(),
        hulls_m: hulls(&set.routes).into_iter().map(to_world).collect(),
        routes_m: (0..set.routes.count()).map(|route| to_world(centre_line(set.routes.route(route)))).collect(),
        envelopes: set.routes.envelopes().iter().map(|ids| ids.iter().map(|id| id.0).collect()).collect(),
    });
    Ok(SceneFacts {
        altitude_m: scenario.altitude_m(),
        radio: scenario.radio(),
        detection_range_m: scenario.sensors.detection_range_m,
        // The pilot's own danger zone: the clearance and twice the stopping distance.
        danger_m: [
            scenario.avoidance.clearance_m,
            2.0 * pilot.braking.reaction_m(1.0),
            2.0 * pilot.braking.braking_m(1.0),
        ],
        sets: sets.collect(),
    })
}

/// The outlines of the inflated obstacles, each once. Every route lists the obstacles beside it, so that the same one
/// occurs in several routes.
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

/// The polyline that stands for a route in a picture, m. Around all obstacles it is the taut line over their corners;
/// between two obstacles it is the middle of the gap.
fn centre_line(route: &Route) -> Vec<[f64; 2]> {
    let corners = route.constraints();
    let side = |side| corners.iter().filter(move |corner| corner.side == side).map(|corner| [corner.x_m, corner.y_m]);
    let (above, below): (Vec<_>, Vec<_>) = (side(Side::Above).collect(), side(Side::Below).collect());
    if above.is_empty() || below.is_empty() {
        let outward = if below.is_empty() { 1.0 } else { -1.0 };
        return convex_chain(corners.iter().map(|corner| [corner.x_m, corner.y_m]), outward);
    }
    let middle_m = (above.iter().map(|corner| corner[1]).fold(f64::NEG_INFINITY, f64::max)
        + below.iter().map(|corner| corner[1]).fold(f64::INFINITY, f64::min))
        / 2.0;
    [corners.first(), corners.last()].into_iter().flatten().map(|corner| [corner.x_m, middle_m]).collect()
}

/// The upper convex chain (`outward` = 1) or the lower one (`outward` = −1) of points that are sorted by x.
fn convex_chain(points: impl Iterator<Item = [f64; 2]>, outward: f64) -> Vec<[f64; 2]> {
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
    fn a_convex_chain_passes_outside_of_every_corner() {
        let corners = [[0.0, 0.0], [1.0, 3.0], [2.0, 1.0], [3.0, 4.0], [4.0, 0.0]];
        assert_eq!(convex_chain(corners.into_iter(), 1.0), [[0.0, 0.0], [1.0, 3.0], [3.0, 4.0], [4.0, 0.0]]);
        assert_eq!(convex_chain(corners.into_iter(), -1.0), [[0.0, 0.0], [4.0, 0.0]]);
    }
}
