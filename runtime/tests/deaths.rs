//! Any drone may die at any time: the others keep their distances and reach the goal.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::DroneId;
use skein_protocol::record::Outcome;
use support::{fly_to_the_end, scenario};

/// Kills each drone in turn, at moments from before the first plan to the closed formation.
fn the_others_reach_the_goal(name: &str) {
    let scenario = scenario(name, &[]);
    let mut failed = Vec::new();
    for drone in 0..scenario.formation.drones {
        for at in (40..2600).step_by(100) {
            let world = fly_to_the_end(&scenario, Some((DroneId(drone), at)));
            let separation_m = world.min_separation_m();
            if world.ended() != Some(Outcome::Reached) || separation_m < scenario.drone.safe_distance_m {
                let (end, clearance_m) = (world.ended(), world.min_clearance_m());
                failed.push(format!("drone {drone} dead at tick {at}: {end:?}, {separation_m} m, {clearance_m} m"));
            }
        }
    }
    assert!(failed.is_empty(), "{name}, {} failed:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn any_drone_may_die_at_any_time_in_s2() {
    the_others_reach_the_goal("paper/s2-right");
}

#[test]
fn any_drone_may_die_at_any_time_in_the_tight_formation_of_s1() {
    the_others_reach_the_goal("paper/s1-right");
}
