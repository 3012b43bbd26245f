//! Slots that a formation keeps for drones which may be out of reach.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use bytemuck::Zeroable;
use skein_leader::leading::Leading;
use skein_leader::obstacles::set_array;
use skein_leader::own_state::OwnState;
use skein_leader::params::Destination;
use skein_leader::silent::Silent;
use skein_protocol::formation::Shape;
use skein_protocol::payload::{Passed, Pose};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, GroupId, Message, ObstacleId, Phase, SimTime, Vec2};
use swarm::{DEFAULT, params};

/// Drone 0 of four, in a column with a spacing of 40 m that stops at x = 400 m. It leads. All have passed a wall that ends at x = 205 m.
struct Leader {
    leading: Leading,
    tick: u64,
}

impl Leader {
    fn new(radio_range_m: f64) -> Self {
        let mut params = params(&DEFAULT, 4, 0, 1, SimTime::ZERO);
        params.planner.destination = Destination::Hold { stop_x_m: 400.0 };
        (params.planner.shape, params.planner.radio_range_m) = (Shape::Column, radio_range_m);
        let mut leading = Leading::new(&params);
        let shape = ConvexShape::rectangle(Vec2::new(200.0, -80.0), Vec2::new(5.0, 50.0), 0.0).unwrap();
        leading.sense(SimTime::ZERO, ObstacleId(0), shape);
        let mut leader = Self { leading, tick: 0 };
        leader.run(1.0, [120.0, 80.0, 40.0], |_| Vec::new());
        leader
    }

    /// Runs for a time, s, in which drones 0, 1 and 2 are at rest at these abscissas, m. `silent`: the drones that are not heard, by time, s.
    fn run(&mut self, seconds: f64, xs_m: [f64; 3], silent: impl Fn(f64) -> Vec<Silent>) {
        for _ in 0..(seconds / 0.02) as u32 {
            self.tick += 1;
            let now_s = 0.02 * self.tick as f64;
            let now = SimTime::from_secs(now_s);
            for (drone, x_m) in (1..).zip(&xs_m[1..]) {
                self.hear(now, drone, *x_m);
            }
            let (position, velocity) = (Vec2::new(xs_m[0], 0.0), Vec2::zeros());
            let own = OwnState { tick: self.tick, position, velocity, altitude_m: 50.0, climb_mps: 0.0 };
            let mut said = Vec::new();
            self.leading.elect(now, &own, &mut said);
            if self.leading.is_leader() {
                self.leading.refresh_members(now, &own);
                if let Some(bundle) = self.leading.decide(now, &silent(now_s), &mut said).pop() {
                    self.leading.adopt(now, bundle);
                }
            }
            self.leading.note_passed(position);
        }
    }

    fn hear(&mut self, stamp: SimTime, drone: u32, x_m: f64) {
        let (term, obeyed) = (self.leading.term(), self.leading.stamp());
        let part = self.leading.obeyed().and_then(|bundle| bundle.parts.get(DroneId(drone)));
        let (position_m, group) = ([x_m, 0.0, 50.0], part.map_or(GroupId::ALL, |part| part.group));
        let pose = Pose { stamp, position_m, group, term, obeyed, incarnation: 1, ..Pose::zeroed() };
        let (set, set_count) = set_array(&[ObstacleId(0)]);
        let passed = Passed { stamp, set_count, set, of: 0 };
        let heard = (x_m > 230.0).then_some(Message::Passed(passed));
        for message in [Message::Pose(pose)].into_iter().chain(heard) {
            self.leading.hear(stamp, DroneId(drone), &message, &mut Vec::new());
        }
    }

    /// The abscissas of the slots of drones 0, 1 and 2, m.
    fn slots_x_m(&self) -> [f64; 3] {
        let bundle = self.leading.obeyed().unwrap();
        assert_eq!(bundle.plan.phase(), Phase::Reform);
        let (anchor, _) = bundle.plan.anchor_at(SimTime::from_secs(0.02 * self.tick as f64));
        [0, 1, 2].map(|id| anchor.x + bundle.parts.get(DroneId(id)).unwrap().slot_m[0])
    }
}

/// Drone 3, which was heard at 1 s from x = 320 m.
fn third(hangs: bool) -> Vec<Silent> {
    vec![Silent { place: Vec2::new(320.0, 0.0), since: SimTime::from_secs(1.0), hangs }]
}

const PLACES_M: [f64; 3] = [400.0, 360.0, 280.0];

#[test]
fn a_formation_keeps_a_slot_for_a_drone_that_may_be_out_of_reach_for_a_minute() {
    let mut leader = Leader::new(100.0);
    leader.run(20.0, PLACES_M, |_| third(false));
    assert_eq!(leader.slots_x_m(), PLACES_M, "each drone stands in its slot");
    leader.run(39.0, PLACES_M, |_| third(false));
    assert_eq!(leader.slots_x_m(), PLACES_M);
    leader.run(2.0, PLACES_M, |_| third(false));
    assert_eq!(spacings_m(&leader), [40.0; 2]);
    // A drone cannot come to its slot, perhaps because that drone hangs there. The ranks open, and close again elsewhere.
    leader.run(6.0, PLACES_M, |_| third(false));
    closed_apart_from_the_dead(&leader);
}

#[test]
fn a_formation_closes_without_a_drone_that_is_seen_to_hang() {
    let mut leader = Leader::new(100.0);
    leader.run(20.0, PLACES_M, |now_s| third(now_s > 19.0));
    closed_apart_from_the_dead(&leader);
}

#[test]
fn a_formation_closes_without_a_silent_drone_if_all_can_hear_each_other() {
    let mut leader = Leader::new(f64::INFINITY);
    leader.run(2.0, PLACES_M, |_| third(false));
    closed_apart_from_the_dead(&leader);
}

/// The distances between the slots of drones 0, 1 and 2, m.
fn spacings_m(leader: &Leader) -> [f64; 2] {
    let [first, second, third] = leader.slots_x_m();
    [first - second, second - third].map(f64::round)
}

/// Checks that the slots are next to each other, and none of them beside drone 3.
fn closed_apart_from_the_dead(leader: &Leader) {
    assert_eq!(spacings_m(leader), [40.0; 2]);
    let slots = leader.slots_x_m();
    assert!(slots.iter().all(|x_m| (x_m - 320.0).abs() > 20.0), "{slots:?}");
}

/// The abscissa at which drone 0 expects drone 2, m, whose slot is at x = 320 m, and whose beacon of 2.8 s ago was from this abscissa, m. It flew
/// at 10 m/s.
fn expected_x_m(heard_x_m: f64) -> f64 {
    let mut leader = Leader::new(f64::INFINITY);
    leader.run(20.0, [400.0, 360.0, 320.0], |_| Vec::new());
    assert_eq!(leader.slots_x_m(), [400.0, 360.0, 320.0]);
    let now = SimTime::from_secs(0.02 * leader.tick as f64 + 3.0);
    let (term, obeyed) = (leader.leading.term(), leader.leading.stamp());
    let position_m = [heard_x_m, 0.0, 50.0];
    let pose = Pose { stamp: now.after(-2.8), position_m, velocity_mps: [10.0, 0.0, 0.0], ..Pose::zeroed() };
    let pose = Message::Pose(Pose { term, obeyed, incarnation: 1, ..pose });
    leader.leading.hear(now, DroneId(2), &pose, &mut Vec::new());
    let (position, velocity) = (Vec2::new(400.0, 0.0), Vec2::zeros());
    leader.leading.refresh_members(now, &OwnState { tick: 0, position, velocity, altitude_m: 50.0, climb_mps: 0.0 });
    leader.leading.members().iter().find(|member| member.id == DroneId(2)).unwrap().position.x
}

#[test]
fn a_drone_that_was_heard_long_ago_is_not_expected_beyond_its_slot() {
    assert_eq!(expected_x_m(290.0), 318.0);
    assert_eq!(expected_x_m(300.0), 320.0);
    assert_eq!(expected_x_m(340.0), 340.0, "it flew away from its slot, and has to turn back");
}
