//! Routes and collision avoidance: E5, A4.

use super::flown::{Flown, fly, parse, position};
use skein_protocol::record::Outcome;

/// A flight past `count` obstacles abreast, each 40 m wide, with gaps of `gap_m`.
fn abreast(count: usize, gap_m: f64) -> Flown {
    let mut text = "strategy = \"congestion-aware-paper\"\n[formation]\nspacing_m = 35\n[mission]\nend = \"goal\"\n\
                    goal_m = [420, 0]\n[drone]\nsafe_distance_m = 25\n"
        .to_owned();
    for i in 0..count {
        let y_m = (i as f64 - (count - 1) as f64 / 2.0) * (40.0 + gap_m);
        text += &format!("[[obstacle]]\nshape = \"rectangle\"\ncentre_m = [200, {y_m}]\nhalf_size_m = [10, 20]\n");
    }
    let flown = fly(&parse(&text, &[]));
    assert_eq!(flown.outcome(), Outcome::Reached, "{count} obstacles, gaps of {gap_m} m");
    flown
}

/// Number of drones that pass within this distance of the axis.
fn between(flown: &Flown, half_width_m: f64) -> usize {
    flown.crossings(200.0).iter().filter(|(_, _, row)| position(row).y.abs() < half_width_m).count()
}

#[test]
fn e5_k_obstacles_give_k_plus_one_routes_and_drones_take_the_gaps() {
    for count in 1..=3 {
        let flown = abreast(count, 60.0);
        assert_eq!(flown.routes() as usize, count + 1);
        let through = between(&flown, count as f64 * 50.0 - 30.0);
        assert_eq!(through > 0, count > 1, "{count} obstacles: {through} drones fly between them");
    }
}

#[test]
fn a4_a_gap_narrower_than_twice_the_clearance_is_closed() {
    // The clearance is 15 m on both sides of a drone.
    let (open, closed) = (abreast(2, 34.0), abreast(2, 29.0));
    assert_eq!((open.routes(), closed.routes()), (3, 2));
    assert!(between(&open, 57.0) > 0);
    assert_eq!(between(&closed, 54.5), 0, "a drone took the closed gap");
}
