//! Queues on shared routes, and subgroups: Q1, G1.

use super::flown::{Flown, fly, fly_file, position, scenario};
use std::collections::BTreeMap;

/// By route: when each drone passes the gate, s, and its place in the queue; in order of time.
fn passes(flown: &Flown, gate_x_m: f64) -> BTreeMap<u16, Vec<(f64, u16)>> {
    let mut passes: BTreeMap<u16, Vec<(f64, u16)>> = BTreeMap::new();
    for (t_s, _, row) in flown.crossings(gate_x_m) {
        passes.entry(row.route).or_default().push((t_s, row.rank));
    }
    passes
}

/// Least time between two consecutive drones on the same route, s.
fn least_gap_s(passes: &BTreeMap<u16, Vec<(f64, u16)>>) -> f64 {
    let gaps = passes.values().flat_map(|queue| queue.windows(2).map(|two| two[1].0 - two[0].0));
    gaps.fold(f64::INFINITY, f64::min)
}

#[test]
fn q1_drones_pass_in_the_order_of_their_queue_and_keep_the_safe_distance() {
    let flown = fly_file("paper/s2-right", &[]);
    let passes = passes(&flown, 144.0);
    assert_eq!(passes.values().map(Vec::len).collect::<Vec<_>>(), [2, 6]);
    for queue in passes.values() {
        assert!(queue.is_sorted_by_key(|(_, rank)| *rank), "{queue:?}");
    }
    // 37 m at 10 m/s take 3.7 s. Drones behind slow down to keep that.
    assert!(least_gap_s(&passes) >= 3.7, "{passes:?}");
    let slowest = flown.ticks.iter().flat_map(|(_, rows)| rows.iter().map(|row| row.velocity_mps[0]));
    assert!(slowest.fold(f64::INFINITY, f64::min) < 8.0);
}

#[test]
fn q1_without_the_queue_law_drones_pass_side_by_side() {
    let with = fly_file("paper/s2-right", &[]);
    let without = fly_file("paper/s2-right", &[("guidance.queue", "false")]);
    let [queued, free] = [&with, &without].map(|flown| least_gap_s(&passes(flown, 144.0)));
    assert!(free < queued / 2.0, "{queued} s apart with it, {free} s without");
    // Only the safety filter keeps them apart.
    assert!(without.separation_m() >= 37.0, "{} m", without.separation_m());
}

/// A grid of 150 drones, half of them on each side of a tree. One behind another they took 64 s.
#[test]
fn q1_many_drones_pass_side_by_side_as_forecast() {
    let sets = [
        ("strategy", "congestion-aware-paper"),
        ("formation.shape", "grid"),
        ("formation.drones", "150"),
        ("time.timeout_s", "50"),
    ];
    let flown = fly(&scenario("open-field", &sets));
    let (passed_s, forecast_s) = (flown.passed_s(0) - flown.detected_s(0), flown.grouping().0);
    assert!(passed_s < 45.0, "{passed_s} s");
    assert!((0.9 * passed_s..1.1 * passed_s).contains(&forecast_s), "{forecast_s} s forecast, {passed_s} s flown");
    assert!(flown.separation_m() >= 4.0, "{} m", flown.separation_m());
}

#[test]
fn g1_groups_split_again_and_two_groups_of_different_parents_share_the_gap_in_one_queue() {
    for between in ["go-on", "close-up"] {
        let flown = fly_file("paper/forest", &[("mission.between", between)]);
        split_again(&flown);
    }
}

/// At 70 s there are four groups, and two of them, of different parents, pass the gap in one queue.
fn split_again(flown: &Flown) {
    let mut members: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (drone, row) in flown.at(70.0).iter().enumerate() {
        members.entry(row.group.to_string()).or_default().push(drone);
    }
    assert_eq!(members.keys().collect::<Vec<_>>(), ["N11", "N12", "N21", "N22"]);
    let crossings = flown.crossings(640.0);
    let gap: Vec<_> = crossings.iter().filter(|(_, _, row)| position(row).y.abs() < 30.0).collect();
    let mut groups: Vec<String> = gap.iter().map(|(_, _, row)| row.group.to_string()).collect();
    groups.sort();
    groups.dedup();
    assert_eq!(groups, ["N12", "N21"]);
    // There is one queue: each drone has a place of its own, and they pass in this order.
    assert_eq!(gap.iter().map(|(_, _, row)| row.rank).collect::<Vec<_>>(), (0..gap.len() as u16).collect::<Vec<_>>());
    assert!(gap.windows(2).all(|two| two[1].0 - two[0].0 >= 2.5), "25 m at 10 m/s");
}
