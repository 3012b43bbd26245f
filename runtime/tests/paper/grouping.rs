//! Grouping: A3, C1. A test in `leader` compares the split with all possible assignments.

use super::flown::{Flown, fly, fly_file, scenario};
use skein_protocol::record::EventKind;
use std::collections::BTreeMap;

/// The time that the leader predicts for a strategy, s. Eight seconds of flight are enough for that.
fn forecast_s(name: &str, strategy: &str) -> f64 {
    fly(&scenario(name, &[("strategy", strategy), ("time.timeout_s", "8")])).grouping().0
}

#[test]
fn a3_the_rule_takes_the_split_with_the_least_predicted_time() {
    for name in ["paper/s2-centred", "paper/s2-left", "paper/s2-right"] {
        let fixed: Vec<f64> = (0..=8).map(|left| forecast_s(name, &format!("fixed:{left}/{}", 8 - left))).collect();
        let least_s = fixed.iter().copied().fold(f64::INFINITY, f64::min);
        assert_eq!(forecast_s(name, "congestion-aware-paper"), least_s, "{name}: {fixed:?}");
        assert!(least_s < forecast_s(name, "shortest-path"), "{name}");
    }
}

/// The members and the leader of each group of the first plan to avoid an obstacle set.
fn groups(flown: &Flown) -> BTreeMap<String, (Vec<usize>, usize)> {
    let mut groups: BTreeMap<String, (Vec<usize>, usize)> = BTreeMap::new();
    let decided_s = flown.grouping().1;
    for event in flown.events.iter().filter(|event| (decided_s..decided_s + 0.5).contains(&event.t_s)) {
        if let EventKind::Assigned { drone, group, leader, route: Some(_), .. } = &event.what {
            let group = groups.entry(group.clone()).or_insert_with(|| (Vec::new(), leader.index()));
            group.0.push(drone.index());
            assert_eq!(group.1, leader.index(), "one leader per group");
        }
    }
    groups
}

#[test]
fn a3_each_group_is_led_by_its_member_closest_to_the_destination() {
    for name in ["paper/s1-right", "paper/s2-centred", "paper/forest"] {
        let flown = fly_file(name, &[]);
        let groups = groups(&flown);
        assert_eq!(groups.len(), 2, "{name}");
        assert_eq!(groups.values().map(|group| group.0.len()).sum::<usize>(), 8, "{name}");
        let rows = flown.at(flown.grouping().1);
        for (group, (members, leader)) in groups {
            let farthest = members.iter().map(|&drone| rows[drone].position_m[0]).fold(f64::NEG_INFINITY, f64::max);
            // Leaders know positions that are up to one beacon period old.
            assert!(rows[leader].position_m[0] > farthest - 1.5, "{name}: {group} is led by {leader} of {members:?}");
        }
    }
}

#[test]
fn c1_the_cost_is_the_time_from_detection_until_the_last_drone_has_passed_the_centre() {
    let flown = fly_file("paper/s2-right", &[]);
    let last_s = flown.crossings(144.0).last().unwrap().0;
    assert!((flown.passed_s(0) - last_s).abs() < 0.021);
    let (time_s, predicted_s) = (flown.passed_s(0) - flown.detected_s(0), flown.grouping().0);
    assert!((predicted_s..predicted_s + 1.5).contains(&time_s), "{time_s} s flown, {predicted_s} s predicted");
}
