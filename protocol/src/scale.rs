//! How small a swarm is, for the lengths and speeds that no key of a scenario sets.

/// The size of a swarm relative to those that the tuned lengths and speeds were chosen for, at most 1. A swarm is small if its drones both
/// keep a small distance and fly slowly, as indoors: its lengths shrink. Its speeds shrink if its drones fly slowly.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Scale {
    length: f64,
    speed: f64,
}

/// Drones that keep at least this distance are not small, m: the safe distance of `scenarios/paper/forest.toml`.
const SAFE_DISTANCE_M: f64 = 25.0;
/// Drones that fly at least at this speed are not small, m/s: the paper's nominal speed.
const SPEED_MPS: f64 = 10.0;

impl Scale {
    /// That of the swarms that the tuned numbers were chosen for, and of larger ones.
    pub const FULL: Self = Self { length: 1.0, speed: 1.0 };

    /// That of drones with this safe distance (m) and nominal speed (m/s).
    #[must_use]
    pub fn of(safe_distance_m: f64, speed_mps: f64) -> Self {
        let speed = (speed_mps / SPEED_MPS).min(1.0);
        Self { length: (safe_distance_m / SAFE_DISTANCE_M).max(speed).min(1.0), speed }
    }

    /// A length that was chosen for [`Self::FULL`], for a swarm of this scale, m. Also an acceleration, m/s².
    #[must_use]
    pub fn length(self, full_m: f64) -> f64 {
        self.length * full_m
    }

    /// A speed that was chosen for [`Self::FULL`], for a swarm of this scale, m/s.
    #[must_use]
    pub fn speed(self, full_mps: f64) -> f64 {
        self.speed * full_mps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_shrink_with_swarms_that_are_close_and_slow_and_speeds_with_slow_ones() {
        assert_eq!(Scale::of(40.0, 20.0), Scale::FULL);
        let scaled = |safe_distance_m, speed_mps| {
            let scale = Scale::of(safe_distance_m, speed_mps);
            (scale.length(60.0), scale.speed(60.0))
        };
        assert_eq!(scaled(25.0, 1.0), (60.0, 6.0));
        assert_eq!(scaled(1.0, 10.0), (60.0, 60.0));
        assert_eq!(scaled(2.5, 0.5), (6.0, 3.0));
        assert_eq!(scaled(1.0, 2.0), (12.0, 12.0));
    }
}
