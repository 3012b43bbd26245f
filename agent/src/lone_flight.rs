//! Flight of a drone that has nothing left to pass and no formation to join: it flies on along the course. It waits beyond the
//! goal, when it is too far ahead of the last drone, or when no other drone would hear it farther on. It does not return to the
//! goal, where it could block other drones.

use crate::guidance::GuidanceParams;
use crate::tuning::{IN_REACH, LEAD_S, OVERSHOOT_S};
use skein_leader::params::{Destination, PlannerParams};
use skein_leader::peers::Peers;
use skein_protocol::{SimTime, Vec2};

/// Time between two looks for the last drone, s.
const LOOK_S: f64 = 1.0;

/// How far a drone flies on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoneFlight {
    /// Abscissa at which it waits, world frame, m; infinite without a goal.
    limit_x_m: f64,
    /// Greatest distance ahead of the last drone, m.
    lead_m: f64,
    /// When it looks for the last drone again.
    next_look: SimTime,
    /// Abscissa of the last living drone, world frame, m.
    last_x_m: f64,
    /// Abscissa up to which it stays in reach of the nearest other drone, world frame, m; infinite if all drones hear each other.
    reached_x_m: f64,
}

impl LoneFlight {
    /// The flight of one drone in a swarm of `drones`.
    pub(crate) fn new(drones: u32, planner: &PlannerParams) -> Self {
        // If all drones wait one behind another, the last one still has left the goal.
        let file_s = f64::from(drones) * planner.headway_s;
        let goal_x_m = match planner.destination {
            Destination::Goal { front_m } => front_m.x,
            Destination::Hold { .. } => f64::INFINITY,
        };
        Self {
            limit_x_m: goal_x_m + planner.speed_mps * (OVERSHOOT_S + file_s),
            lead_m: planner.speed_mps * (LEAD_S + file_s),
            next_look: SimTime::ZERO,
            last_x_m: f64::INFINITY,
            reached_x_m: f64::INFINITY,
        }
    }

    /// The speed along the course, m/s. It falls to zero where the drone has to wait. `reach_m`: distance over which drones hear each
    /// other, m; `None` if all do.
    pub(crate) fn speed_mps(
        &mut self,
        now: SimTime,
        position: Vec2,
        peers: &Peers,
        reach_m: Option<f64>,
        guidance: &GuidanceParams,
    ) -> f64 {
        if now >= self.next_look {
            self.next_look = now.after(LOOK_S);
            let living = || peers.living(now).map(|(_, pose)| pose.extrapolated(now));
            self.last_x_m = living().map(|place| place.x).fold(f64::INFINITY, f64::min);
            let nearest_m = living().map(|place| (place - position).norm()).reduce(f64::min);
            let room_m = reach_m.zip(nearest_m).map(|(reach_m, nearest_m)| IN_REACH * reach_m - nearest_m);
            self.reached_x_m = room_m.map_or(f64::INFINITY, |room_m| position.x + room_m);
        }
        let room_m = (self.last_x_m + self.lead_m).min(self.limit_x_m).min(self.reached_x_m) - position.x;
        (guidance.braking_mps2 * room_m.max(0.0)).sqrt().min(guidance.speed_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::DroneId;
    use skein_protocol::payload::Pose;

    const GUIDANCE: GuidanceParams =
        GuidanceParams { speed_mps: 10.0, speed_change_mps: 5.0, reform_speed_max_mps: 10.0, braking_mps2: 5.0 };

    fn flight(destination: Destination) -> LoneFlight {
        LoneFlight::new(2, &PlannerParams { destination, ..crate::test_params::planner() })
    }

    #[test]
    fn a_drone_waits_beyond_the_goal() {
        let mut flight = flight(Destination::Goal { front_m: Vec2::new(500.0, 30.0) });
        let mut speed_mps =
            |x_m| flight.speed_mps(SimTime::ZERO, Vec2::new(x_m, 0.0), &Peers::new(2, 1.0), None, &GUIDANCE);
        assert_eq!((speed_mps(500.0), speed_mps(900.0)), (10.0, 0.0));
    }

    #[test]
    fn a_drone_waits_for_the_last_one() {
        let mut flight = flight(Destination::Hold { stop_x_m: f64::INFINITY });
        let mut peers = Peers::new(2, 1.0);
        assert_eq!(
            flight.speed_mps(SimTime::ZERO, Vec2::new(9e3, 0.0), &peers, None, &GUIDANCE),
            10.0,
            "no other drone lives"
        );
        let now = SimTime::from_secs(2.0);
        peers.hear(now, DroneId(0), Pose { stamp: now, ..Pose::zeroed() });
        assert_eq!(flight.speed_mps(now, Vec2::new(50.0, 0.0), &peers, None, &GUIDANCE), 10.0);
        assert_eq!(flight.speed_mps(now, Vec2::new(9e3, 0.0), &peers, None, &GUIDANCE), 0.0);
    }

    #[test]
    fn a_drone_stays_in_reach_of_the_nearest_one() {
        let mut peers = Peers::new(3, 1.0);
        let now = SimTime::from_secs(2.0);
        for (drone, x_m) in [(0, 0.0), (1, 100.0)] {
            peers.hear(now, DroneId(drone), Pose { stamp: now, position_m: [x_m, 0.0, 0.0], ..Pose::zeroed() });
        }
        let speed_mps = |x_m: f64, reach_m| {
            let mut flight = flight(Destination::Hold { stop_x_m: f64::INFINITY });
            flight.speed_mps(now, Vec2::new(x_m, 0.0), &peers, reach_m, &GUIDANCE)
        };
        assert_eq!(speed_mps(130.0, Some(100.0)), 10.0);
        assert_eq!(speed_mps(180.0, Some(100.0)), 0.0);
        assert_eq!(speed_mps(180.0, None), 10.0, "all drones hear each other");
    }
}
