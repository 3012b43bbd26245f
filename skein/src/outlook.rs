//! A mission as a leader that knows all of it would see it.

use crate::exit::Failure;
use skein_leader::obstacles::Obstacles;
use skein_leader::routes::Routes;
use skein_protocol::{DroneId, ObstacleId, SimTime};
use skein_runtime::mission;
use skein_scenario::Scenario;

/// One obstacle set.
pub struct SetPlan {
    /// Its obstacles.
    pub obstacles: Vec<ObstacleId>,
    /// The ways past it.
    pub routes: Routes,
}

/// The obstacle sets of a scenario, in flight order.
pub fn sets(scenario: &Scenario) -> Result<Vec<SetPlan>, Failure> {
    let shapes = scenario.shapes().map_err(Failure::usage)?;
    let planner = mission::pilot_params(scenario, DroneId(0), 1, SimTime::ZERO).planner;
    let reach_m = 2.0 * planner.routes.planning_distance_m;
    let mut obstacles = Obstacles::new(scenario.formation.drones, reach_m);
    for (shape, id) in shapes.iter().zip(0..) {
        obstacles.learn(SimTime::ZERO, ObstacleId(id), *shape, DroneId(0));
    }
    let plan = |ids: Vec<ObstacleId>| {
        let routes = Routes::new(&obstacles.shapes(&ids).unwrap_or_default(), &planner.routes);
        SetPlan { obstacles: ids, routes }
    };
    Ok(obstacles.sets().iter().cloned().map(plan).collect())
}
