//! Between two obstacle sets groups close up to one formation, or each goes on by itself (the paper's G1).
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use bytemuck::Zeroable;
use skein_leader::channel_params::ChannelParams;
use skein_leader::leading::Leading;
use skein_leader::obstacles::set_ids;
use skein_leader::params::{Between, Destination};
use skein_protocol::payload::{Leadership, Presence, Present};
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, Message, ObstacleId, Phase, SimTime, Vec2};
use std::collections::BTreeSet;
use swarm::air::{Air, Swarm};
use swarm::{DEFAULT, params, wall};

const DRONES: u32 = 8;

/// Eight drones in a column before two walls. The first wall is passed after 45 s, the second one is sensed after 60 s and passed
/// after 103 s.
fn before_two_walls(between: Between, loss: f64) -> Swarm {
    let mut swarm = Swarm::new(DEFAULT, Air { seed: 3, loss, ..Air::default() }, DRONES as usize);
    let machine = |me| {
        let mut params = params(&DEFAULT, DRONES, me, 1, SimTime::ZERO);
        params.planner.between = between;
        params.planner.destination = Destination::Hold { stop_x_m: 900.0 };
        Some(Leading::new(&params))
    };
    swarm.drones = (0..DRONES).map(machine).collect();
    swarm.scenery = vec![wall(1, 120.0), wall(2, 700.0)];
    swarm
}

/// By group: its drones, and the plan that they obey.
fn groups(swarm: &Swarm) -> BTreeSet<(GroupId, Vec<DroneId>, GroupId, Phase)> {
    let group = |of: GroupId| {
        let side = swarm.side(0);
        let drones: Vec<_> = side.iter().filter(|(_, l)| l.group() == of).collect();
        let plan = drones[0].1.obeyed().unwrap().plan;
        assert!(drones.iter().all(|(_, l)| l.obeyed().unwrap().plan.id == plan.id), "{of} obeys two plans");
        (of, drones.iter().map(|(id, _)| *id).collect(), plan.group, plan.phase())
    };
    let all: BTreeSet<GroupId> = swarm.side(0).iter().map(|(_, l)| l.group()).collect();
    all.into_iter().map(group).collect()
}

#[test]
fn groups_close_up_between_two_sets() {
    let mut swarm = before_two_walls(Between::CloseUp, 0.0);
    swarm.run(50.0);
    assert_eq!(swarm.disunion(0), None);
    assert!(groups(&swarm).iter().all(|(_, _, scope, phase)| (*scope, *phase) == (GroupId::ALL, Phase::Reform)));
    let plan = swarm.side(0)[0].1.obeyed().unwrap().plan;
    assert_eq!(set_ids(&plan.set, plan.set_count), [ObstacleId(1)], "the formation names what its drones have passed");
}

#[test]
fn groups_go_on_by_themselves_split_again_and_close_up_at_the_destination() {
    for loss in [0.0, 0.3] {
        let mut swarm = before_two_walls(Between::GoOn, loss);
        swarm.run(20.0);
        let parts = groups(&swarm);
        assert_eq!(parts.len(), 2, "{parts:?}");
        swarm.run(30.0);
        let names = |groups: &BTreeSet<(GroupId, Vec<DroneId>, GroupId, Phase)>| {
            groups.iter().map(|(group, drones, ..)| (*group, drones.clone())).collect::<Vec<_>>()
        };
        assert_eq!(names(&groups(&swarm)), names(&parts), "the groups stay as they are");
        assert!(groups(&swarm).iter().all(|(group, _, scope, phase)| (scope, *phase) == (group, Phase::Cruise)));
        swarm.run(30.0);
        let again = groups(&swarm);
        assert!(again.iter().all(|(_, _, scope, phase)| *scope != GroupId::ALL && *phase == Phase::Avoid), "{again:?}");
        swarm.run(30.0);
        assert_eq!(swarm.disunion(0), None);
        assert!(groups(&swarm).iter().all(|(_, _, scope, phase)| (*scope, *phase) == (GroupId::ALL, Phase::Reform)));
    }
}

#[test]
fn a_group_flies_straight_to_the_part_of_the_formation_that_its_drones_will_take() {
    let mut swarm = before_two_walls(Between::GoOn, 0.0);
    swarm.run(50.0);
    let mut ends = Vec::new();
    for (_, leading) in swarm.side(0).iter().filter(|(_, l)| l.is_leader()) {
        let plan = leading.obeyed().unwrap().plan;
        let (anchor, velocity) = plan.anchor_at(swarm.now());
        assert!((velocity.norm() - 10.0).abs() < 1e-9, "at nominal speed");
        let (stop, still) = plan.anchor_at(swarm.now().after(1000.0));
        assert!((stop - Vec2::new(900.0, 0.0)).norm() < 1e-6 && still == Vec2::zeros(), "{stop}");
        let (way, towards) = ((stop - anchor).normalize(), velocity.normalize());
        assert!((way - towards).norm() < 1e-9, "{way} {towards}");
        let slots = leading.obeyed().unwrap().parts.iter().map(|part| (part.slot_m[0] as i64, part.slot_m[1] as i64));
        ends.extend(slots);
    }
    ends.sort_unstable();
    ends.dedup();
    assert_eq!(ends.len(), DRONES as usize, "no two drones of any group have the same place");
}

#[test]
fn a_swarm_that_has_flown_as_far_as_its_destination_closes_up_at_once() {
    let mut swarm = before_two_walls(Between::GoOn, 0.0);
    swarm.scenery.pop();
    swarm.run(90.0);
    assert!(groups(&swarm).iter().all(|(_, _, scope, _)| *scope != GroupId::ALL));
    // The anchor is at 900 m after 97 s.
    swarm.run(12.0);
    assert_eq!(swarm.disunion(0), None);
    assert!(groups(&swarm).iter().all(|(.., phase)| *phase == Phase::Reform));
}

/// A column of this many drones, which hear three others to each side, over a channel of this bandwidth in bytes/s. Its drones do not all
/// fly on one line.
fn long_chain(length: u32, seed: u64, bandwidth_bytes_per_s: f64) -> Swarm {
    let mut swarm = Swarm::new(DEFAULT, Air { seed, loss: 0.05, ..Air::default() }, length as usize);
    swarm.reach = 3;
    let machine = |me| {
        let mut params = params(&DEFAULT, length, me, 1, SimTime::ZERO);
        params.channel =
            ChannelParams { bandwidth_bytes_per_s, carrier_sense_m: 300.0, drones: 2 * swarm.reach as u32 };
        Some(Leading::new(&params))
    };
    swarm.drones = (0..length).map(machine).collect();
    swarm.own.iter_mut().zip(0..).for_each(|(own, drone)| own.position.y = 7.0 * f64::from(drone % 3 - 1));
    swarm
}

/// Word of its assignments travels more slowly along the column than that of the new leaders.
#[test]
fn a_long_chain_is_split_by_one_plan_and_each_part_has_one_leader() {
    let mut swarm = long_chain(60, 5, 100_000.0);
    swarm.run(10.0);
    swarm.scenery = vec![wall(1, swarm.own[0].position.x + 90.0)];
    swarm.run(40.0);
    let elections = swarm.watch.as_ref().unwrap().leaders.len();
    let side = swarm.side(0);
    let plans: BTreeSet<_> = side.iter().map(|(_, l)| l.obeyed().unwrap().plan.id).collect();
    let parts: BTreeSet<_> = side.iter().map(|(_, l)| (l.group(), l.scope(), l.term())).collect();
    assert_eq!((plans.len(), parts.len(), elections), (1, 2, 3), "{plans:?} {parts:?}");
    assert!(parts.iter().all(|(group, scope, _)| group == scope && *group != GroupId::ALL), "{parts:?}");
}

/// A narrow channel has no room for all states that are due. No drone is forgotten for that reason, whichever plan it obeys.
#[test]
fn all_drones_are_heard_of_where_bandwidth_is_short() {
    for (bandwidth_bytes_per_s, settle_s, limit_s) in [(100_000.0, 20.0, 8.0), (30_000.0, 60.0, 12.0)] {
        let mut swarm = long_chain(60, 6, bandwidth_bytes_per_s);
        swarm.run(settle_s);
        for _ in 0..40 {
            swarm.run(1.0);
            let mut ages_s = Vec::new();
            swarm.drones[0].as_ref().unwrap().peers().ages_s(swarm.now(), 0, &mut ages_s);
            let oldest_s = ages_s.iter().copied().fold(0.0, f64::max);
            assert!(ages_s.len() == 59 && oldest_s < limit_s, "{bandwidth_bytes_per_s} bytes/s: {ages_s:?}");
        }
        assert_eq!(swarm.disunion(0), None);
    }
}

/// Word of a drone that obeys a later term comes to a leader before that term's own messages do. It may be a claim of the whole swarm that
/// is under way, so the leader does not outbid it. If the leader knows that the term is for a part, it takes that part in.
#[test]
fn a_leader_does_not_outbid_a_claim_that_is_under_way() {
    let mut swarm = long_chain(40, 7, 100_000.0);
    swarm.run(10.0);
    swarm.scenery = vec![wall(1, swarm.own[0].position.x + 90.0)];
    let closes = |s: &Swarm| {
        let forms = |l: &Leading| {
            l.obeyed().unwrap().plan.group == GroupId::ALL && l.obeyed().unwrap().plan.phase() == Phase::Reform
        };
        s.disunion(0).or_else(|| (!s.side(0).iter().all(|(_, l)| forms(l))).then(|| "not closed".to_owned()))
    };
    swarm.until(400.0, closes).unwrap();
    swarm.run(5.0);
    let term = swarm.term(0).unwrap();
    let leader = term.claimant;
    let (neighbour, far) = (DroneId(if leader.0 == 0 { 1 } else { leader.0 - 1 }), DroneId(39));
    let later = Ballot { round: term.round + 1, claimant: far, ..term };
    for is_of_part in [false, true] {
        for _ in 0..100 {
            swarm.step().unwrap();
            let (stamp, drone) = (swarm.now(), swarm.drones[leader.index()].as_mut().unwrap());
            let mut presence =
                Presence { obeyed: drone.stamp(), group: drone.group(), term: later, ..Presence::default() };
            presence.count = 1;
            let position_m = [5000.0, 0.0, 50.0];
            presence.drones[0] = Present { stamp, drone: far, incarnation: 1, position_m, ..Present::zeroed() };
            drone.hear(stamp, neighbour, &Message::Presence(presence), &mut Vec::new());
            if is_of_part {
                let (group, kind) = (GroupId::ALL.child(1).child(1), LeadershipKind::Heartbeat as u16);
                let beat = Leadership { stamp, ballot: later, kind, hops: 5, group, ..Leadership::zeroed() };
                drone.hear(stamp, neighbour, &Message::Leadership(beat), &mut Vec::new());
            }
        }
        let outbids = swarm.drones[leader.index()].as_ref().unwrap().term() > later;
        assert_eq!(outbids, is_of_part);
    }
}

#[test]
fn by_words_drones_follow_each_other_through_a_gap_no_faster_than_they_agree() {
    let mut planner = params(&DEFAULT, DRONES, 0, 1, SimTime::ZERO).planner;
    planner.headway_s = 2.75;
    assert_eq!([false, true].map(|between| planner.turn_s(between, 2.0)), [2.75; 2], "with ranging");
    planner.by_words = true;
    assert_eq!([false, true].map(|between| planner.turn_s(between, 2.0)), [2.75, 6.0]);
    assert_eq!(planner.turn_s(true, 0.5), 2.75, "a fast radio does not matter");
}

#[test]
fn a_swarm_of_33_drones_has_a_headway_between_two_obstacles_only() {
    let mut planner = params(&DEFAULT, DRONES, 0, 1, SimTime::ZERO).planner;
    planner.headway_s = 2.75;
    let mut turns_s = |drones| {
        planner.drones = drones;
        [false, true].map(|between| planner.turn_s(between, 0.0))
    };
    assert_eq!([32, 33].map(&mut turns_s), [[2.75, 2.75], [0.0, 2.75]]);
}
