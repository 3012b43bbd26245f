//! A line between two drones, each of which keeps to its own side.

use skein_protocol::payload::Separator;
use skein_protocol::{SimTime, Vec2};
use std::hash::{Hash, Hasher};

/// Decelerations are rounded down to multiples of this share of full braking. Lines that are made one after the other then
/// usually have the same deceleration, and can be compared.
const DECELERATION_STEP: f64 = 0.05;
/// Two normals count as equal if the sine of the angle between them is at most this.
const PARALLEL: f64 = 1e-12;

/// The side of a line on which a drone stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The side to which the normal points: that of the drone with the lower id.
    Front,
    /// The other side: that of the drone with the higher id.
    Back,
}

impl Side {
    /// 1 for the front and -1 for the back.
    #[must_use]
    pub fn sign(self) -> f64 {
        match self {
            Self::Front => 1.0,
            Self::Back => -1.0,
        }
    }

    /// The other side.
    #[must_use]
    pub fn opposite(self) -> Self {
        match self {
            Self::Front => Self::Back,
            Self::Back => Self::Front,
        }
    }
}

/// A line that moves along its normal at constant speed until its stamp, then brakes with constant deceleration, and stops. World frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparatingLine {
    stamp: SimTime,
    normal: Vec2,
    angle_rad: f32,
    stop_m: f64,
    speed_mps: f64,
    deceleration_mps2: f64,
}

impl Hash for SeparatingLine {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let numbers = [self.stop_m, self.speed_mps, self.deceleration_mps2];
        (self.stamp, self.angle_rad.to_bits(), numbers.map(f64::to_bits)).hash(state);
    }
}

impl SeparatingLine {
    /// A line at rest. `normal`: direction of the normal; `stop_m`: component of the line's points along the unit normal, m.
    #[must_use]
    pub fn resting(now: SimTime, normal: Vec2, stop_m: f64) -> Self {
        // The message holds the angle with less precision. Both drones compute the normal from that angle.
        let angle_rad = libm::atan2(normal.y, normal.x) as f32;
        let (sin, cos) = libm::sincos(angle_rad.into());
        Self { stamp: now, normal: Vec2::new(cos, sin), angle_rad, stop_m, speed_mps: 0.0, deceleration_mps2: 0.0 }
    }

    /// The same line, if it still has `way_m` to go to where it stops, m. It comes from the back if `way_m` is positive, and from the
    /// front if it is negative. `braking_mps2`: greatest deceleration along the normal, m/s².
    #[must_use]
    pub fn arriving(self, way_m: f64, braking_mps2: f64, full_braking_mps2: f64) -> Self {
        let step = DECELERATION_STEP * full_braking_mps2;
        self.arriving_at(way_m, (braking_mps2 / step).floor() * step)
    }

    /// The same line, if it still has `way_m` to go at its stamp and brakes with this deceleration, m/s². It rests if that is 0.
    #[must_use]
    pub fn arriving_at(self, way_m: f64, deceleration_mps2: f64) -> Self {
        // The message holds the two numbers with less precision.
        let deceleration = f64::from(deceleration_mps2 as f32);
        if deceleration <= 0.0 {
            return self;
        }
        let speed = (2.0 * deceleration * way_m.abs()).sqrt() as f32;
        Self { speed_mps: f64::from(speed).copysign(way_m), deceleration_mps2: deceleration, ..self }
    }

    /// The line that a message states.
    #[must_use]
    pub fn of_message(separator: &Separator) -> Self {
        let (sin, cos) = libm::sincos(separator.angle_rad.into());
        Self {
            stamp: separator.stamp,
            normal: Vec2::new(cos, sin),
            angle_rad: separator.angle_rad,
            stop_m: separator.stop_m,
            speed_mps: separator.speed_mps.into(),
            deceleration_mps2: separator.deceleration_mps2.into(),
        }
    }

    /// A message that states the line. It names no drone yet.
    #[must_use]
    pub fn to_message(&self) -> Separator {
        Separator {
            stamp: self.stamp,
            stop_m: self.stop_m,
            angle_rad: self.angle_rad,
            speed_mps: self.speed_mps as f32,
            deceleration_mps2: self.deceleration_mps2 as f32,
            ..Separator::default()
        }
    }

    /// The same line with exactly the normal of another one.
    #[must_use]
    pub fn with_normal_of(self, other: &Self) -> Self {
        Self { normal: other.normal, angle_rad: other.angle_rad, ..self }
    }

    /// The same line, moved along its normal by `shift_m`, m.
    #[must_use]
    pub fn shifted(self, shift_m: f64) -> Self {
        Self { stop_m: self.stop_m + shift_m, ..self }
    }

    /// Unit normal, world frame. It points to the front.
    #[must_use]
    pub fn normal(&self) -> Vec2 {
        self.normal
    }

    /// Component of the line's points along the normal once the line has stopped, m.
    #[must_use]
    pub fn stop_m(&self) -> f64 {
        self.stop_m
    }

    /// Component of the line's points along the normal `span_s` after `now`, m.
    #[must_use]
    pub fn offset_m(&self, now: SimTime, span_s: f64) -> f64 {
        if self.speed_mps == 0.0 || self.deceleration_mps2 <= 0.0 {
            return self.stop_m;
        }
        let since_s = now.since(self.stamp) + span_s;
        let left_mps = (self.speed_mps.abs() - self.deceleration_mps2 * since_s.max(0.0)).max(0.0);
        let left_m = left_mps * left_mps / (2.0 * self.deceleration_mps2) - left_mps * since_s.min(0.0);
        self.stop_m - left_m.copysign(self.speed_mps)
    }

    /// The same for a clock that is wrong by up to `error_s`: of all offsets that the line may have then, the one that is nearest to
    /// the drone on `side`, m.
    #[must_use]
    pub fn nearest_offset_m(&self, side: Side, now: SimTime, span_s: f64, error_s: f64) -> f64 {
        if error_s == 0.0 {
            return self.offset_m(now, span_s);
        }
        // A line never turns back, so the extreme offsets are those at the two ends.
        let ends = [span_s - error_s, span_s + error_s].map(|span_s| self.offset_m(now, span_s));
        match side {
            Side::Front => ends[0].max(ends[1]),
            Side::Back => ends[0].min(ends[1]),
        }
    }

    /// Time from `now` until the line stops, s; 0 if it is at rest.
    #[must_use]
    pub fn rests_after_s(&self, now: SimTime) -> f64 {
        if self.deceleration_mps2 <= 0.0 {
            return 0.0;
        }
        (self.speed_mps.abs() / self.deceleration_mps2 - now.since(self.stamp)).max(0.0)
    }

    /// Whether a drone on `side` that keeps to this line from `now` on also keeps to `other`.
    #[must_use]
    pub fn implies(&self, other: &Self, side: Side, now: SimTime) -> bool {
        let both_brake = now >= self.stamp.max(other.stamp);
        let comparable = (both_brake && self.deceleration_mps2 == other.deceleration_mps2)
            || other.rests_after_s(now) == 0.0
            || self.rests_after_s(now) == 0.0;
        let beyond = |a_m: f64, b_m: f64| side.sign() * (a_m - b_m) >= 0.0;
        self.normal.perp(&other.normal).abs() <= PARALLEL
            && self.normal.dot(&other.normal) > 0.0
            && comparable
            && beyond(self.stop_m, other.stop_m)
            && beyond(self.offset_m(now, 0.0), other.offset_m(now, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_brakes_to_its_stop() {
        let now = SimTime::from_secs(2.0);
        let line = SeparatingLine::resting(now, Vec2::x(), 50.0).arriving(40.0, 5.0, 5.0);
        assert!((line.offset_m(now, 0.0) - 10.0).abs() < 1e-4, "{line:?}");
        assert!((line.offset_m(now, 2.0) - 40.0).abs() < 1e-4);
        assert_eq!(line.offset_m(now, 4.001), 50.0);
        assert!((line.rests_after_s(now) - 4.0).abs() < 1e-5);
        let from_the_front = SeparatingLine::resting(now, Vec2::x(), 50.0).arriving(-40.0, 5.0, 5.0);
        assert!((from_the_front.offset_m(now, 0.0) - 90.0).abs() < 1e-4);
    }

    #[test]
    fn a_line_moves_at_constant_speed_until_its_stamp() {
        let stamp = SimTime::from_secs(2.0);
        let line = SeparatingLine::resting(stamp, Vec2::x(), 50.0).arriving_at(40.0, 5.0);
        let before = |span_s: f64| line.offset_m(SimTime::ZERO, span_s);
        assert!((before(2.0) - 10.0).abs() < 1e-4 && (before(1.5) - 0.0).abs() < 1e-4, "{line:?}");
        assert!((before(0.0) + 30.0).abs() < 1e-4 && (line.rests_after_s(SimTime::ZERO) - 6.0).abs() < 1e-5);
        assert!((before(4.0) - 40.0).abs() < 1e-4);
    }

    #[test]
    fn a_wrong_clock_brings_a_moving_line_nearer() {
        let now = SimTime::from_secs(2.0);
        let line = SeparatingLine::resting(now, Vec2::x(), 50.0).arriving(40.0, 5.0, 5.0);
        let at = |span_s| line.offset_m(now, span_s);
        assert_eq!(line.nearest_offset_m(Side::Front, now, 1.0, 0.5), at(1.5), "it comes from behind");
        assert_eq!(line.nearest_offset_m(Side::Back, now, 1.0, 0.5), at(0.5));
        assert_eq!(line.nearest_offset_m(Side::Back, now, 1.0, 0.0), at(1.0));
        let resting = SeparatingLine::resting(now, Vec2::x(), 50.0);
        assert_eq!(resting.nearest_offset_m(Side::Front, now, 1.0, 9.0), 50.0, "a line at rest needs no clock");
    }

    #[test]
    fn a_line_survives_its_message() {
        let line = SeparatingLine::resting(SimTime::from_secs(1.0), Vec2::new(-3.0, 4.0), 12.0).arriving(7.0, 4.2, 5.0);
        assert_eq!(SeparatingLine::of_message(&line.to_message()), line);
    }

    #[test]
    fn a_line_farther_ahead_implies_one_behind_it_for_the_drone_in_front() {
        let now = SimTime::ZERO;
        let (near, far) =
            (SeparatingLine::resting(now, Vec2::x(), 10.0), SeparatingLine::resting(now, Vec2::x(), 20.0));
        assert!(far.implies(&near, Side::Front, now) && !near.implies(&far, Side::Front, now));
        assert!(near.implies(&far, Side::Back, now) && !far.implies(&near, Side::Back, now));
        let turned = SeparatingLine::resting(now, Vec2::new(1.0, 0.01), 20.0);
        assert!(!turned.implies(&near, Side::Front, now));
        let moving = far.arriving(15.0, 5.0, 5.0);
        assert!(!moving.implies(&near, Side::Front, now), "it is still behind");
    }
}
