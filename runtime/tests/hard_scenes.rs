//! Scenes that went wrong once: each has to be reached, with every distance kept.
#![allow(clippy::unwrap_used)]

mod support;

use skein_protocol::record::Outcome;
use support::{fly_to_the_end, scenario};

fn assert_reached(name: &str, strategy: &str) {
    let scenario = scenario(&format!("hard/{name}"), &[("strategy", &format!("\"{strategy}\""))]);
    let world = fly_to_the_end(&scenario, None);
    assert_eq!(world.ended(), Some(Outcome::Reached), "{name}");
    let (separation_m, clearance_m) = (world.min_separation_m(), world.min_clearance_m());
    assert!(separation_m >= scenario.drone.safe_distance_m, "{name}: {separation_m} m between drones");
    assert!(clearance_m >= scenario.avoidance.clearance_m, "{name}: {clearance_m} m to an obstacle");
}

const SWARMS: [&str; 7] =
    ["defaults", "column", "reform-blind", "gap-crush", "in-sight-at-start", "obstacle-hit", "plan-storm"];

#[test]
fn a_single_drone_finds_its_path() {
    for name in ["beyond-goal", "gap-hardly-open", "dead-end"] {
        assert_reached(name, "congestion-aware");
    }
}

#[test]
fn the_default_strategy_reaches_every_hard_scene() {
    for name in SWARMS {
        assert_reached(name, "congestion-aware");
    }
}

#[test]
fn the_papers_rule_reaches_every_hard_scene() {
    for name in SWARMS {
        assert_reached(name, "congestion-aware-paper");
    }
}
