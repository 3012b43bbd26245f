//! The path of a drone that brakes fully: a straight line, computed tick by tick like the motion of the simulated bodies.

use skein_protocol::Vec2;

/// How a vehicle brakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingLaw {
    /// Deceleration, m/s².
    pub deceleration_mps2: f64,
    /// Length of a tick, s.
    pub dt_s: f64,
}

impl BrakingLaw {
    /// Acceleration of full braking at `velocity` (m/s), m/s². It stops the drone exactly in the last tick.
    #[must_use]
    pub fn braking(&self, velocity: Vec2) -> Vec2 {
        let (speed, step) = (velocity.norm(), self.deceleration_mps2 * self.dt_s);
        if speed > step { velocity * (-self.deceleration_mps2 / speed) } else { -velocity / self.dt_s }
    }
}

/// Positions of a drone at the end of each tick if it brakes fully from now on. In each tick its speed falls by
/// `deceleration · dt`; in the last tick it falls to zero. Within a tick the speed changes linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingPath {
    start: Vec2,
    /// Unit vector of the velocity; zero at rest.
    heading: Vec2,
    speed_mps: f64,
    law: BrakingLaw,
    /// Number of ticks in which the speed falls by the full amount.
    full_ticks: u32,
    /// Length of the path, m.
    length_m: f64,
}

impl BrakingPath {
    /// The braking path from position `start`, m, with initial velocity `velocity`, m/s. The frame of `start` is the frame of
    /// all positions of the path.
    #[must_use]
    pub fn new(start: Vec2, velocity: Vec2, law: BrakingLaw) -> Self {
        let speed_mps = velocity.norm();
        let heading = if speed_mps > 0.0 { velocity / speed_mps } else { Vec2::zeros() };
        let full_ticks = (speed_mps / (law.deceleration_mps2 * law.dt_s)) as u32;
        let mut path = Self { start, heading, speed_mps, law, full_ticks, length_m: 0.0 };
        let full_s = f64::from(full_ticks) * law.dt_s;
        let rest_mps = speed_mps - law.deceleration_mps2 * full_s;
        path.length_m = path.along_m(full_s) + rest_mps * law.dt_s / 2.0;
        path
    }

    /// The path of a drone at rest at the start of this one.
    #[must_use]
    pub fn resting(&self) -> Self {
        Self::new(self.start, Vec2::zeros(), self.law)
    }

    /// Distance flown in the first `span_s` of full deceleration, m.
    fn along_m(&self, span_s: f64) -> f64 {
        span_s * (self.speed_mps - self.law.deceleration_mps2 * span_s / 2.0)
    }

    /// Distance flown after `ticks` ticks, m.
    #[must_use]
    pub fn flown_m(&self, ticks: u32) -> f64 {
        if ticks > self.full_ticks { self.length_m } else { self.along_m(f64::from(ticks) * self.law.dt_s) }
    }

    /// Position after `ticks` ticks, m.
    #[must_use]
    pub fn at(&self, ticks: u32) -> Vec2 {
        self.start + self.heading * self.flown_m(ticks)
    }

    /// Position at the start of the path, m.
    #[must_use]
    pub fn start(&self) -> Vec2 {
        self.start
    }

    /// Position at which the drone comes to rest, m.
    #[must_use]
    pub fn end(&self) -> Vec2 {
        self.start + self.heading * self.length_m
    }

    /// Number of ticks after which the drone is at rest.
    #[must_use]
    pub fn ticks(&self) -> u32 {
        self.full_ticks + 1
    }

    /// Product of a transposed Jacobian and `direction`. The Jacobian is the derivative of the position after `ticks` ticks with
    /// respect to the initial velocity. Unit: s times the unit of `direction`.
    #[must_use]
    pub fn pull_back(&self, ticks: u32, direction: Vec2) -> Vec2 {
        let (flown_m, by_speed_s) = match ticks > self.full_ticks {
            true => (self.length_m, (f64::from(self.full_ticks) + 0.5) * self.law.dt_s),
            false => (self.flown_m(ticks), f64::from(ticks) * self.law.dt_s),
        };
        self.scaled(flown_m, by_speed_s, direction)
    }

    /// Like [`Self::pull_back`], for the point at `share` (0 to 1) of the path's length.
    #[must_use]
    pub fn pull_back_at(&self, share: f64, direction: Vec2) -> Vec2 {
        let by_speed_s = (f64::from(self.full_ticks) + 0.5) * self.law.dt_s;
        self.scaled(share * self.length_m, share * by_speed_s, direction)
    }

    fn scaled(&self, flown_m: f64, by_speed_s: f64, direction: Vec2) -> Vec2 {
        if self.speed_mps <= 0.0 {
            return direction * by_speed_s;
        }
        let along = self.heading * self.heading.dot(&direction);
        along * by_speed_s + (direction - along) * (flown_m / self.speed_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: BrakingLaw = BrakingLaw { deceleration_mps2: 5.0, dt_s: 0.02 };

    /// One tick of full braking, computed like the motion of the world's bodies.
    fn brake(position: &mut Vec2, velocity: &mut Vec2) {
        let speed = velocity.norm();
        let next = *velocity * ((speed - LAW.deceleration_mps2 * LAW.dt_s).max(0.0) / speed.max(1e-300));
        *position += (*velocity + next) / 2.0 * LAW.dt_s;
        *velocity = next;
    }

    #[test]
    fn the_braking_path_equals_the_flight_of_a_braking_body() {
        let (mut position, mut velocity) = (Vec2::new(3.0, -1.0), Vec2::new(7.03, 2.9));
        let path = BrakingPath::new(position, velocity, LAW);
        for tick in 1..100 {
            brake(&mut position, &mut velocity);
            assert!((path.at(tick) - position).norm() < 1e-9, "tick {tick}");
            let rest = BrakingPath::new(position, velocity, LAW);
            assert!((rest.end() - path.end()).norm() < 1e-9, "full braking changed the end of the braking path");
        }
        assert_eq!(velocity, Vec2::zeros());
    }

    #[test]
    fn the_jacobian_equals_finite_differences() {
        let velocity = Vec2::new(7.03, 2.9);
        let direction = Vec2::new(0.6, -0.8);
        let path = BrakingPath::new(Vec2::zeros(), velocity, LAW);
        for ticks in [0, 1, 30, 75, 76, 77, 200] {
            let shifted = |step: Vec2| BrakingPath::new(Vec2::zeros(), velocity + step, LAW).at(ticks).dot(&direction);
            let difference = |step: Vec2| (shifted(step) - shifted(-step)) / 2e-6;
            let expected = Vec2::new(difference(Vec2::x() * 1e-6), difference(Vec2::y() * 1e-6));
            assert!((path.pull_back(ticks, direction) - expected).norm() < 1e-6, "after {ticks} ticks");
        }
    }
}
