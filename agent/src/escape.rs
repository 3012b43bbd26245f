//! Escape of a stuck drone. A drone is stuck if it wants to move and cannot. It first backs off and then tries the sides.

use crate::tuning::STILL_MPS;
use skein_protocol::scale::Scale;
use skein_protocol::{SimTime, Vec2};

/// A still drone counts as stuck if it wants to fly faster than this, m/s, or than [`EAGER_SHARE`] of the speed at which it would escape. A
/// drone whose nominal speed is lower than this would never be stuck otherwise.
const EAGER_MPS: f64 = 3.0;
/// See [`EAGER_MPS`]. Less than 1, because a drone in a queue wants to fly at the speed at which it would escape.
const EAGER_SHARE: f64 = 0.9;
/// Duration of the first attempt, s.
const FIRST_S: f64 = 6.0;
/// Increase of the duration from each attempt to the next, s.
const LONGER_S: f64 = 2.0;
/// Longest duration of an attempt, s.
const LONGEST_S: f64 = 16.0;
/// The attempts are forgotten this long after the end of the last one, s.
const FREE_S: f64 = 20.0;
/// Directions of the attempts, relative to the blocked direction, rad, in the order in which they are tried.
const TURNS: [f64; 5] = [
    std::f64::consts::PI,
    std::f64::consts::FRAC_PI_2,
    -std::f64::consts::FRAC_PI_2,
    std::f64::consts::FRAC_PI_4 * 3.0,
    -std::f64::consts::FRAC_PI_4 * 3.0,
];

/// Escape attempts of one drone.
#[derive(Clone, Copy, Debug, Default)]
pub struct Escape {
    still_since: Option<SimTime>,
    until: Option<SimTime>,
    direction: Vec2,
    attempts: usize,
}

impl Escape {
    /// Number of attempts since the drone was last free.
    #[must_use]
    pub fn attempts(&self) -> usize {
        self.attempts
    }

    /// Returns the velocity to fly, world frame, m/s. This is `wanted` unless the drone has been stuck for `patience_s`. Then
    /// it is a velocity of magnitude `speed_mps` in another direction, for 6 to 16 s. `velocity` and `wanted`: world frame, m/s.
    /// `scale`: how small the swarm is.
    pub fn steer(
        &mut self,
        now: SimTime,
        velocity: Vec2,
        wanted: Vec2,
        patience_s: f64,
        speed_mps: f64,
        scale: Scale,
    ) -> Vec2 {
        if self.until.is_some_and(|until| now < until) {
            return self.direction * speed_mps;
        }
        if self.until.is_some_and(|until| now.since(until) > FREE_S) {
            *self = Self::default();
        }
        if velocity.norm() >= scale.of_full(STILL_MPS) || wanted.norm() <= EAGER_MPS.min(EAGER_SHARE * speed_mps) {
            self.still_since = None;
            return wanted;
        }
        let since = *self.still_since.get_or_insert(now);
        if now.since(since) < patience_s {
            return wanted;
        }
        let turn = nalgebra::Rotation2::new(TURNS[self.attempts % TURNS.len()]);
        self.direction = turn * wanted.normalize();
        self.until = Some(now.after((FIRST_S + LONGER_S * self.attempts as f64).min(LONGEST_S)));
        self.attempts += 1;
        self.still_since = None;
        self.direction * speed_mps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: Vec2 = Vec2::new(10.0, 0.0);

    #[test]
    fn a_drone_that_moves_or_wants_to_stay_does_not_escape() {
        let mut escape = Escape::default();
        for second in 0..100 {
            let now = SimTime::from_secs(f64::from(second));
            assert_eq!(escape.steer(now, WANTED, WANTED, 3.0, 5.0, Scale::FULL), WANTED);
            assert_eq!(escape.steer(now, Vec2::zeros(), Vec2::zeros(), 3.0, 5.0, Scale::FULL), Vec2::zeros());
        }
    }

    #[test]
    fn a_slow_drone_gets_stuck_as_well() {
        let (mut escape, wanted) = (Escape::default(), Vec2::new(2.4, 0.0));
        let at = |second: u32| SimTime::from_secs(f64::from(second));
        let flown: Vec<Vec2> =
            (0..5).map(|second| escape.steer(at(second), Vec2::zeros(), wanted, 3.0, 1.7, Scale::FULL)).collect();
        assert_eq!(flown[2], wanted);
        assert!((flown[3] - Vec2::new(-1.7, 0.0)).norm() < 1e-9, "{flown:?}");
    }

    #[test]
    fn a_slow_drone_in_a_queue_gets_stuck_as_well() {
        let (mut escape, wanted) = (Escape::default(), Vec2::new(1.7, 0.0));
        let at = |second: u32| SimTime::from_secs(f64::from(second));
        let flown: Vec<Vec2> =
            (0..5).map(|second| escape.steer(at(second), Vec2::zeros(), wanted, 3.0, 1.7, Scale::FULL)).collect();
        assert!((flown[3] - Vec2::new(-1.7, 0.0)).norm() < 1e-9, "{flown:?}");
    }

    #[test]
    fn a_stuck_drone_backs_off_and_then_tries_the_sides() {
        let mut escape = Escape::default();
        let tried: Vec<Vec2> = (0..60)
            .map(|second| {
                escape.steer(SimTime::from_secs(f64::from(second)), Vec2::zeros(), WANTED, 3.0, 5.0, Scale::FULL)
            })
            .collect();
        assert_eq!(tried[2], WANTED);
        assert!((tried[3] - Vec2::new(-5.0, 0.0)).norm() < 1e-9 && (tried[8] - tried[3]).norm() < 1e-9);
        assert_eq!(tried[9], WANTED);
        assert!(tried.iter().any(|v| v.y > 4.9) && tried.iter().any(|v| v.y < -4.9), "{tried:?}");
    }
}
