//! What a drone knows of the assignments of others.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use bytemuck::Zeroable;
use skein_leader::ledger::Ledger;
use skein_leader::obstacles::{Obstacles, set_array};
use skein_leader::routes::RouteParams;
use skein_protocol::payload::{Assignment, Plan, Pose, QueuePlace, set_tag};
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId, Phase, PlanStamp, SimTime, Vec2};

const PARAMS: RouteParams =
    RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL };
const STAMP: PlanStamp = PlanStamp { ballot: Ballot { round: 1, incarnation: 1, claimant: DroneId(0) }, epoch: 3 };

/// Obstacle 0.
fn obstacles() -> Obstacles {
    let mut obstacles = Obstacles::new(4, 40.0);
    let shape = ConvexShape::rectangle(Vec2::new(200.0, 0.0), Vec2::new(10.0, 80.0), 0.0).unwrap();
    obstacles.learn(SimTime::ZERO, ObstacleId(0), shape, DroneId(0));
    obstacles
}

/// The ledger of drone 1, which heard the plan past obstacle 0 and only its own assignment.
fn ledger() -> Ledger {
    let obstacles = obstacles();
    let mut ledger = Ledger::new(DroneId(1), 4, PARAMS);
    let (set, set_count) = set_array(&[ObstacleId(0)]);
    let plan = Plan {
        id: STAMP,
        group: GroupId::ALL,
        phase: Phase::Avoid.to_wire(),
        members: 4,
        set,
        set_count,
        ..Plan::zeroed()
    };
    ledger.hear_plan(&plan, &obstacles);
    let mine = Assignment { id: STAMP, drone: DroneId(1), rank: 1, ..Assignment::zeroed() };
    ledger.hear_assignment(&mine, &obstacles);
    assert_eq!(ledger.stamp(), STAMP);
    ledger
}

fn beacon(obeyed: PlanStamp, rank: u16) -> Pose {
    let place = QueuePlace { remaining_m: 50.0, set: set_tag(&[ObstacleId(0)]), route: 1, rank };
    Pose { obeyed, queue: [QueuePlace::default(), place], ..Pose::zeroed() }
}

fn place_of(ledger: &Ledger, drone: u32) -> Option<(u16, u16)> {
    ledger.sets()[0].parts.get(DroneId(drone)).map(|part| (part.route, part.rank))
}

#[test]
fn a_lost_assignment_is_recovered_from_the_drones_beacon() {
    let mut ledger = ledger();
    ledger.hear_place(DroneId(2), &beacon(PlanStamp { epoch: 2, ..STAMP }, 5));
    assert_eq!(place_of(&ledger, 2), None, "a place under an older plan is none in this one");
    ledger.hear_place(DroneId(2), &beacon(STAMP, QueuePlace::NO_RANK));
    assert_eq!(place_of(&ledger, 2), None, "a detour is no place");
    ledger.hear_place(DroneId(2), &beacon(STAMP, 0));
    ledger.hear_place(DroneId(2), &beacon(STAMP, 7));
    assert_eq!(place_of(&ledger, 2), Some((1, 0)));
    ledger.hear_place(DroneId(1), &beacon(STAMP, 0));
    assert_eq!(place_of(&ledger, 1), Some((0, 1)), "what was heard as a part stays");
    assert!(!ledger.obeyed().unwrap().parts.contains(DroneId(2)), "it is not said as if its leader had said it");
}

/// The leader of a formation may not know an obstacle that others have planned for.
#[test]
fn a_formation_ends_the_sets_that_its_leader_says_are_passed() {
    for (passed, ended) in [(vec![], vec![]), (vec![7], vec![]), (vec![0, 7], vec![ObstacleId(0)])] {
        let (mut ledger, obstacles) = (ledger(), obstacles());
        let id = PlanStamp { epoch: 4, ..STAMP };
        let (set, set_count) = set_array(&passed.into_iter().map(ObstacleId).collect::<Vec<_>>());
        let phase = Phase::Reform.to_wire();
        let plan = Plan { id, group: GroupId::ALL, phase, members: 4, set, set_count, ..Plan::zeroed() };
        ledger.hear_plan(&plan, &obstacles);
        ledger.hear_assignment(&Assignment { id, drone: DroneId(1), ..Assignment::zeroed() }, &obstacles);
        assert!(ledger.stamp() == id && ledger.sets().is_empty(), "the drone flies in formation");
        assert_eq!(ledger.take_ended(), ended);
    }
}
