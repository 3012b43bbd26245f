//! `skein check`: validates a scenario and prints the plan, without starting anything.

use crate::cli::CheckArgs;
use crate::exit::{Exit, Failure};
use crate::input;
use crate::output::{print, print_line};
use serde_json::json;
use skein_protocol::{Course, Vec2};
use skein_runtime::{PilotRegistry, advice, mission, run_facts};

/// Prints the processes, services and routes of a mission.
pub(crate) fn check(args: &CheckArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    let scenario = input::scenario(&args.scenario, pilots, false)?;
    let sets = run_facts::obstacle_sets(&scenario).map_err(Failure::usage)?;
    let drones = mission::drones(&scenario);
    let shards = skein_bus::shards(drones);
    let on_sight_mps = advice::speed_on_sight_mps(&scenario);
    let kept = advice::kept_distances(&scenario);
    let warnings = advice::warnings(&scenario).map_err(Failure::usage)?;
    if args.json {
        let sets: Vec<_> = sets
            .iter()
            .map(|set| json!({ "obstacles": set.obstacles, "routes": set.routes.count(), "gate_x_m": set.routes.gate_x_m() }))
            .collect();
        let services = services(shards);
        let plan = json!({
            "scenario": scenario.name, "strategy": scenario.strategy.to_string(), "seed": scenario.seed,
            "course": scenario.course(), "drones": drones, "processes": drones + 2, "services": services, "sets": sets,
            "speed_on_sight_mps": on_sight_mps, "separation_kept_m": kept.separation_m,
            "clearance_kept_m": kept.clearance_m, "warnings": warnings,
        });
        print_line(plan)?;
    } else {
        let mut text = format!("{}: valid, {} with seed {}\n", scenario.name, scenario.strategy, scenario.seed);
        text += &format!("processes  launcher, world, {drones} drones\n");
        text += &format!("services   {}\n", services(shards).join(", "));
        text += &format!("ticks      {} s each, for {} s at most\n", scenario.time.dt_s, scenario.timeout_s());
        for (number, set) in sets.iter().enumerate() {
            let ids: Vec<String> = set.obstacles.iter().map(|id| id.0.to_string()).collect();
            let ids = ids.join(", ");
            let (routes, gate) = (set.routes.count(), gate(scenario.course(), set.routes.gate_x_m()));
            text += &format!("set {number}      obstacles {ids}: {routes} routes, gate at {gate}\n");
        }
        text += &format!("on sight   {on_sight_mps:.2} m/s at most: drones can stop within what they sense\n");
        text += &format!(
            "distances  {:.2} m between drones{}, {:.2} m to obstacles: what drones keep, with all margins\n",
            kept.separation_m,
            if kept.by_words { " by words" } else { "" },
            kept.clearance_m
        );
        for warning in &warnings {
            text += &format!("warning    {warning}\n");
        }
        print(text)?;
    }
    Ok(Exit::Reached)
}

/// Where a gate is that is this far along the course, m, for example `x = 320 m`.
fn gate(course: Course, along_m: f64) -> String {
    let place = course.to_world(Vec2::new(along_m, 0.0));
    let (axis, at_m) = if matches!(course, Course::East | Course::West) { ("x", place.x) } else { ("y", place.y) };
    format!("{axis} = {} m", (at_m * 1e3).round() / 1e3)
}

fn services(shards: usize) -> Vec<String> {
    let uplinks = (0..shards).map(|shard| format!("skein/uplink/{shard}"));
    std::iter::once("skein/downlink".to_owned())
        .chain(uplinks)
        .chain(["skein/record".to_owned(), "skein/watch".to_owned()])
        .collect()
}
