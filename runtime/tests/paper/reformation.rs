//! Reformation: A5, E6.

use super::flown::{Flown, fly_file, position, scenario};
use skein_leader::slots::assign;
use skein_protocol::Vec2;
use skein_protocol::thin_plate::{bending_energy, centred};

/// Greatest distance of a drone to its slot after the best translation and assignment, m, and the bending energy of the
/// spline that maps the slots to the drones.
fn disturbance(flown: &Flown, slots: &[Vec2], t_s: f64) -> (f64, f64) {
    let drones = centred(&flown.at(t_s).iter().map(position).collect::<Vec<_>>());
    let slot_of = assign(&drones, slots).unwrap();
    let largest_m = drones.iter().zip(&slot_of).map(|(p, &slot)| (p - slots[slot]).norm()).fold(0.0, f64::max);
    let mut images = vec![Vec2::zeros(); slots.len()];
    for (drone, &slot) in drones.iter().zip(&slot_of) {
        images[slot] = *drone;
    }
    (largest_m, bending_energy(slots, &images, 0.0).unwrap().bending)
}

#[test]
fn a5_e6_the_formation_is_deformed_and_closes_with_each_method() {
    let slots = centred(&scenario("paper/s2-right", &[]).slots());
    for method in ["optimal", "tps", "greedy", "identity"] {
        let flown = fly_file("paper/s2-right", &[("mission.reformation", method), ("mission.tps_lambda", "100")]);
        let end_s = flown.ticks.last().unwrap().0;
        let [before, passing, after] =
            [flown.detected_s(0), flown.passed_s(0) - 8.0, end_s].map(|t_s| disturbance(&flown, &slots, t_s));
        assert!(before.0 < 0.5 && before.1 < 0.01, "{method}: {before:?} before");
        assert!(passing.0 > 50.0 && passing.1 > 10.0, "{method}: {passing:?} while passing");
        assert!(after.0 <= 0.8 && after.1 < 0.01, "{method}: {after:?} at the end");
    }
}

#[test]
fn a5_the_formation_closes_between_two_obstacle_sets_unless_groups_go_on() {
    let slots = centred(&scenario("paper/forest", &[]).slots());
    let fly = |between| fly_file("paper/forest", &[("mission.between", between)]);
    let (closes, goes_on) = (fly("close-up"), fly("go-on"));
    let between = disturbance(&closes, &slots, closes.detected_s(1) - 1.0);
    assert!(between.0 < 3.0 && between.1 < 0.1, "{between:?} before the second set");
    assert!(disturbance(&closes, &slots, 50.0).0 > 90.0);
    // If groups go on, each of them has closed its ranks, but they are far from each other.
    let apart = disturbance(&goes_on, &slots, goes_on.detected_s(1) - 1.0);
    assert!(apart.0 > 30.0, "{apart:?} before the second set");
}
