//! A drone that gives up its place in a queue keeps its route and flies behind all others. One that leaves its route has no place either.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use bytemuck::Zeroable;
use skein_agent::route_follower::RouteFollower;
use skein_leader::ledger::Ledger;
use skein_leader::obstacles::{Obstacles, set_array};
use skein_leader::routes::RouteParams;
use skein_protocol::payload::{Assignment, Plan, QueuePlace};
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId, Phase, PlanStamp, SimTime, Vec2};
use std::cell::Cell;

const HERE: Vec2 = Vec2::new(100.0, -60.0);

/// A wall from this ordinate to y = 80 m.
fn wall(low_m: f64) -> Obstacles {
    let mut obstacles = Obstacles::new(4, 40.0);
    let (middle_m, half_m) = (f64::midpoint(low_m, 80.0), (80.0 - low_m) / 2.0);
    let shape = ConvexShape::rectangle(Vec2::new(200.0, middle_m), Vec2::new(10.0, half_m), 0.0).unwrap();
    obstacles.learn(SimTime::ZERO, ObstacleId(0), shape, DroneId(0));
    obstacles
}

/// The ledger of drone 1 after the plan with this epoch past a wall: it is first on route 0.
fn hear_plan(ledger: &mut Ledger, epoch: u32) {
    let obstacles = wall(-80.0);
    let id = PlanStamp { ballot: Ballot { round: 1, incarnation: 1, claimant: DroneId(0) }, epoch };
    let (set, set_count) = set_array(&[ObstacleId(0)]);
    let phase = Phase::Avoid.to_wire();
    ledger
        .hear_plan(&Plan { id, group: GroupId::ALL, phase, members: 4, set, set_count, ..Plan::zeroed() }, &obstacles);
    ledger.hear_assignment(&Assignment { id, drone: DroneId(1), ..Assignment::zeroed() }, &obstacles);
}

fn first_place(route: &RouteFollower) -> (u16, u16) {
    let open = route.open_places(route.places(HERE));
    let place = open.iter().find(|place| place.set != 0).unwrap();
    (place.route, place.rank)
}

fn ledger() -> Ledger {
    let routes = RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL };
    Ledger::new(DroneId(1), 4, routes)
}

#[test]
fn a_drone_of_a_crowd_has_no_queue_and_returns_to_where_it_was() {
    let [alone, crowd] = [None, Some(0.5)].map(|squeeze| {
        let (mut ledger, mut route) = (ledger(), RouteFollower::new(DroneId(1), 0.0, squeeze));
        hear_plan(&mut ledger, 1);
        route.update(&ledger, HERE, &[]);
        let displaced = HERE + Vec2::new(20.0, -30.0);
        // It is on its way past the wall when the next plan comes.
        hear_plan(&mut ledger, 2);
        route.update(&ledger, displaced, &[]);
        let queues = route.queues(&route.open_places(route.places(displaced)));
        let lowest_m = Cell::new(f64::INFINITY);
        let blocked = route.end_if_blocked(displaced, |_, to| {
            lowest_m.set(lowest_m.get().min(to.y));
            true
        });
        assert_eq!(blocked, None);
        (queues.iter().filter(|place| place.set != 0).count(), route.end().unwrap().y, lowest_m.get())
    });
    assert_eq!(alone, (1, 0.0, -100.0));
    assert_eq!(crowd, (0, HERE.y, -100.0 - 0.5 * 60.0), "half as far from the wall as it was from its middle");
}

#[test]
fn a_place_that_was_given_up_comes_back_with_the_next_plan_alone() {
    let mut ledger = ledger();
    let mut route = RouteFollower::new(DroneId(1), 0.0, None);
    route.give_up_place();
    hear_plan(&mut ledger, 1);
    route.update(&ledger, HERE, &[]);
    assert_eq!(first_place(&route), (0, 0), "without a place there was nothing to give up");
    let path_m = route.steering(HERE).unwrap().total_m;
    route.give_up_place();
    assert_eq!(first_place(&route), (0, QueuePlace::NO_RANK));
    // A silent drone nearby has the path drawn again.
    let body = skein_leader::routes::Body { centre_m: Vec2::new(50.0, 0.0), radius_m: 5.0 };
    route.update(&ledger, HERE, &[body]);
    assert_eq!(first_place(&route), (0, QueuePlace::NO_RANK));
    assert!((route.steering(HERE).unwrap().total_m - path_m).abs() < 1e-9, "the route is the same");
    hear_plan(&mut ledger, 2);
    route.update(&ledger, HERE, &[]);
    assert_eq!(first_place(&route), (0, 0));
}

#[test]
fn a_drone_leaves_a_route_that_has_become_much_longer_than_another_one() {
    let mut ledger = ledger();
    let mut route = RouteFollower::new(DroneId(1), 0.0, None);
    hear_plan(&mut ledger, 1);
    route.update(&ledger, HERE, &[]);
    for (low_m, place) in [(-250.0, (0, 0)), (-1000.0, (1, QueuePlace::NO_RANK))] {
        ledger.redraw(ObstacleId(0), &wall(low_m));
        route.update(&ledger, HERE, &[]);
        assert_eq!(first_place(&route), place, "a wall that ends at y = {low_m} m");
    }
}

#[test]
fn a_path_that_was_asked_for_before_is_drawn_again_with_the_route() {
    let (mut ledger, mut route) = (ledger(), RouteFollower::new(DroneId(1), 0.0, None));
    hear_plan(&mut ledger, 1);
    route.update(&ledger, HERE, &[]);
    let asked = route.steering(HERE).unwrap();
    assert_eq!(route.steering(HERE), Some(asked));
    ledger.redraw(ObstacleId(0), &wall(-250.0));
    route.update(&ledger, HERE, &[]);
    let drawn = route.steering(HERE).unwrap();
    assert!(drawn.total_m > asked.total_m + 100.0, "{drawn:?} {asked:?}");
}
