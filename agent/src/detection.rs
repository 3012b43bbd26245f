//! Obstacle detection: distances and danger zone (paper, Algorithm 2 and equations 1 to 4).

use skein_protocol::Vec2;
use skein_protocol::downlink::SensedObstacle;

/// Constants of the vehicle that determine its stopping distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// Deceleration of full braking, m/s², > 0: g c_d of equation 3, at most the drone's greatest acceleration.
    pub deceleration_mps2: f64,
    /// Reaction time t_c of equation 4, s.
    pub reaction_time_s: f64,
}

/// The result of Algorithm 2 for one sensed obstacle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Distance to the nearest point of the obstacle, negative inside it, m.
    pub distance_m: f64,
    /// Direction of that point relative to the drone's velocity, or to the x axis if the drone is at rest. Positive to
    /// the left, -π to π, rad.
    pub bearing_rad: f64,
    /// Time to impact if the drone flew straight at that point (equation 1), s; infinite at rest.
    pub time_to_impact_s: f64,
    /// Whether the obstacle is in the danger zone.
    pub danger: bool,
}

impl Braking {
    /// Algorithm 2 for one obstacle in range of a drone at `position` (world frame, m) with `velocity` (m/s). The drone
    /// has to keep `clearance_m` away from the obstacle.
    #[must_use]
    pub fn detect(&self, position: Vec2, velocity: Vec2, obstacle: &SensedObstacle, clearance_m: f64) -> Detection {
        let (to, speed) = (obstacle.nearest() - position, velocity.norm());
        let heading = if speed > 0.0 { velocity } else { Vec2::x() };
        Detection {
            distance_m: obstacle.distance_m,
            bearing_rad: heading.perp(&to).atan2(heading.dot(&to)),
            time_to_impact_s: Self::time_to_impact_s(obstacle.distance_m, speed),
            danger: obstacle.distance_m < self.danger_zone_m(speed, clearance_m),
        }
    }

    /// Time to impact at this distance and speed (equation 1), s; infinite at rest.
    #[must_use]
    pub fn time_to_impact_s(distance_m: f64, speed_mps: f64) -> f64 {
        if speed_mps > 0.0 { distance_m / speed_mps } else { f64::INFINITY }
    }

    /// Braking distance d_b (equation 3), m: v² / (2 g c_d), where g c_d is at most the drone's greatest acceleration.
    #[must_use]
    pub fn braking_m(&self, speed_mps: f64) -> f64 {
        speed_mps * speed_mps / (2.0 * self.deceleration_mps2)
    }

    /// Reaction distance d_r = v t_c (equation 4), m.
    #[must_use]
    pub fn reaction_m(&self, speed_mps: f64) -> f64 {
        speed_mps * self.reaction_time_s
    }

    /// Stopping distance d_s = d_r + d_b (equation 2), m.
    #[must_use]
    pub fn stopping_m(&self, speed_mps: f64) -> f64 {
        self.reaction_m(speed_mps) + self.braking_m(speed_mps)
    }

    /// Radius of the danger zone, m: the clearance and twice the stopping distance. Twice, because a drone needs room to
    /// turn as well as to brake.
    #[must_use]
    pub fn danger_zone_m(&self, speed_mps: f64, clearance_m: f64) -> f64 {
        clearance_m + 2.0 * self.stopping_m(speed_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_detection_has_distance_bearing_time_to_impact_and_danger() {
        let braking = Braking { deceleration_mps2: 5.0, reaction_time_s: 0.0 };
        let obstacle = |[x, y]: [f64; 2]| {
            let (nearest_m, distance_m) = ([x, y, 0.0], Vec2::new(x, y).norm());
            SensedObstacle { nearest_m, distance_m, shape: 0, reserved: 0 }
        };
        let detect = |nearest_m, velocity| braking.detect(Vec2::zeros(), velocity, &obstacle(nearest_m), 15.0);
        let ahead = detect([60.0, 0.0], Vec2::new(10.0, 0.0));
        assert_eq!((ahead.bearing_rad, ahead.time_to_impact_s, ahead.danger), (0.0, 6.0, false));
        let left = detect([0.0, 30.0], Vec2::new(10.0, 0.0));
        assert!((left.bearing_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12 && left.danger);
        assert!((detect([30.0, 0.0], Vec2::new(0.0, 5.0)).bearing_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let resting = detect([0.0, -30.0], Vec2::zeros());
        assert!(resting.time_to_impact_s.is_infinite() && resting.bearing_rad < 0.0 && !resting.danger);
    }

    #[test]
    fn equations_one_to_four() {
        let braking = Braking { deceleration_mps2: 5.0, reaction_time_s: 0.5 };
        assert_eq!(Braking::time_to_impact_s(90.0, 10.0), 9.0);
        assert!((braking.braking_m(10.0) - 10.0).abs() < 1e-12);
        assert_eq!(braking.reaction_m(10.0), 5.0);
        assert!((braking.stopping_m(10.0) - 15.0).abs() < 1e-12);
        assert!((braking.danger_zone_m(10.0, 15.0) - 45.0).abs() < 1e-12);
        assert_eq!(Braking::time_to_impact_s(1.0, 0.0), f64::INFINITY);
    }
}
