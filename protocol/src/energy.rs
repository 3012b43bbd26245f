//! Power of a rotary-wing drone: in level flight as in the paper's model P1 (Zeng, Xu, Zhang 2019). The drone weighs 20 N; its
//! rotor has four blades and a radius of 0.4 m. Hovering takes a third more power than flight at [`CHEAPEST_MPS`], so a drone
//! that waits uses more energy than one that flies on.

use crate::Vec3;

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
/// Weight of the drone, N.
const WEIGHT_N: f64 = 20.0;

/// Acceleration of gravity, m/s².
const GRAVITY_MPS2: f64 = 9.81;

/// The airspeed at which [`power_w`] is smallest, m/s.
pub const CHEAPEST_MPS: f64 = 10.21;

/// Power that level flight takes at the airspeed `speed_mps` (model P1), W. `speed_mps` must not be negative.
#[must_use]
pub fn power_w(speed_mps: f64) -> f64 {
    loaded_power_w(speed_mps, 1.0)
}

/// Power in level flight at the airspeed `speed_mps` with a thrust of `load` times the weight, W: P(V, κ) of Zeng, Xu and Zhang
/// 2019, of which model P1 is the case κ = 1. In hover the induced power grows with κ^1.5. Both numbers must not be negative.
#[must_use]
pub fn loaded_power_w(speed_mps: f64, load: f64) -> f64 {
    let square = speed_mps * speed_mps;
    let profile = PROFILE_W * (1.0 + 3.0 * square / (TIP_MPS * TIP_MPS));
    let ratio = square / (2.0 * INDUCED_MPS * INDUCED_MPS);
    let induced = INDUCED_W * load * ((load * load + ratio * ratio).sqrt() - ratio).sqrt();
    let parasite = 0.5 * DRAG_RATIO * DENSITY_KGPM3 * SOLIDITY * DISC_M2 * square * speed_mps;
    profile + induced + parasite
}

/// Power of flight in any direction, W: that of level flight at the speed `speed_mps` (the length of the velocity), plus the
/// weight times the climb rate `climb_mps` (positive upward), at least the blade profile power in hover. The climb term is that of
/// the power balance of a rotor in forward climbing flight (Leishman, Principles of Helicopter Aerodynamics, P = P_i + P_0 + P_p +
/// P_c with P_c = W·V_c). In level flight this is [`power_w`].
#[must_use]
pub fn flight_power_w(speed_mps: f64, climb_mps: f64) -> f64 {
    climbing_power_w(power_w(speed_mps), climb_mps)
}

/// The power of a climb, W: `level_w` is the power of level flight at the same airspeed, the climb rate `climb_mps` is positive
/// upward.
#[must_use]
pub fn climbing_power_w(level_w: f64, climb_mps: f64) -> f64 {
    (level_w + WEIGHT_N * climb_mps).max(PROFILE_W)
}

/// κ: the thrust that holds a drone and gives it this acceleration (world frame, m/s²), over its weight. Without acceleration it
/// is 1: as in P1, the thrust against drag is not part of it.
#[must_use]
pub fn load(acceleration_mps2: Vec3) -> f64 {
    (acceleration_mps2 / GRAVITY_MPS2 + Vec3::z()).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn climbing_costs_the_weight_times_the_climb_rate() {
        for speed in [0.0, 7.0, 10.21, 30.0] {
            assert_eq!(flight_power_w(speed, 0.0).to_bits(), power_w(speed).to_bits());
        }
        assert!((flight_power_w(10.0, 2.0) - power_w(10.0) - 40.0).abs() < 1e-9);
        assert!((flight_power_w(10.0, -1.0) - power_w(10.0) + 20.0).abs() < 1e-9);
        assert_eq!(flight_power_w(10.0, -10.0), PROFILE_W, "the rotor turns in a fast descent, too");
    }

    #[test]
    fn thrust_for_acceleration_costs_induced_power() {
        assert_eq!(load(Vec3::zeros()), 1.0);
        assert!((load(Vec3::new(0.0, 5.0, 0.0)) - (1.0f64 + (5.0f64 / 9.81).powi(2)).sqrt()).abs() < 1e-12);
        assert!((load(Vec3::new(0.0, 0.0, -9.81))).abs() < 1e-12, "free fall takes no thrust");
        // In hover, momentum theory gives an induced power of T^1.5.
        assert!((loaded_power_w(0.0, 2.0) - PROFILE_W - INDUCED_W * 2.0f64.powf(1.5)).abs() < 1e-9);
        // In fast flight the rotor meets much air, and the same thrust costs less.
        let extra = |speed: f64| loaded_power_w(speed, 1.1) - power_w(speed);
        assert!(extra(0.0) > extra(10.0) && extra(10.0) > extra(20.0) && extra(20.0) > 0.0);
    }

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
