use super::*;
use proptest::prelude::*;
use skein_protocol::{DroneId, SimTime};

const PARAMS: BrakingFilterParams = BrakingFilterParams {
    safe_distance_m: 33.0,
    clearance_m: 15.0,
    acceleration_max_mps2: 5.0,
    braking_mps2: 5.0,
    speed_max_mps: 20.0,
    dt_s: 0.02,
};

/// A drone at the origin with this velocity, m/s.
fn at_origin(velocity: Vec2) -> OwnMotion {
    OwnMotion {
        tick: 7,
        now: SimTime::ZERO,
        sensed_position: Vec2::zeros(),
        sensed_velocity: velocity,
        position: Vec2::zeros(),
        velocity,
        speed_limit_mps: 20.0,
        lag: 0,
    }
}

/// The command of one drone at the origin with one neighbour on the x axis. Velocities in m/s, accelerations in m/s².
fn pair(distance_m: f64, own: Vec2, other: Vec2, wanted: Vec2) -> Vec2 {
    let neighbour = Moving { id: DroneId(1), position_m: Vec2::new(distance_m, 0.0), velocity_mps: other };
    let (none, one) = (std::iter::empty(), std::iter::once(neighbour));
    BrakingFilter::new(PARAMS).filter(&at_origin(own), wanted, none, one, std::iter::empty())
}

#[test]
fn drones_in_line_at_the_nominal_speed_need_hardly_more_than_the_safe_distance() {
    let cruise = Vec2::new(10.0, 0.0);
    assert_eq!(pair(33.0 + 0.33 + 0.41, cruise, cruise, Vec2::zeros()), Vec2::zeros());
    assert!(
        pair(33.0 + 0.33 + 0.1, cruise, cruise, Vec2::zeros()).x < -1.0,
        "the drone is too near to fly on and has to brake"
    );
}

#[test]
fn a_drone_may_always_fly_away_from_a_neighbour() {
    let away = Vec2::new(-5.0, 0.0);
    assert_eq!(pair(33.0, Vec2::zeros(), Vec2::zeros(), away), away);
    assert!(pair(33.0, Vec2::zeros(), Vec2::zeros(), -away).norm() < 0.01);
}

#[test]
fn a_distant_neighbour_is_ignored() {
    let wanted = Vec2::new(5.0, 0.0);
    assert_eq!(pair(200.0, Vec2::new(10.0, 0.0), Vec2::new(-20.0, 0.0), wanted), wanted);
}

/// A vector of at most this length.
fn vector(length: f64) -> impl Strategy<Value = Vec2> {
    (0.0..std::f64::consts::TAU, 0.0..=length).prop_map(|(angle, length)| Vec2::new(angle.cos(), angle.sin()) * length)
}

#[test]
fn what_is_far_from_all_at_a_glance_is_allowed_by_a_look_at_each_braking_path() {
    let (far, near) = (std::cell::Cell::new(0), std::cell::Cell::new(0));
    // Most pairs fly nearly alike, as in a formation, and have little room.
    let neighbour = ((0.0..std::f64::consts::TAU, 33.33..50.0), prop_oneof![3 => vector(0.5), 1 => vector(40.0)]);
    let course = (vector(20.0), prop_oneof![vector(5.0), vector(0.1)], prop::collection::vec(neighbour, 1..6));
    let config = ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(4000) };
    proptest!(config, |((own_mps, wanted, neighbours) in course)| {
        let own = at_origin(own_mps);
        let neighbours = neighbours.into_iter().map(|((angle, away_m), relative_mps): ((f64, f64), Vec2)| Moving {
            id: DroneId(1),
            position_m: Vec2::new(angle.cos(), angle.sin()) * away_m,
            velocity_mps: (own_mps + relative_mps).cap_magnitude(PARAMS.speed_max_mps),
        });
        let mut filter = BrakingFilter::new(PARAMS);
        filter.compare(&own, neighbours.clone());
        let candidate = filter.candidate(&own, wanted);
        filter.cut(&own, &candidate, std::iter::empty());
        let met = filter.planes.is_empty() || (filter.planes.len() == 1 && filter.too_fast(&own, wanted).is_some());
        if filter.is_far_from_all(&own, wanted, neighbours) {
            prop_assert!(met);
            far.set(far.get() + 1);
        } else {
            near.set(near.get() + u32::from(met));
        }
    });
    // The bound is of use: it holds for many of the commands that are allowed.
    assert!(far.get() > 800 && near.get() > 100, "{} and {}", far.get(), near.get());
}

/// Such a drone needs longer to lose the speed that it gains in the tick of a command than to gain it.
#[test]
fn a_drone_that_brakes_less_than_it_accelerates_is_far_only_if_braking_after_a_command_leaves_room() {
    let params = BrakingFilterParams { braking_mps2: 1.0, ..PARAMS };
    let (own, wanted) = (at_origin(Vec2::zeros()), Vec2::new(params.acceleration_max_mps2, 0.0));
    let mut far = 0;
    for room_mm in 0..50 {
        let position_m = Vec2::new(params.keep_m() + 1e-3 * f64::from(room_mm), 0.0);
        let neighbour = std::iter::once(Moving { id: DroneId(1), position_m, velocity_mps: Vec2::zeros() });
        let mut filter = BrakingFilter::new(params);
        filter.compare(&own, neighbour.clone());
        filter.cut(&own, &filter.candidate(&own, wanted), std::iter::empty());
        if filter.is_far_from_all(&own, wanted, neighbour) {
            assert!(filter.planes.is_empty(), "{room_mm} mm");
            far += 1;
        }
    }
    assert!(far > 0);
}
