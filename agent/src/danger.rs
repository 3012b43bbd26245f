//! Distances of obstacle detection: paper, Algorithm 2 and equations 1 to 4.

/// Standard gravity, m/s².
pub const GRAVITY_MPS2: f64 = 9.81;

/// What stopping takes: the vehicle's constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Braking {
    /// c_d of equation 3, dimensionless, > 0.
    pub drag_coefficient: f64,
    /// t_c of equation 4, s.
    pub reaction_time_s: f64,
}

impl Braking {
    /// Time to impact at this distance and speed (equation 1), s; infinity at rest.
    #[must_use]
    pub fn time_to_impact_s(distance_m: f64, speed_mps: f64) -> f64 {
        if speed_mps > 0.0 { distance_m / speed_mps } else { f64::INFINITY }
    }

    /// Braking distance d_b = v² / (2 g c_d) (equation 3), m.
    #[must_use]
    pub fn braking_m(&self, speed_mps: f64) -> f64 {
        speed_mps * speed_mps / (2.0 * GRAVITY_MPS2 * self.drag_coefficient)
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

    /// The danger zone around a drone: within it an obstacle cannot be kept `clearance_m` away from by braking alone;
    /// twice the stopping distance leaves room to turn.
    #[must_use]
    pub fn danger_zone_m(&self, speed_mps: f64, clearance_m: f64) -> f64 {
        clearance_m + 2.0 * self.stopping_m(speed_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_one_to_four() {
        let braking = Braking { drag_coefficient: 5.0 / GRAVITY_MPS2, reaction_time_s: 0.5 };
        assert_eq!(Braking::time_to_impact_s(90.0, 10.0), 9.0);
        assert!((braking.braking_m(10.0) - 10.0).abs() < 1e-12);
        assert_eq!(braking.reaction_m(10.0), 5.0);
        assert!((braking.stopping_m(10.0) - 15.0).abs() < 1e-12);
        assert!((braking.danger_zone_m(10.0, 15.0) - 45.0).abs() < 1e-12);
        assert_eq!(Braking::time_to_impact_s(1.0, 0.0), f64::INFINITY);
    }
}
