use super::*;
use skein_protocol::{DroneId, SimTime};

/// The command of one drone at the origin with one neighbour on the x axis. Velocities in m/s, accelerations in m/s².
fn pair(distance_m: f64, own: Vec2, other: Vec2, wanted: Vec2) -> Vec2 {
    let params = BrakingFilterParams {
        safe_distance_m: 33.0,
        clearance_m: 15.0,
        acceleration_max_mps2: 5.0,
        braking_mps2: 5.0,
        speed_max_mps: 20.0,
        dt_s: 0.02,
    };
    let own = OwnMotion {
        tick: 7,
        now: SimTime::ZERO,
        sensed_position: Vec2::zeros(),
        sensed_velocity: own,
        position: Vec2::zeros(),
        velocity: own,
        speed_limit_mps: 20.0,
        lag: 0,
    };
    let neighbour = Moving { id: DroneId(1), position_m: Vec2::new(distance_m, 0.0), velocity_mps: other };
    BrakingFilter::new(params).filter(&own, wanted, std::iter::empty(), std::iter::once(neighbour), std::iter::empty())
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
