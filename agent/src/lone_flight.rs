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

/// The other drones of a lone one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Others<'a> {
    /// What it knows of them.
    pub(crate) peers: &'a Peers,
    /// Distance over which drones hear each other, m; `None` if all do.
    pub(crate) reach_m: Option<f64>,
    /// Whether it keeps apart from them by words. Then those that it leaves behind might not go on.
    pub(crate) by_words: bool,
}

/// How far a drone flies on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoneFlight {
    /// Abscissa of the goal, world frame, m; infinite without one.
    goal_x_m: f64,
    /// How far beyond the goal, and beyond what it passed last, it waits, m.
    overshoot_m: f64,
    /// Greatest distance ahead of the last drone, m.
    lead_m: f64,
    /// When it looks for the last drone again.
    next_look: SimTime,
    /// Abscissa of the last living drone, world frame, m.
    last_x_m: f64,
    /// Abscissa up to which it stays in reach of the nearest other drone (by words: of the nearest one behind), world frame, m; infinite if
    /// all drones hear each other.
    reached_x_m: f64,
    /// The ordinate along which it flies, world frame, m, and when it last did.
    lane: Option<(f64, SimTime)>,
}

impl LoneFlight {
    /// The flight of one drone in a swarm of `drones`.
    pub(crate) fn new(drones: u32, planner: &PlannerParams) -> Self {
        // If all drones wait one behind another, the last one still has left the goal.
        let file_s = planner.file_s(drones);
        let goal_x_m = match planner.destination {
            Destination::Goal { front_m } => front_m.x,
            Destination::Hold { .. } => f64::INFINITY,
        };
        Self {
            goal_x_m,
            overshoot_m: planner.speed_mps * (OVERSHOOT_S + file_s),
            lead_m: planner.speed_mps * (LEAD_S + file_s),
            next_look: SimTime::ZERO,
            last_x_m: f64::INFINITY,
            reached_x_m: f64::INFINITY,
            lane: None,
        }
    }

    /// The direction of flight of a drone that keeps apart by words: along the ordinate at which it began. A drone that only flew ahead would
    /// slide along the line of another one, farther and farther away. `ahead_m`: how far ahead it comes back to that ordinate, m.
    pub(crate) fn direction(&mut self, now: SimTime, position: Vec2, ahead_m: f64) -> Vec2 {
        let known = self.lane.filter(|(_, last)| now.since(*last) <= LOOK_S);
        let (y_m, _) = *self.lane.insert((known.map_or(position.y, |(y_m, _)| y_m), now));
        Vec2::new(ahead_m, y_m - position.y).try_normalize(1e-9).unwrap_or(Vec2::x())
    }

    /// The speed along the course, m/s. It falls to zero where the drone has to wait. `passed_x_m`: exit of the obstacle set that it left
    /// last, world frame, m: it waits beyond it, too, because others still have to leave that set.
    pub(crate) fn speed_mps(
        &mut self,
        now: SimTime,
        position: Vec2,
        passed_x_m: f64,
        others: &Others<'_>,
        guidance: &GuidanceParams,
    ) -> f64 {
        let &Others { peers, reach_m, by_words } = others;
        if now >= self.next_look {
            self.next_look = now.after(LOOK_S);
            let living = || peers.living(now).map(|(_, pose)| pose.extrapolated(now));
            self.last_x_m = living().map(|place| place.x).fold(f64::INFINITY, f64::min);
            let behind = living().filter(|place| !by_words || place.x < position.x);
            let nearest_m = behind.map(|place| (place - position).norm()).reduce(f64::min);
            let room_m = reach_m.zip(nearest_m).map(|(reach_m, nearest_m)| IN_REACH * reach_m - nearest_m);
            self.reached_x_m = room_m.map_or(f64::INFINITY, |room_m| position.x + room_m);
        }
        let limit_x_m = self.goal_x_m.max(passed_x_m) + self.overshoot_m;
        let room_m = (self.last_x_m + self.lead_m).min(limit_x_m).min(self.reached_x_m) - position.x;
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

    /// The speed of a drone that has passed nothing and ranges the others, m/s.
    fn speed_mps(flight: &mut LoneFlight, now: SimTime, x_m: f64, peers: &Peers, reach_m: Option<f64>) -> f64 {
        let others = Others { peers, reach_m, by_words: false };
        flight.speed_mps(now, Vec2::new(x_m, 0.0), f64::NEG_INFINITY, &others, &GUIDANCE)
    }

    /// The speed 2 s after the start of a drone at `x_m` that hears other ones at these abscissas over `reach_m`, m/s.
    fn speed_among_mps(places_x_m: &[f64], x_m: f64, reach_m: Option<f64>, by_words: bool) -> f64 {
        let (mut peers, now) = (Peers::new(3, 1.0), SimTime::from_secs(2.0));
        for (drone, &x_m) in (0..).zip(places_x_m) {
            peers.hear(now, DroneId(drone), Pose { stamp: now, position_m: [x_m, 0.0, 0.0], ..Pose::zeroed() });
        }
        let others = Others { peers: &peers, reach_m, by_words };
        let mut flight = flight(Destination::Hold { stop_x_m: f64::INFINITY });
        flight.speed_mps(now, Vec2::new(x_m, 0.0), f64::NEG_INFINITY, &others, &GUIDANCE)
    }

    #[test]
    fn a_drone_waits_beyond_the_goal() {
        let mut flight = flight(Destination::Goal { front_m: Vec2::new(500.0, 30.0) });
        let peers = Peers::new(2, 1.0);
        let others = Others { peers: &peers, reach_m: None, by_words: false };
        let mut speed_mps =
            |x_m, passed_x_m| flight.speed_mps(SimTime::ZERO, Vec2::new(x_m, 0.0), passed_x_m, &others, &GUIDANCE);
        assert_eq!((speed_mps(500.0, 300.0), speed_mps(900.0, 300.0)), (10.0, 0.0));
        assert_eq!(speed_mps(900.0, 890.0), 10.0, "others still have to leave the obstacle beside the goal");
    }

    #[test]
    fn a_drone_waits_for_the_last_one() {
        let mut flight = flight(Destination::Hold { stop_x_m: f64::INFINITY });
        let mut peers = Peers::new(2, 1.0);
        assert_eq!(speed_mps(&mut flight, SimTime::ZERO, 9e3, &peers, None), 10.0, "no other drone lives");
        let now = SimTime::from_secs(2.0);
        peers.hear(now, DroneId(0), Pose { stamp: now, ..Pose::zeroed() });
        assert_eq!(speed_mps(&mut flight, now, 50.0, &peers, None), 10.0);
        assert_eq!(speed_mps(&mut flight, now, 9e3, &peers, None), 0.0);
    }

    #[test]
    fn a_drone_that_is_pushed_aside_comes_back() {
        let mut flight = flight(Destination::Hold { stop_x_m: f64::INFINITY });
        let mut direction = |now_s, y_m| flight.direction(SimTime::from_secs(now_s), Vec2::new(20.0, y_m), 40.0);
        assert_eq!(direction(5.0, 7.0), Vec2::x());
        assert_eq!(direction(5.5, 37.0), Vec2::new(0.8, -0.6));
        assert_eq!(direction(9.0, 37.0), Vec2::x(), "it has done something else in between");
    }

    #[test]
    fn a_drone_stays_in_reach_of_the_nearest_one() {
        let speed_mps = |x_m, reach_m| speed_among_mps(&[0.0, 100.0], x_m, reach_m, false);
        assert_eq!(speed_mps(130.0, Some(100.0)), 10.0);
        assert_eq!(speed_mps(180.0, Some(100.0)), 0.0);
        assert_eq!(speed_mps(180.0, None), 10.0, "all drones hear each other");
    }

    #[test]
    fn by_words_a_drone_stays_in_reach_of_the_nearest_one_behind() {
        let speed_mps = |x_m, by_words| speed_among_mps(&[0.0, 190.0], x_m, Some(100.0), by_words);
        assert_eq!((speed_mps(180.0, false), speed_mps(180.0, true)), (10.0, 0.0));
        assert_eq!(speed_mps(50.0, true), 10.0);
    }
}
