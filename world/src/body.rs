//! One drone's body: a point mass (the paper's K1, in space), its failsafe, its energy (the paper's E7).

use crate::params::{Failsafe, WorldParams};
use crate::tuning::DESCENT_MPS;
use skein_protocol::Vec3;

/// The true state of one drone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Body {
    position: Vec3,
    velocity: Vec3,
    energy_j: f64,
    alive: bool,
    flight: Flight,
}

/// How far a body has come on its way down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flight {
    Flying,
    /// It has lost its process and has stopped, and now goes down.
    Descending,
    /// It is no body any more.
    Landed,
}

impl Body {
    /// A living drone at this position (world frame, m) with this velocity (world frame, m/s).
    pub(crate) fn new(position: Vec3, velocity: Vec3) -> Self {
        Self { position, velocity, energy_j: 0.0, alive: true, flight: Flight::Flying }
    }

    /// World frame, m.
    pub(crate) fn position(&self) -> Vec3 {
        self.position
    }

    /// World frame, m/s.
    pub(crate) fn velocity(&self) -> Vec3 {
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
        self.flight != Flight::Landed
    }

    /// One tick of a living drone under an acceleration that [`admissible`] has limited (the paper's K1):
    /// v' = v + a·dt, clipped to the greatest speed; p' = p + (v + v')/2·dt. `push_mps2` is added to the acceleration, but is
    /// not the drone's own. The energy is that of the speed at the start of the tick.
    pub(crate) fn fly(&mut self, acceleration_mps2: Vec3, push_mps2: Vec3, params: &WorldParams) {
        let dt = params.dt_s();
        self.energy_j += params.energy.power_w(self.velocity, acceleration_mps2) * dt;
        self.glide(clip(self.velocity + (acceleration_mps2 + push_mps2) * dt, params.speed_max_mps), dt);
    }

    /// One tick of a drone without a process: it brakes to a stop. Then it stays, or it descends, lands and is no
    /// body any more.
    pub(crate) fn fail_safe(&mut self, params: &WorldParams) {
        if self.flight == Flight::Flying && (self.brake(params) || params.failsafe == Failsafe::Hover) {
            return;
        }
        if self.flies() {
            self.descend(params.dt_s());
        }
    }

    /// One tick of a drone with a frozen process: it brakes to a stop and stays, whatever the failsafe is.
    pub(crate) fn hover(&mut self, params: &WorldParams) {
        let before = self.velocity;
        self.brake(params);
        let braking_mps2 = (self.velocity - before) / params.dt_s();
        self.energy_j += params.energy.power_w(before, braking_mps2) * params.dt_s();
    }

    /// The drone's process is gone.
    pub(crate) fn kill(&mut self) {
        self.alive = false;
    }

    /// Whether a new process can take over: the drone lost its process, and is not on its way down. Others may fly above it then.
    pub(crate) fn can_revive(&self) -> bool {
        !self.alive && self.flight == Flight::Flying
    }

    /// A new process flies the drone again, from where it is.
    pub(crate) fn revive(&mut self) {
        self.alive = true;
    }

    /// One tick of a drone whose process does nothing before the first command of any drone takes effect: it flies straight on.
    pub(crate) fn coast(&mut self, params: &WorldParams) {
        if self.alive {
            self.energy_j += params.energy.power_w(self.velocity, Vec3::zeros()) * params.dt_s();
        }
        self.glide(self.velocity, params.dt_s());
    }

    /// Goes straight down until it is on the ground.
    fn descend(&mut self, dt: f64) {
        self.flight = Flight::Descending;
        self.glide(Vec3::new(0.0, 0.0, -DESCENT_MPS), dt);
        if self.position.z <= 0.0 {
            (self.position.z, self.velocity, self.flight) = (0.0, Vec3::zeros(), Flight::Landed);
        }
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

    fn glide(&mut self, velocity: Vec3, dt: f64) {
        self.position += (self.velocity + velocity) / 2.0 * dt;
        self.velocity = velocity;
    }
}

/// A commanded acceleration as a drone can carry it out, m/s²: `None` if it is not finite, else no longer than `limit`.
pub(crate) fn admissible(command: [f64; 3], limit: f64) -> Option<Vec3> {
    let command = Vec3::from(command);
    command.iter().all(|part| part.is_finite()).then(|| clip(command, limit))
}

/// `vector` with its direction, no longer than `limit`. The vector is scaled before its length is taken, because the
/// squares of huge commands overflow.
fn clip(vector: Vec3, limit: f64) -> Vec3 {
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
    use skein_protocol::energy::flight_power_w;

    fn cruising() -> Body {
        Body::new(Vec3::new(0.0, 0.0, 50.0), Vec3::new(10.0, 0.0, 0.0))
    }

    #[test]
    fn a_constant_acceleration_is_integrated_exactly() {
        let mut body = cruising();
        for _ in 0..50 {
            body.fly(Vec3::new(0.0, 2.0, -1.0), Vec3::zeros(), &params());
        }
        assert!((body.position - Vec3::new(10.0, 1.0, 49.5)).norm() < 1e-9, "{}", body.position);
        assert!((body.velocity - Vec3::new(10.0, 2.0, -1.0)).norm() < 1e-9);
    }

    #[test]
    fn speed_is_clipped() {
        let mut body = cruising();
        for _ in 0..500 {
            body.fly(Vec3::new(5.0, 0.0, 0.0), Vec3::zeros(), &params());
        }
        assert!((body.velocity - Vec3::new(20.0, 0.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn energy_is_power_at_the_old_speed_times_the_tick() {
        let mut body = cruising();
        body.fly(Vec3::new(5.0, 0.0, 0.0), Vec3::zeros(), &params());
        assert_eq!(body.energy_j, flight_power_w(10.0, 0.0) * 0.02);
    }

    #[test]
    fn the_hover_failsafe_brakes_and_stays() {
        let mut body = cruising();
        body.kill();
        for _ in 0..1000 {
            body.fail_safe(&params());
        }
        assert_eq!(body.velocity, Vec3::zeros());
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
        assert_eq!((body.position.z, body.velocity), (0.0, Vec3::zeros()));
    }

    #[test]
    fn a_drone_on_its_way_down_lands() {
        for (failsafe, ticks) in [(Failsafe::Land, 99), (Failsafe::Hover, 1000)] {
            let params = WorldParams { failsafe, ..params() };
            let mut body = cruising();
            assert!(!body.can_revive(), "it lives");
            body.kill();
            // It brakes for two seconds.
            let can = (0..1000).map(|_| {
                body.fail_safe(&params);
                body.can_revive()
            });
            let can: Vec<bool> = can.collect();
            let braking = can.iter().take_while(|can| **can).count();
            assert!((ticks..=ticks + 2).contains(&braking) && can[braking..].iter().all(|can| !can), "{braking}");
        }
    }

    #[test]
    fn commands_that_are_not_finite_are_rejected() {
        assert_eq!(admissible([f64::NAN, 0.0, 0.0], 5.0), None);
        assert_eq!(admissible([0.0, 0.0, f64::INFINITY], 5.0), None);
        assert_eq!(admissible([3.0, 4.0, 0.0], 5.0), Some(Vec3::new(3.0, 4.0, 0.0)));
        assert_eq!(admissible([0.0, 0.0, 1e300], 5.0), Some(Vec3::new(0.0, 0.0, 5.0)));
        assert_eq!(admissible([1.0, 0.0, 0.0], 0.0), Some(Vec3::zeros()));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn clipping_keeps_direction_and_limit(wanted in [-1e6f64..1e6, -1e6f64..1e6, -1e6f64..1e6]) {
            let (clipped, wanted) = (admissible(wanted, 5.0).unwrap(), Vec3::from(wanted));
            prop_assert!(clipped.norm() <= 5.0 + 1e-12);
            prop_assert!(clipped.cross(&wanted).norm() <= 1e-9 * (1.0 + wanted.norm()));
            prop_assert!(clipped.dot(&wanted) >= 0.0);
        }
    }
}
