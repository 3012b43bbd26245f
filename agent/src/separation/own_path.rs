//! Where a drone will be if it gives no further command but full braking.

use super::separating_line::{SeparatingLine, Side};
use crate::braking_path::{BrakingLaw, BrakingPath};
use skein_protocol::{SimTime, Vec2};

/// The path of a drone with the commands that it has given and full braking after them. World frame.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnPath {
    now: SimTime,
    /// Greatest error of `now`, s.
    clock_error_s: f64,
    tick: u64,
    law: BrakingLaw,
    /// Paths are compared at the ticks whose number is a multiple of this.
    stride: u64,
    /// Positions at the end of each tick whose command has been given, m. The first entry is the present position.
    given: Vec<Vec2>,
    /// Full braking after the last of them.
    braking: BrakingPath,
    /// Velocity after the last of them, m/s.
    velocity: Vec2,
}

impl OwnPath {
    /// The path of a drone in tick `tick`, at time `now`. `given`: its present position, and its position after each tick whose
    /// command has been given, m; `velocity`: its velocity after the last of them, m/s. `stride`: the path is compared at the ticks
    /// whose number is a multiple of it.
    #[must_use]
    pub fn new((tick, now): (u64, SimTime), given: Vec<Vec2>, velocity: Vec2, law: BrakingLaw, stride: u32) -> Self {
        let last = given.last().copied().unwrap_or_default();
        let braking = BrakingPath::new(last, velocity, law);
        Self { now, clock_error_s: 0.0, tick, law, stride: u64::from(stride.max(1)), given, braking, velocity }
    }

    /// The same path by a clock that is wrong by up to `error_s`, s.
    #[must_use]
    pub fn with_clock_error(self, error_s: f64) -> Self {
        Self { clock_error_s: error_s, ..self }
    }

    /// The earliest time at which the path can begin.
    #[must_use]
    pub fn earliest(&self) -> SimTime {
        self.now.after(-self.clock_error_s)
    }

    /// When the path begins, by the drone's clock.
    #[must_use]
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// The tick in which the path begins.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.tick
    }

    /// Where the drone comes to rest, m.
    #[must_use]
    pub fn end(&self) -> Vec2 {
        self.braking.end()
    }

    /// Velocity after the last command that has been given, m/s.
    #[must_use]
    pub fn velocity(&self) -> Vec2 {
        self.velocity
    }

    /// The position after `ticks` ticks, m.
    fn at(&self, ticks: u64) -> Vec2 {
        let given = self.given.len().saturating_sub(1) as u64;
        match self.given.get(ticks as usize) {
            Some(&position) if ticks < given => position,
            _ => self.braking.at((ticks - given.min(ticks)) as u32),
        }
    }

    /// The least distance that the path keeps from a line at the compared ticks, m; negative on the wrong side.
    #[must_use]
    pub fn distance_m(&self, line: &SeparatingLine, side: Side) -> f64 {
        let rests = ((line.rests_after_s(self.now) + self.clock_error_s) / self.law.dt_s).ceil() as u64;
        let last = (self.given.len() as u64 + u64::from(self.braking.ticks())).max(rests);
        let mut ticks = (self.stride - self.tick % self.stride) % self.stride;
        let mut least_m = f64::INFINITY;
        loop {
            let span_s = ticks as f64 * self.law.dt_s;
            let offset_m = line.nearest_offset_m(side, self.now, span_s, self.clock_error_s);
            least_m = least_m.min(side.sign() * (line.normal().dot(&self.at(ticks)) - offset_m));
            if ticks >= last {
                return least_m;
            }
            ticks += self.stride;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: BrakingLaw = BrakingLaw { deceleration_mps2: 5.0, dt_s: 0.02 };

    #[test]
    fn the_distance_is_that_of_the_nearest_point() {
        let path = OwnPath::new((7, SimTime::ZERO), vec![Vec2::zeros()], Vec2::new(10.0, 0.0), LAW, 4);
        let ahead = SeparatingLine::resting(SimTime::ZERO, Vec2::x(), 15.0);
        assert!((path.distance_m(&ahead, Side::Back) - 5.0).abs() < 1e-9, "it stops after 10 m");
        assert!((path.distance_m(&ahead, Side::Front) + 14.8).abs() < 0.1);
        let (end, velocity) = (path.end(), path.velocity());
        assert!((end.x - 10.0).abs() < 1e-9 && velocity.x == 10.0);
    }

    #[test]
    fn commands_that_were_given_count() {
        let given = vec![Vec2::zeros(), Vec2::new(0.0, 3.0), Vec2::new(0.0, 0.0)];
        let path = OwnPath::new((0, SimTime::ZERO), given, Vec2::zeros(), LAW, 1);
        let above = SeparatingLine::resting(SimTime::ZERO, Vec2::y(), 4.0);
        assert!((path.distance_m(&above, Side::Back) - 1.0).abs() < 1e-6);
    }
}
