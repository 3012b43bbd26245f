//! Simulated time. It is a whole number of nanoseconds, so that equal runs have exactly equal times.

use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::ops::{Add, Sub};

/// Number of a tick, counted from 0 at the start of the mission.
pub type Tick = u64;

/// A point in simulated time: nanoseconds since the start of the mission.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
pub struct SimTime(pub i64);

impl SimTime {
    /// The start of the mission.
    pub const ZERO: Self = Self(0);
    /// A time later than any that a mission reaches.
    pub const MAX: Self = Self(i64::MAX);

    /// The time `seconds` after the start of the mission, rounded to the nearest nanosecond.
    #[must_use]
    pub fn from_secs(seconds: f64) -> Self {
        Self(nanos(seconds))
    }

    /// Seconds since the start of the mission.
    #[must_use]
    pub fn secs(self) -> f64 {
        self.0 as f64 / 1e9
    }

    /// Seconds from `earlier` to `self`; negative if `self` is the earlier of the two.
    #[must_use]
    pub fn since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 / 1e9
    }

    /// The time `seconds` after `self`, rounded to the nearest nanosecond. The addition saturates.
    #[must_use]
    pub fn after(self, seconds: f64) -> Self {
        Self(self.0.saturating_add(nanos(seconds)))
    }
}

/// The nearest whole number of nanoseconds; halves are rounded away from zero. It is computed without a call of a function, because each
/// drone does it several times per tick.
fn nanos(seconds: f64) -> i64 {
    let nanos = seconds * 1e9;
    let whole = nanos as i64;
    let rest = nanos - whole as f64;
    whole.saturating_add(i64::from(rest >= 0.5) - i64::from(rest <= -0.5))
}

impl Add<i64> for SimTime {
    type Output = Self;
    fn add(self, nanos: i64) -> Self {
        Self(self.0.saturating_add(nanos))
    }
}

impl Sub for SimTime {
    type Output = i64;
    fn sub(self, other: Self) -> i64 {
        self.0.saturating_sub(other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_that_no_time_can_hold_are_rounded_to_the_nearest_time() {
        let seconds =
            [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e30, -1e30, 0.5e-9, -0.5e-9, 4.999_999_999_999_999e-10];
        let expected = [0, i64::MAX, i64::MIN, i64::MAX, i64::MIN, 1, -1, 0];
        assert_eq!(seconds.map(|seconds| SimTime::from_secs(seconds).0), expected);
    }

    proptest! {
        #[test]
        fn times_are_rounded_to_the_nearest_nanosecond(seconds in prop_oneof![-1e-6..1e-6, -1e4..1e4, -1e10..1e10, any::<f64>()]) {
            prop_assert_eq!(SimTime::from_secs(seconds).0, (seconds * 1e9).round() as i64);
            prop_assert_eq!(SimTime(7).after(seconds).0, ((seconds * 1e9).round() as i64).saturating_add(7));
        }
    }
}
