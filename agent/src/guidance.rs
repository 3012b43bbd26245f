//! Formation flight: the velocity that brings a drone to its slot, without regard to obstacles and neighbours.

use crate::tuning::APPROACH_PER_S;
use skein_protocol::payload::Plan;
use skein_protocol::{SimTime, Vec2};

/// Constants of formation flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuidanceParams {
    /// Nominal speed v, m/s.
    pub speed_mps: f64,
    /// δ: largest intended deviation from the nominal speed, m/s.
    pub speed_change_mps: f64,
    /// Largest speed while a drone approaches its slot, m/s.
    pub reform_speed_max_mps: f64,
    /// Deceleration of full braking, m/s².
    pub braking_mps2: f64,
}

/// The anchor of a plan at `now`: position (world frame, m) and velocity (m/s). It moves with the plan's velocity from
/// the plan's stamp on, until it reaches the abscissa at which it stops.
#[must_use]
pub fn anchor(plan: &Plan, now: SimTime) -> (Vec2, Vec2) {
    plan.anchor_at(now)
}

impl GuidanceParams {
    /// The velocity that brings a drone to a moving slot, m/s. `offset`: from the drone to the slot, m. The closing speed
    /// is proportional to the distance, as long as the drone can still brake.
    #[must_use]
    pub fn to_slot(&self, offset: Vec2, slot_velocity: Vec2) -> Vec2 {
        let distance = offset.norm();
        let closing = (APPROACH_PER_S * distance).min((self.braking_mps2 * distance).sqrt());
        let mut wanted = slot_velocity;
        if distance > 1e-9 {
            wanted += offset * (closing / distance);
        }
        // While the formation moves, no drone turns back.
        if slot_velocity.x > 0.0 {
            wanted.x = wanted.x.max(self.speed_mps - self.speed_change_mps);
        }
        let speed = wanted.norm();
        if speed > self.reform_speed_max_mps { wanted * (self.reform_speed_max_mps / speed) } else { wanted }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn the_anchor_moves_and_then_stops() {
        let plan = Plan {
            anchor_m: [10.0, 1.0],
            anchor_mps: [10.0, 0.0],
            anchor_stop_x_m: 50.0,
            stamp: SimTime::from_secs(1.0),
            ..Plan::zeroed()
        };
        assert_eq!(anchor(&plan, SimTime::from_secs(2.0)), (Vec2::new(20.0, 1.0), Vec2::new(10.0, 0.0)));
        assert_eq!(anchor(&plan, SimTime::from_secs(9.0)), (Vec2::new(50.0, 1.0), Vec2::zeros()));
        let aslant = Plan { anchor_mps: [8.0, 6.0], ..plan };
        assert_eq!(anchor(&aslant, SimTime::from_secs(2.0)), (Vec2::new(18.0, 7.0), Vec2::new(8.0, 6.0)));
        assert_eq!(anchor(&aslant, SimTime::from_secs(99.0)), (Vec2::new(50.0, 31.0), Vec2::zeros()), "after 5 s");
        let still = Plan { anchor_mps: [0.0; 2], anchor_m: [80.0, 0.0], ..plan };
        assert_eq!(anchor(&still, SimTime::from_secs(9.0)), (Vec2::new(80.0, 0.0), Vec2::zeros()));
    }

    #[test]
    fn a_slot_is_approached_no_faster_than_the_drone_can_brake() {
        let guidance =
            GuidanceParams { speed_mps: 10.0, speed_change_mps: 5.0, reform_speed_max_mps: 15.0, braking_mps2: 5.0 };
        assert!((guidance.to_slot(Vec2::new(0.0, 1.0), Vec2::zeros()) - Vec2::new(0.0, 0.8)).norm() < 1e-12);
        assert!((guidance.to_slot(Vec2::new(20.0, 0.0), Vec2::zeros()).norm() - 10.0).abs() < 1e-12);
        assert!((guidance.to_slot(Vec2::new(900.0, 0.0), Vec2::zeros()).norm() - 15.0).abs() < 1e-12);
        let behind = guidance.to_slot(Vec2::new(-100.0, 0.0), Vec2::new(10.0, 0.0));
        assert!((behind.x - 5.0).abs() < 1e-12, "{behind}");
    }
}
