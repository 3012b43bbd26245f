//! Power of a rotary-wing drone in level flight, as in the paper's model P1 (Zeng, Xu, Zhang 2019). The drone weighs 20 N; its
//! rotor has four blades and a radius of 0.4 m. Hovering takes a third more power than flight at [`CHEAPEST_MPS`], so a drone
//! that waits uses more energy than one that flies on.

/// Blade profile power in hover, W.
const PROFILE_W: f64 = 79.8563;
/// Induced power in hover, W.
const INDUCED_W: f64 = 88.6279;
/// Tip speed of the rotor blades, m/s.
const TIP_MPS: f64 = 120.0;
/// Mean induced velocity of the rotor in hover, m/s.
const INDUCED_MPS: f64 = 4.03;
/// Fuselage drag ratio, dimensionless.
const DRAG_RATIO: f64 = 0.6;
/// Air density, kg/m³.
const DENSITY_KGPM3: f64 = 1.225;
/// Rotor solidity, dimensionless.
const SOLIDITY: f64 = 0.05;
/// Area of the rotor disc, m².
const DISC_M2: f64 = 0.503;

/// The airspeed at which [`power_w`] is smallest, m/s.
pub const CHEAPEST_MPS: f64 = 10.21;

/// Power that level flight takes at the airspeed `speed_mps` (model P1), W. `speed_mps` must not be negative.
#[must_use]
pub fn power_w(speed_mps: f64) -> f64 {
    let square = speed_mps * speed_mps;
    let profile = PROFILE_W * (1.0 + 3.0 * square / (TIP_MPS * TIP_MPS));
    let ratio = square / (2.0 * INDUCED_MPS * INDUCED_MPS);
    let induced = INDUCED_W * ((1.0 + ratio * ratio).sqrt() - ratio).sqrt();
    let parasite = 0.5 * DRAG_RATIO * DENSITY_KGPM3 * SOLIDITY * DISC_M2 * square * speed_mps;
    profile + induced + parasite
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_matches_the_paper() {
        for (speed, power) in [(0.0, 168.48), (5.0, 143.61), (10.0, 126.03), (20.0, 178.30)] {
            assert!((power_w(speed) - power).abs() < 0.01, "P({speed}) = {}", power_w(speed));
        }
    }

    #[test]
    fn speed_of_least_power_matches_the_paper() {
        let (speed, power) =
            (0..3000).map(|i| f64::from(i) * 0.01).map(|v| (v, power_w(v))).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((speed - CHEAPEST_MPS).abs() < 0.015, "{speed}");
        assert!((power - 126.0).abs() < 0.01, "{power}");
    }
}
