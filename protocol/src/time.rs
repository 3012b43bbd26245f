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
        Self((seconds * 1e9).round() as i64)
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
        Self(self.0.saturating_add((seconds * 1e9).round() as i64))
    }
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
