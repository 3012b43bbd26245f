//! Power of a rotary-wing drone in level flight (the paper's P1; Zeng, Xu, Zhang 2019): 20 N, four blades, rotor
//! radius 0.4 m. Hovering costs a third more than cruising: waiting is what burns energy.

/// Blade profile power in hover, W.
const PROFILE_W: f64 = 79.8563;
/// Induced power in hover, W.
const INDUCED_W: f64 = 88.6279;
/// Speed of the rotor blade's tip, m/s.
const TIP_MPS: f64 = 120.0;
/// Mean induced velocity of the rotor in hover, m/s.
const INDUCED_MPS: f64 = 4.03;
/// Fuselage drag ratio.
const DRAG_RATIO: f64 = 0.6;
/// Density of air, kg/m³.
const DENSITY_KGPM3: f64 = 1.225;
/// Rotor solidity.
const SOLIDITY: f64 = 0.05;
/// Area of the rotor disc, m².
const DISC_M2: f64 = 0.503;

/// The speed of least power, m/s.
pub const CHEAPEST_MPS: f64 = 10.21;

/// Power at an airspeed (P1), W. Speed in m/s, not negative.
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
    fn power_is_the_papers() {
        for (speed, power) in [(0.0, 168.48), (5.0, 143.61), (10.0, 126.03), (20.0, 178.30)] {
            assert!((power_w(speed) - power).abs() < 0.01, "P({speed}) = {}", power_w(speed));
        }
    }

    #[test]
    fn the_cheapest_speed_is_the_papers() {
        let (speed, power) =
            (0..3000).map(|i| f64::from(i) * 0.01).map(|v| (v, power_w(v))).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((speed - CHEAPEST_MPS).abs() < 0.015, "{speed}");
        assert!((power - 126.0).abs() < 0.01, "{power}");
    }
}
