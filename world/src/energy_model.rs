//! What the power of a drone is computed from.

use skein_protocol::energy::{climbing_power_w, load, loaded_power_w};
use skein_protocol::{Vec2, Vec3};

/// Which motion takes which power. The default is the paper's P1 in still air.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnergyModel {
    /// Velocity of the air over ground, m/s. Power is that of the airspeed. The wind pushes no drone: to hold a course in it is a
    /// matter of attitude, which point masses do not have.
    pub wind_mps: Vec2,
    /// Whether thrust for a commanded acceleration takes power.
    pub thrust: bool,
}

impl EnergyModel {
    /// The power of a drone that moves with this velocity over ground (m/s) and is commanded this acceleration (m/s²), W.
    pub(crate) fn power_w(&self, velocity: Vec3, acceleration_mps2: Vec3) -> f64 {
        let airspeed_mps = (velocity - self.wind_mps.push(0.0)).norm();
        let load = if self.thrust { load(acceleration_mps2) } else { 1.0 };
        climbing_power_w(loaded_power_w(airspeed_mps, load), velocity.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::energy::{flight_power_w, power_w};

    const EAST: Vec3 = Vec3::new(10.0, 0.0, 0.0);

    #[test]
    fn the_default_is_the_paper_s_power_in_still_air() {
        let (climbing, braking) = (Vec3::new(7.0, 2.0, 1.5), Vec3::new(-5.0, 0.0, 0.0));
        let power = EnergyModel::default().power_w(climbing, braking);
        assert_eq!(power.to_bits(), flight_power_w(climbing.norm(), 1.5).to_bits());
    }

    #[test]
    fn power_is_that_of_the_airspeed() {
        let wind = |x, y| EnergyModel { wind_mps: Vec2::new(x, y), thrust: false };
        assert_eq!(wind(-10.0, 0.0).power_w(EAST, Vec3::zeros()), power_w(20.0));
        assert_eq!(wind(10.0, 0.0).power_w(EAST, Vec3::zeros()), power_w(0.0));
        assert_eq!(wind(0.0, 6.0).power_w(Vec3::new(8.0, 0.0, 0.0), Vec3::zeros()), power_w(10.0));
    }

    #[test]
    fn thrust_for_acceleration_takes_power_if_it_counts() {
        let model = |thrust| EnergyModel { thrust, ..EnergyModel::default() };
        let power = |thrust| model(thrust).power_w(EAST, Vec3::new(0.0, 5.0, 0.0));
        assert_eq!(power(false), power_w(10.0));
        assert_eq!(power(true), loaded_power_w(10.0, load(Vec3::new(0.0, 5.0, 0.0))));
        assert!(power(true) > power(false) * 1.05);
        assert_eq!(model(true).power_w(EAST, Vec3::zeros()), power_w(10.0));
    }
}
