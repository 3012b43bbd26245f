//! What drones say of the obstacles that a formation names as passed.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use bytemuck::Zeroable;
use skein_leader::leading::Leading;
use skein_leader::obstacles::set_array;
use skein_leader::own_state::OwnState;
use skein_leader::params::Destination;
use skein_protocol::payload::{Assignment, Leadership, POSE_BEFORE, Passed, Plan, Pose};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, LeadershipKind, Message, ObstacleId, Phase, PlanStamp, SimTime, Vec2};
use swarm::{DEFAULT, params, step};

const TERM: Ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };

/// One drone of two. Both know a wall beside the course line that ends at x = 205 m.
struct One {
    leading: Leading,
    tick: u64,
}

impl One {
    fn new(me: u32) -> Self {
        let mut params = params(&DEFAULT, 2, me, 1, SimTime::ZERO);
        params.planner.destination = Destination::Hold { stop_x_m: 100.0 };
        let mut leading = Leading::new(&params);
        let shape = ConvexShape::rectangle(Vec2::new(200.0, -80.0), Vec2::new(5.0, 50.0), 0.0).unwrap();
        leading.sense(SimTime::ZERO, ObstacleId(0), shape);
        Self { leading, tick: 0 }
    }

    fn now(&self) -> SimTime {
        SimTime::from_secs(0.02 * self.tick as f64)
    }

    fn hear(&mut self, source: u32, message: Message) {
        let now = self.now();
        self.leading.hear(now, DroneId(source), &message, &mut Vec::new());
    }

    /// One tick at rest at this abscissa, m. Returns what the drone says.
    fn step(&mut self, x_m: f64) -> Vec<Message> {
        self.tick += 1;
        let (position, velocity) = (Vec2::new(x_m, 0.0), Vec2::zeros());
        let own = OwnState { tick: self.tick, position, velocity, altitude_m: 50.0, climb_mps: 0.0 };
        let mut said = Vec::new();
        let now = self.now();
        step(&mut self.leading, now, &own, &mut said);
        said
    }

    /// Whether the beacons of this many ticks at this abscissa, m, say that the drone is before an obstacle.
    fn says_before(&mut self, ticks: u32, x_m: f64) -> bool {
        let said = (0..ticks).flat_map(|_| self.step(x_m)).collect::<Vec<_>>();
        let mut beacons =
            said.iter().filter_map(|message| if let Message::Pose(pose) = message { Some(pose) } else { None });
        beacons.next_back().unwrap().is_before()
    }

    /// Where the front slot and the last one are, m.
    fn slots_x_m(&self) -> (f64, f64) {
        let bundle = self.leading.obeyed().unwrap();
        let (anchor, _) = bundle.plan.anchor_at(self.now());
        (anchor.x, bundle.parts.iter().map(|part| anchor.x + part.slot_m[0]).fold(f64::INFINITY, f64::min))
    }
}

/// The wall, as named in messages.
fn named() -> ([ObstacleId; 32], u32) {
    set_array(&[ObstacleId(0)])
}

#[test]
fn a_drone_says_that_it_has_never_reached_the_end_of_an_obstacle_that_its_formation_names() {
    for names in [true, false] {
        let mut drone = One::new(1);
        let (kind, id) = (LeadershipKind::Claim as u16, PlanStamp { ballot: TERM, epoch: 1 });
        drone.hear(0, Message::Leadership(Leadership { ballot: TERM, kind, ..Leadership::zeroed() }));
        let (set, set_count) = if names { named() } else { set_array(&[]) };
        let phase = Phase::Reform.to_wire();
        drone.hear(0, Message::Plan(Plan { id, phase, members: 2, set, set_count, ..Plan::zeroed() }));
        drone.hear(0, Message::Assignment(Assignment { id, drone: DroneId(1), ..Assignment::zeroed() }));
        assert_eq!(drone.says_before(10, 180.0), names);
        assert!(!drone.says_before(10, 206.0), "it is past the wall");
        assert!(!drone.says_before(10, 180.0), "it was past the wall");
    }
}

/// The other drone may be at rest beyond the stop and hear nothing, so that the leader does not expect it to pass anything.
#[test]
fn a_formation_closes_past_an_obstacle_that_one_of_its_drones_has_ahead() {
    let mut leader = One::new(0);
    let mut run = |x_m, ticks, flags, passed| {
        for _ in 0..ticks {
            let (stamp, term, obeyed) = (leader.now(), leader.leading.term(), leader.leading.stamp());
            let pose = Pose { stamp, position_m: [100.0, 0.0, 50.0], ..Pose::zeroed() };
            leader.hear(1, Message::Pose(Pose { term, obeyed, incarnation: 1, flags, ..pose }));
            if passed {
                let (set, set_count) = named();
                leader.hear(1, Message::Passed(Passed { stamp, set_count, set, of: 0 }));
            }
            leader.step(x_m);
        }
        let plan = leader.leading.obeyed().unwrap().plan;
        (plan.phase(), leader.slots_x_m())
    };
    assert_eq!(run(120.0, 50, 0, false).0, Phase::Avoid);
    let (phase, (front_m, last_m)) = run(240.0, 50, 0, true);
    let mean_m = f64::midpoint(front_m, last_m);
    assert!(phase == Phase::Reform && (mean_m - 170.0).abs() < 1.0, "the slots are where the drones are: {mean_m} m");
    let (_, (_, last_m)) = run(240.0, 100, POSE_BEFORE, true);
    assert!((last_m - 225.0).abs() < 1.0, "the last slot is past the wall: {last_m} m");
}
