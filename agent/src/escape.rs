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
/// A drone is stuck if it has not left the place where it is for this many times the patience. The place is as large as a still drone
/// flies in that time: a drone that swings to and fro over some metres is stuck as well, but is given more time.
const WINDOWS: [f64; 2] = [1.0, 10.0];
/// A drone is stuck as well if it has been pushed back for this many times the patience. Without this, of two drones that meet in a channel
/// too narrow for both, one pushes the other along it, faster than a still drone and slower than either would fly alone.
const PUSHED_WINDOW: f64 = 10.0;
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
    /// For each of [`WINDOWS`].
    stays: [Option<Stay>; WINDOWS.len()],
    pushed: Option<Pushed>,
    until: Option<SimTime>,
    direction: Vec2,
    attempts: usize,
}

/// The motion of the drone that may be stuck.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// When it is or will be in this state.
    pub now: SimTime,
    /// World frame, m.
    pub position: Vec2,
    /// World frame, m/s.
    pub velocity: Vec2,
    /// Whether it keeps apart from others by words. Then it moves in steps, whenever others have answered.
    pub by_words: bool,
    /// Velocity that it wants to fly, world frame, m/s.
    pub wanted: Vec2,
}

/// Where a drone has been since when.
#[derive(Clone, Copy, Debug)]
struct Stay {
    since: SimTime,
    position: Vec2,
}

/// How far a drone has been pushed back since when.
#[derive(Clone, Copy, Debug)]
struct Pushed {
    since: SimTime,
    /// Where it is now, m.
    position: Vec2,
    /// How far it has come since then in the direction that it wanted, m. Negative.
    gained_m: f64,
}

impl Escape {
    /// Number of attempts since the drone was last free.
    #[must_use]
    pub fn attempts(&self) -> usize {
        self.attempts
    }

    /// Returns the velocity to fly, world frame, m/s. This is the wanted one unless the drone has been stuck for `patience_s`. Then
    /// it is a velocity of magnitude `speed_mps` in another direction, for 6 to 16 s. `scale`: how small the swarm is.
    ///
    /// A drone is stuck if for `patience_s` it has not been farther away than it would be at the speed of a still drone, or not for ten
    /// times as long, or if it has been pushed back for that long. By words, it has to be still as well, and the longer time does not count.
    pub fn steer(&mut self, course: &Course, patience_s: f64, speed_mps: f64, scale: Scale) -> Vec2 {
        let Course { now, position, velocity, by_words, wanted } = *course;
        if self.until.is_some_and(|until| now < until) {
            return self.direction * speed_mps;
        }
        if self.until.is_some_and(|until| now.since(until) > FREE_S) {
            *self = Self::default();
        }
        let wanted_mps = wanted.norm();
        if wanted_mps <= EAGER_MPS.min(EAGER_SHARE * speed_mps) {
            self.stays = Default::default();
            self.pushed = None;
            return wanted;
        }
        let still_mps = scale.speed(STILL_MPS);
        let steps = by_words && velocity.norm() >= still_mps;
        let windows = if by_words { 1 } else { WINDOWS.len() };
        let mut is_stuck = false;
        for (stay, times) in self.stays.iter_mut().zip(WINDOWS).take(windows) {
            let window_s = times * patience_s;
            let is_here = |stay: &Stay| (position - stay.position).norm() <= still_mps * window_s;
            *stay = stay.filter(is_here).or_else(|| (!steps).then_some(Stay { since: now, position }));
            is_stuck |= !steps && stay.is_some_and(|stay| now.since(stay.since) >= window_s);
        }
        let forward = wanted / wanted_mps;
        is_stuck |= !by_words && self.is_pushed_back(course, forward, PUSHED_WINDOW * patience_s, still_mps);
        if !is_stuck {
            return wanted;
        }
        let turn = nalgebra::Rotation2::new(TURNS[self.attempts % TURNS.len()]);
        self.direction = turn * forward;
        self.until = Some(now.after((FIRST_S + LONGER_S * self.attempts as f64).min(LONGEST_S)));
        self.attempts += 1;
        self.stays = Default::default();
        self.pushed = None;
        self.direction * speed_mps
    }

    /// Whether the drone has been pushed back for so long, farther than a still drone moves in that time, and has never made up for it.
    /// `forward`: the direction that it wants, a unit vector.
    fn is_pushed_back(&mut self, course: &Course, forward: Vec2, window_s: f64, still_mps: f64) -> bool {
        let Course { now, position, .. } = *course;
        let before = self.pushed.unwrap_or(Pushed { since: now, position, gained_m: 0.0 });
        let gained_m = before.gained_m + (position - before.position).dot(&forward);
        let since = if gained_m < 0.0 { before.since } else { now };
        self.pushed = Some(Pushed { since, position, gained_m: gained_m.min(0.0) });
        now.since(since) >= window_s && gained_m <= -still_mps * window_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: Vec2 = Vec2::new(10.0, 0.0);

    /// The velocities that a drone flies in each second, with this speed of escape. `place`: its position in that second.
    fn flown(seconds: u32, wanted: Vec2, speed_mps: f64, place: impl Fn(f64) -> Vec2) -> Vec<Vec2> {
        let mut escape = Escape::default();
        let mut steer = |second: u32| {
            let (now, position) = (SimTime::from_secs(f64::from(second)), place(f64::from(second)));
            let course = Course { now, position, velocity: Vec2::zeros(), by_words: false, wanted };
            escape.steer(&course, 3.0, speed_mps, Scale::FULL)
        };
        (0..seconds).map(&mut steer).collect()
    }

    fn at_rest(_: f64) -> Vec2 {
        Vec2::zeros()
    }

    #[test]
    fn a_drone_that_moves_or_wants_to_stay_does_not_escape() {
        let moved = flown(100, WANTED, 5.0, |second| WANTED * second);
        assert!(moved.iter().all(|&velocity| velocity == WANTED));
        let stayed = flown(100, Vec2::zeros(), 5.0, at_rest);
        assert!(stayed.iter().all(|&velocity| velocity == Vec2::zeros()));
    }

    #[test]
    fn a_drone_that_is_still_now_and_then_on_its_way_does_not_escape() {
        // Every third second it flies on for 2 m.
        let place = |second: f64| Vec2::new((second / 3.0).ceil() * 2.0, 0.0);
        assert!(flown(100, WANTED, 5.0, place).iter().all(|&velocity| velocity == WANTED));
    }

    #[test]
    fn a_drone_that_moves_to_and_fro_in_one_place_gets_stuck_as_well() {
        let place = |second: f64| Vec2::new(f64::from(second as u32 % 2) * 0.5, 0.0);
        let flown = flown(6, WANTED, 5.0, place);
        assert_eq!(flown[..3], [WANTED; 3]);
        assert!((flown[3] - Vec2::new(-5.0, 0.0)).norm() < 1e-9, "{flown:?}");
    }

    #[test]
    fn a_drone_that_swings_over_some_metres_gets_stuck_later() {
        let place = |second: f64| Vec2::new((second * 0.8).sin() * 4.0, 0.0);
        let flown = flown(40, WANTED, 5.0, place);
        let escapes = flown.iter().position(|velocity| *velocity != WANTED);
        assert_eq!(escapes, Some(30), "{flown:?}");
    }

    #[test]
    fn a_drone_that_is_pushed_back_escapes_backwards_and_one_that_is_pushed_aside_flies_on() {
        let pushed = |push: Vec2| flown(40, WANTED, 5.0, |second| push * second);
        let back = pushed(Vec2::new(-0.4, 0.0));
        let escapes = back.iter().position(|velocity| *velocity != WANTED);
        assert_eq!(escapes, Some(30), "{back:?}");
        assert!((back[30] - Vec2::new(-5.0, 0.0)).norm() < 1e-9, "{back:?}");
        assert!(pushed(Vec2::new(0.0, 0.4)).iter().all(|velocity| *velocity == WANTED));
    }

    #[test]
    fn a_drone_that_makes_up_for_where_it_was_pushed_does_not_escape() {
        // It is pushed back for 20 s, gains more in the next 10 s, and so on.
        let place = |second: f64| {
            Vec2::new(-(second % 30.0).min(20.0) + 2.1 * (second % 30.0 - 20.0).max(0.0) + (second / 30.0).floor(), 0.0)
        };
        assert!(flown(300, WANTED, 5.0, place).iter().all(|velocity| *velocity == WANTED));
    }

    #[test]
    fn a_drone_that_moves_in_steps_by_words_does_not_escape() {
        let escapes = |by_words: bool| {
            let mut escape = Escape::default();
            (0..60).any(|second| {
                let (now, velocity) = (SimTime::from_secs(f64::from(second)), Vec2::new(0.5, 0.0));
                let course = Course { now, position: Vec2::zeros(), velocity, by_words, wanted: WANTED };
                escape.steer(&course, 3.0, 5.0, Scale::FULL) != WANTED
            })
        };
        assert!(escapes(false) && !escapes(true));
    }

    #[test]
    fn a_slow_drone_gets_stuck_as_well() {
        // The second one is in a queue: it wants to fly at the speed of its escape.
        for wanted in [Vec2::new(2.4, 0.0), Vec2::new(1.7, 0.0)] {
            let flown = flown(5, wanted, 1.7, at_rest);
            assert_eq!(flown[2], wanted);
            assert!((flown[3] - Vec2::new(-1.7, 0.0)).norm() < 1e-9, "{flown:?}");
        }
    }

    #[test]
    fn a_stuck_drone_backs_off_and_then_tries_the_sides() {
        let tried = flown(60, WANTED, 5.0, at_rest);
        assert_eq!(tried[2], WANTED);
        assert!((tried[3] - Vec2::new(-5.0, 0.0)).norm() < 1e-9 && (tried[8] - tried[3]).norm() < 1e-9);
        assert_eq!(tried[9], WANTED);
        assert!(tried.iter().any(|v| v.y > 4.9) && tried.iter().any(|v| v.y < -4.9), "{tried:?}");
    }
}
