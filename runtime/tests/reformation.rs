//! The formation closes with each method that assigns the slots.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use skein_protocol::record::Outcome;
use support::{fly_to_the_end, scenario};

/// Flies S2 with one method. The mission must end in formation with all distances kept. Returns the digest.
fn digest(method: &str, lambda: &str) -> u64 {
    let scenario = scenario("paper/s2-right", &[("mission.reformation", method), ("mission.tps_lambda", lambda)]);
    let world = fly_to_the_end(&scenario, None);
    let (separation_m, clearance_m) = (world.min_separation_m(), world.min_clearance_m());
    assert_eq!(world.ended(), Some(Outcome::Reached), "{method}");
    assert!(separation_m >= scenario.drone.safe_distance_m, "{method}: {separation_m} m");
    assert!(clearance_m >= scenario.avoidance.clearance_m, "{method}: {clearance_m} m");
    world.digest()
}

#[test]
fn s2_is_flown_to_the_end_with_each_method() {
    let optimal = digest("optimal", "0");
    assert_eq!(digest("tps", "0"), optimal, "with λ = 0 the spline gives the optimum");
    assert_ne!(digest("tps", "1000"), optimal, "λ has no effect");
    assert_ne!(digest("greedy", "0"), optimal, "the method has no effect");
    // No drone overtakes another in this flight: the order of the numbers is the optimum.
    assert_eq!(digest("identity", "0"), optimal);
}
