//! `skein check`: validates a scenario and prints the plan; starts nothing.

use crate::cli::CheckArgs;
use crate::exit::{Exit, Failure};
use crate::input;
use serde_json::json;
use skein_leader::obstacles::Obstacles;
use skein_leader::routes::Routes;
use skein_protocol::{DroneId, ObstacleId, SimTime};
use skein_runtime::mission;
use skein_scenario::Scenario;
use std::io::Write;

/// One obstacle set as a leader that knows all would see it.
struct SetPlan {
    obstacles: Vec<ObstacleId>,
    routes: usize,
    gate_x_m: f64,
}

/// Prints processes, services and routes.
pub fn check(args: &CheckArgs) -> Result<Exit, Failure> {
    let scenario = input::scenario(&args.scenario)?;
    let sets = sets(&scenario)?;
    let drones = mission::drones(&scenario);
    let shards = skein_bus::shards(drones);
    let mut out = std::io::stdout().lock();
    // A closed pipe is the reader's choice.
    let _ = if args.json {
        let sets: Vec<_> = sets
            .iter()
            .map(|set| json!({ "obstacles": set.obstacles, "routes": set.routes, "gate_x_m": set.gate_x_m }))
            .collect();
        let services = services(shards);
        let plan = json!({
            "scenario": scenario.name, "strategy": scenario.strategy.to_string(), "seed": scenario.seed,
            "drones": drones, "processes": drones + 2, "services": services, "sets": sets,
        });
        writeln!(out, "{plan}")
    } else {
        let mut text = format!("{}: valid, {} with seed {}\n", scenario.name, scenario.strategy, scenario.seed);
        text += &format!("processes  launcher, world, {drones} drones\n");
        text += &format!("services   {}\n", services(shards).join(", "));
        text += &format!("ticks      {} s each, {} s at most\n", scenario.time.dt_s, scenario.time.timeout_s);
        for (number, set) in sets.iter().enumerate() {
            let ids: Vec<String> = set.obstacles.iter().map(|id| id.0.to_string()).collect();
            let ids = ids.join(", ");
            text +=
                &format!("set {number}      obstacles {ids}: {} routes, gate at x = {} m\n", set.routes, set.gate_x_m);
        }
        write!(out, "{text}")
    };
    Ok(Exit::Reached)
}

fn services(shards: usize) -> Vec<String> {
    let uplinks = (0..shards).map(|shard| format!("skein/uplink/{shard}"));
    std::iter::once("skein/downlink".to_owned()).chain(uplinks).chain(["skein/record".to_owned()]).collect()
}

fn sets(scenario: &Scenario) -> Result<Vec<SetPlan>, Failure> {
    let shapes = scenario.shapes().map_err(Failure::usage)?;
    let planner = mission::pilot_params(scenario, DroneId(0), 1, SimTime::ZERO).planner;
    let reach_m = 2.0 * planner.routes.planning_distance_m;
    let mut obstacles = Obstacles::new(scenario.formation.drones, reach_m);
    for (shape, id) in shapes.iter().zip(0..) {
        obstacles.learn(SimTime::ZERO, ObstacleId(id), *shape, DroneId(0));
    }
    let plan = |ids: Vec<ObstacleId>| {
        let routes = Routes::new(&obstacles.shapes(&ids).unwrap_or_default(), &planner.routes);
        SetPlan { obstacles: ids, routes: routes.count(), gate_x_m: routes.gate_x_m() }
    };
    Ok(obstacles.sets().iter().cloned().map(plan).collect())
}
