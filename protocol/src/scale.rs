//! How small a swarm is, for the lengths and speeds that no key of a scenario sets.

/// The size of a swarm relative to those that the tuned lengths and speeds were chosen for, at most 1. A swarm is small if its drones both
/// keep a small distance and fly slowly, as indoors. Lengths and speeds shrink alike, so that times stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Scale(f64);

/// Drones that keep at least this distance are not small, m: the safe distance of `scenarios/paper/forest.toml`.
const SAFE_DISTANCE_M: f64 = 25.0;
/// Drones that fly at least at this speed are not small, m/s: the paper's nominal speed.
const SPEED_MPS: f64 = 10.0;

impl Scale {
    /// That of the swarms that the tuned numbers were chosen for, and of larger ones.
    pub const FULL: Self = Self(1.0);

    /// That of drones with this safe distance (m) and nominal speed (m/s).
    #[must_use]
    pub fn of(safe_distance_m: f64, speed_mps: f64) -> Self {
        Self((safe_distance_m / SAFE_DISTANCE_M).max(speed_mps / SPEED_MPS).min(1.0))
    }

    /// A length (m) or speed (m/s) that was chosen for [`Self::FULL`], for a swarm of this scale.
    #[must_use]
    pub fn of_full(self, length_or_speed: f64) -> f64 {
        self.0 * length_or_speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_swarms_that_are_close_and_slow_are_small() {
        assert_eq!(Scale::of(25.0, 1.0), Scale::FULL);
        assert_eq!(Scale::of(1.0, 10.0), Scale::FULL);
        assert_eq!(Scale::of(40.0, 20.0), Scale::FULL);
        assert_eq!(Scale::of(2.5, 0.5).of_full(60.0), 6.0);
        assert_eq!(Scale::of(1.0, 2.0).of_full(60.0), 12.0);
    }
}
