//! One drone's body: a planar point mass (the paper's K1), its failsafe, its energy (E7).

use crate::params::{Failsafe, WorldParams};
use skein_protocol::Vec2;
use skein_protocol::energy::power_w;

/// Altitude from which a dead drone lands, m.
pub(crate) const ALTITUDE_M: f64 = 20.0;
/// How fast it descends, m/s.
pub(crate) const DESCENT_MPS: f64 = 2.0;

/// A drone as the world knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    /// World frame, m.
    pub position: Vec2,
    /// World frame, m/s.
    pub velocity: Vec2,
    /// Used since the start, J. A drone whose process is gone uses no more: it is out of the mission.
    pub energy_j: f64,
    /// Whether its process lives.
    pub alive: bool,
    altitude_m: f64,
}

impl Body {
    /// A living drone.
    pub fn new(position: Vec2, velocity: Vec2) -> Self {
        Self { position, velocity, energy_j: 0.0, alive: true, altitude_m: ALTITUDE_M }
    }

    /// Whether it is a body that others can meet: dead drones are, until they have landed.
    pub fn flies(&self) -> bool {
        self.altitude_m > 0.0
    }

    /// One tick of a living drone under an acceleration of at most the greatest allowed (K1): v' = v + a·dt, clipped
    /// to the greatest speed; p' = p + (v + v')/2·dt. Energy by the speed at the tick's start.
    pub fn fly(&mut self, acceleration_mps2: Vec2, params: &WorldParams) {
        let dt = params.dt_s();
        self.energy_j += power_w(self.velocity.norm()) * dt;
        self.glide(clip(self.velocity + acceleration_mps2 * dt, params.speed_max_mps), dt);
    }

    /// One tick of a drone whose process is gone: it brakes to a stop, then stays, or descends and is gone.
    pub fn fail_safe(&mut self, params: &WorldParams) {
        if !self.brake(params) && params.failsafe == Failsafe::Land {
            self.altitude_m -= DESCENT_MPS * params.dt_s();
        }
    }

    /// One tick of a drone whose process is frozen: it brakes to a stop and stays, whatever the failsafe.
    pub fn hover(&mut self, params: &WorldParams) {
        self.energy_j += power_w(self.velocity.norm()) * params.dt_s();
        self.brake(params);
    }

    /// A new process flies the drone again, at its old altitude.
    pub fn revive(&mut self) {
        self.alive = true;
        self.altitude_m = ALTITUDE_M;
    }

    /// Brakes as hard as it can; false if it stands still.
    fn brake(&mut self, params: &WorldParams) -> bool {
        let dt = params.dt_s();
        let speed = self.velocity.norm();
        if speed > 0.0 {
            let rest = (speed - params.acceleration_max_mps2 * dt).max(0.0);
            self.glide(self.velocity * (rest / speed), dt);
        }
        speed > 0.0
    }

    fn glide(&mut self, velocity: Vec2, dt: f64) {
        self.position += (self.velocity + velocity) / 2.0 * dt;
        self.velocity = velocity;
    }
}

/// The command as it can be carried out, m/s²: `None` if it is not finite, else no longer than `longest`.
pub(crate) fn admissible(command: [f64; 2], longest: f64) -> Option<Vec2> {
    let command = Vec2::from(command);
    command.iter().all(|part| part.is_finite()).then(|| clip(command, longest))
}

/// `vector` with its direction, no longer than `longest`. The length is taken of the scaled vector: squares of huge
/// commands overflow.
fn clip(vector: Vec2, longest: f64) -> Vec2 {
    let scale = vector.amax();
    if scale <= longest && vector.norm_squared() <= longest * longest {
        return vector;
    }
    (vector / scale).normalize() * longest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::params;
    use proptest::prelude::*;

    fn cruising() -> Body {
        Body::new(Vec2::zeros(), Vec2::new(10.0, 0.0))
    }

    #[test]
    fn a_constant_acceleration_is_integrated_exactly() {
        let mut body = cruising();
        (0..50).for_each(|_| body.fly(Vec2::new(0.0, 2.0), &params()));
        assert!((body.position - Vec2::new(10.0, 1.0)).norm() < 1e-9, "{}", body.position);
        assert!((body.velocity - Vec2::new(10.0, 2.0)).norm() < 1e-9);
    }

    #[test]
    fn speed_is_clipped() {
        let mut body = cruising();
        (0..500).for_each(|_| body.fly(Vec2::new(5.0, 0.0), &params()));
        assert!((body.velocity - Vec2::new(20.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn energy_is_power_times_time_at_the_old_speed() {
        let mut body = cruising();
        body.fly(Vec2::new(5.0, 0.0), &params());
        assert_eq!(body.energy_j, power_w(10.0) * 0.02);
    }

    #[test]
    fn a_hovering_failsafe_stops_and_stays() {
        let mut body = cruising();
        body.alive = false;
        (0..1000).for_each(|_| body.fail_safe(&params()));
        assert_eq!(body.velocity, Vec2::zeros());
        // v²/2a = 10 m.
        assert!((body.position.x - 10.0).abs() < 1e-9, "{}", body.position.x);
        assert!(body.flies());
        assert_eq!(body.energy_j, 0.0);
    }

    #[test]
    fn a_landing_failsafe_is_gone_after_braking_and_descent() {
        let land = WorldParams { failsafe: Failsafe::Land, ..params() };
        let mut body = cruising();
        let ticks = (0..).take_while(|_| {
            body.fail_safe(&land);
            body.flies()
        });
        // Two seconds of braking and ten of descent; rounding may cost a tick each.
        let ticks = ticks.count();
        assert!((599..=602).contains(&ticks), "{ticks}");
    }

    #[test]
    fn commands_that_are_no_numbers_are_refused() {
        assert_eq!(admissible([f64::NAN, 0.0], 5.0), None);
        assert_eq!(admissible([0.0, f64::INFINITY], 5.0), None);
        assert_eq!(admissible([3.0, 4.0], 5.0), Some(Vec2::new(3.0, 4.0)));
        assert_eq!(admissible([0.0, 1e300], 5.0), Some(Vec2::new(0.0, 5.0)));
        assert_eq!(admissible([1.0, 0.0], 0.0), Some(Vec2::zeros()));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn clipping_keeps_direction_and_limit(x in -1e6f64..1e6, y in -1e6f64..1e6) {
            let clipped = admissible([x, y], 5.0).unwrap();
            prop_assert!(clipped.norm() <= 5.0 + 1e-12);
            prop_assert!(clipped.perp(&Vec2::new(x, y)).abs() <= 1e-9 * (1.0 + x.hypot(y)));
            prop_assert!(clipped.dot(&Vec2::new(x, y)) >= 0.0);
        }
    }
}
