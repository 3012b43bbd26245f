//! One drone's body: a planar point mass (the paper's K1), its failsafe, its energy (the paper's E7).

use crate::params::{Failsafe, WorldParams};
use crate::tuning::{DESCENT_MPS, FLIGHT_ALTITUDE_M};
use skein_protocol::Vec2;
use skein_protocol::energy::power_w;

/// The true state of one drone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    position: Vec2,
    velocity: Vec2,
    energy_j: f64,
    alive: bool,
    altitude_m: f64,
}

impl Body {
    /// A living drone at this position (world frame, m) with this velocity (world frame, m/s).
    pub(crate) fn new(position: Vec2, velocity: Vec2) -> Self {
        Self { position, velocity, energy_j: 0.0, alive: true, altitude_m: FLIGHT_ALTITUDE_M }
    }

    /// World frame, m.
    pub(crate) fn position(&self) -> Vec2 {
        self.position
    }

    /// World frame, m/s.
    pub(crate) fn velocity(&self) -> Vec2 {
        self.velocity
    }

    /// Energy used since the start, J. A drone without a process uses none: it is out of the mission.
    pub(crate) fn energy_j(&self) -> f64 {
        self.energy_j
    }

    /// Whether the drone's process lives. A frozen process lives.
    pub(crate) fn is_alive(&self) -> bool {
        self.alive
    }

    /// Whether other drones can collide with this body. A dead drone is a body until it has landed.
    pub(crate) fn flies(&self) -> bool {
        self.altitude_m > 0.0
    }

    /// One tick of a living drone under an acceleration that [`admissible`] has limited (the paper's K1):
    /// v' = v + a·dt, clipped to the greatest speed; p' = p + (v + v')/2·dt. The energy is that of the speed at the
    /// start of the tick.
    pub(crate) fn fly(&mut self, acceleration_mps2: Vec2, params: &WorldParams) {
        let dt = params.dt_s();
        self.energy_j += power_w(self.velocity.norm()) * dt;
        self.glide(clip(self.velocity + acceleration_mps2 * dt, params.speed_max_mps), dt);
    }

    /// One tick of a drone without a process: it brakes to a stop. Then it stays, or it descends and disappears.
    pub(crate) fn fail_safe(&mut self, params: &WorldParams) {
        if !self.brake(params) && params.failsafe == Failsafe::Land {
            self.altitude_m -= DESCENT_MPS * params.dt_s();
        }
    }

    /// One tick of a drone with a frozen process: it brakes to a stop and stays, whatever the failsafe is.
    pub(crate) fn hover(&mut self, params: &WorldParams) {
        self.energy_j += power_w(self.velocity.norm()) * params.dt_s();
        self.brake(params);
    }

    /// The drone's process is gone.
    pub(crate) fn kill(&mut self) {
        self.alive = false;
    }

    /// A new process flies the drone again, at its old altitude.
    pub(crate) fn revive(&mut self) {
        self.alive = true;
        self.altitude_m = FLIGHT_ALTITUDE_M;
    }

    /// Brakes at the greatest acceleration. Returns false if the body already stood still.
    fn brake(&mut self, params: &WorldParams) -> bool {
        let dt = params.dt_s();
        let speed = self.velocity.norm();
        if speed > 0.0 {
            let rest = (speed - params.braking_mps2 * dt).max(0.0);
            self.glide(self.velocity * (rest / speed), dt);
        }
        speed > 0.0
    }

    fn glide(&mut self, velocity: Vec2, dt: f64) {
        self.position += (self.velocity + velocity) / 2.0 * dt;
        self.velocity = velocity;
    }
}

/// A commanded acceleration as a drone can carry it out, m/s²: `None` if it is not finite, else no longer than `limit`.
pub(crate) fn admissible(command: [f64; 2], limit: f64) -> Option<Vec2> {
    let command = Vec2::from(command);
    command.iter().all(|part| part.is_finite()).then(|| clip(command, limit))
}

/// `vector` with its direction, no longer than `limit`. The vector is scaled before its length is taken, because the
/// squares of huge commands overflow.
fn clip(vector: Vec2, limit: f64) -> Vec2 {
    let scale = vector.amax();
    if scale <= limit && vector.norm_squared() <= limit * limit {
        return vector;
    }
    (vector / scale).normalize() * limit
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
        for _ in 0..50 {
            body.fly(Vec2::new(0.0, 2.0), &params());
        }
        assert!((body.position - Vec2::new(10.0, 1.0)).norm() < 1e-9, "{}", body.position);
        assert!((body.velocity - Vec2::new(10.0, 2.0)).norm() < 1e-9);
    }

    #[test]
    fn speed_is_clipped() {
        let mut body = cruising();
        for _ in 0..500 {
            body.fly(Vec2::new(5.0, 0.0), &params());
        }
        assert!((body.velocity - Vec2::new(20.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn energy_is_power_at_the_old_speed_times_the_tick() {
        let mut body = cruising();
        body.fly(Vec2::new(5.0, 0.0), &params());
        assert_eq!(body.energy_j, power_w(10.0) * 0.02);
    }

    #[test]
    fn the_hover_failsafe_brakes_and_stays() {
        let mut body = cruising();
        body.kill();
        for _ in 0..1000 {
            body.fail_safe(&params());
        }
        assert_eq!(body.velocity, Vec2::zeros());
        // v²/2a = 10 m.
        assert!((body.position.x - 10.0).abs() < 1e-9, "{}", body.position.x);
        assert!(body.flies());
        assert_eq!(body.energy_j, 0.0);
    }

    #[test]
    fn the_land_failsafe_removes_the_body_after_braking_and_descent() {
        let land = WorldParams { failsafe: Failsafe::Land, ..params() };
        let mut body = cruising();
        let ticks = (0..).take_while(|_| {
            body.fail_safe(&land);
            body.flies()
        });
        // Two seconds of braking and ten of descent; rounding may add one tick to each.
        let ticks = ticks.count();
        assert!((599..=602).contains(&ticks), "{ticks}");
    }

    #[test]
    fn commands_that_are_not_finite_are_rejected() {
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
