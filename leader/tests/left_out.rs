//! A drone without an assignment in its leader's newest plan claims to lead, once for each plan. A plan that its leader never says does not
//! count.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use bytemuck::Zeroable;
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_protocol::payload::{Assignment, Leadership, Plan, Pose};
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, Message, Phase, PlanStamp, SimTime, Vec2};
use swarm::{DEFAULT, params};

/// Drone 2 of three. It hears plans of the leader, but no assignment of its own. Whenever it claims, drone 1 takes the leadership back, and plans
/// nothing.
struct LeftOut {
    leading: Leading,
    tick: u64,
    /// The term of the last claim that was heard or made.
    term: Ballot,
}

impl LeftOut {
    fn new() -> Self {
        let params = params(&DEFAULT, 3, 2, 1, SimTime::ZERO);
        let term = Ballot { round: 1, incarnation: 1, claimant: DroneId(1) };
        Self { leading: Leading::new(&params), tick: 0, term }
    }

    fn now(&self) -> SimTime {
        SimTime::from_secs(DEFAULT.dt_s * self.tick as f64)
    }

    fn hear(&mut self, source: u32, message: Message) {
        self.leading.hear(self.now(), DroneId(source), &message, &mut Vec::new());
    }

    /// Hears that the leader has made a plan of its present term.
    fn hear_plan(&mut self, epoch: u32) {
        let (stamp, id, phase) = (self.now(), PlanStamp { ballot: self.term, epoch }, Phase::Cruise as u32);
        self.hear(1, Message::Plan(Plan { stamp, id, group: GroupId::ALL, phase, members: 2, ..Plan::zeroed() }));
    }

    /// Hears from `source` this drone's assignment in a plan of the leader's present term.
    fn hear_assignment(&mut self, source: u32, epoch: u32) {
        let (id, group) = (PlanStamp { ballot: self.term, epoch }, GroupId::ALL);
        let (scope, drone, leader) = (group, DroneId(2), DroneId(1));
        self.hear(source, Message::Assignment(Assignment { id, scope, group, drone, leader, ..Assignment::zeroed() }));
    }

    /// Flies for this long. Returns how often it has claimed to lead.
    fn claims(&mut self, seconds: f64) -> usize {
        (0..(seconds / DEFAULT.dt_s) as u64).filter(|_| self.step()).count()
    }

    /// Whether it has claimed in this tick.
    fn step(&mut self) -> bool {
        self.tick += 1;
        let (stamp, term) = (self.now(), self.term);
        for source in [0, 1] {
            let position_m = [-40.0 * f64::from(source), 0.0, 50.0];
            let pose = Pose { stamp, position_m, group: GroupId::ALL, term, incarnation: 1, ..Pose::zeroed() };
            self.hear(source, Message::Pose(pose));
        }
        let (kind, group) = (LeadershipKind::Claim as u16, GroupId::ALL);
        self.hear(1, Message::Leadership(Leadership { stamp, ballot: term, group, kind, ..Leadership::zeroed() }));
        let position = Vec2::new(-80.0, 0.0);
        let own = OwnState { tick: self.tick, position, velocity: Vec2::zeros(), altitude_m: 50.0, climb_mps: 0.0 };
        self.leading.elect(stamp, &own, &mut Vec::new());
        let claimed = self.leading.term() > term;
        if claimed {
            self.term = Ballot { round: self.leading.term().round + 1, ..term };
        }
        claimed
    }
}

#[test]
fn a_drone_without_an_assignment_claims_once_for_each_plan() {
    let mut drone = LeftOut::new();
    assert_eq!(drone.claims(60.0), 0, "no plan leaves it out");
    for epoch in 1..=3 {
        drone.hear_plan(epoch);
        assert_eq!(drone.claims(2.0), 0, "the assignment may still come");
        assert_eq!(drone.claims(58.0), 1, "plan {epoch}");
    }
}

#[test]
fn a_plan_that_the_leader_never_says_keeps_no_drone_from_obeying_the_leaders_plan() {
    let mut drone = LeftOut::new();
    drone.claims(1.0);
    drone.hear_assignment(0, 900);
    assert_eq!(drone.leading.newest_stamp().epoch, 900);
    let obeys_after_s = (1..100).map(|tenths| 0.1 * f64::from(tenths)).find(|_| {
        drone.hear_plan(1);
        drone.hear_assignment(1, 1);
        assert_eq!(drone.claims(0.1), 0, "the leader has an assignment for it");
        drone.leading.stamp().epoch == 1
    });
    assert!(obeys_after_s.is_some_and(|s| (3.9..4.3).contains(&s)), "{obeys_after_s:?}");
}

#[test]
fn a_plan_that_arrives_before_an_older_one_is_not_forgotten() {
    let mut drone = LeftOut::new();
    drone.claims(1.0);
    drone.hear_assignment(1, 3);
    for _ in 0..60 {
        drone.hear_plan(2);
        drone.claims(0.1);
        drone.hear_plan(3);
    }
    assert_eq!(drone.leading.stamp().epoch, 3);
    drone.hear_assignment(1, 4);
    for _ in 0..20 {
        drone.hear_plan(3);
        drone.claims(0.1);
    }
    assert_eq!(drone.leading.newest_stamp().epoch, 4, "2 s are no proof");
}
