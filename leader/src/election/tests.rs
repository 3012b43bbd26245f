use super::*;

const PARAMS: ElectionParams = ElectionParams { heartbeat_period_s: 0.2, leader_timeout_s: 1.0, wait_s: 0.2 };
const N: GroupId = GroupId::ALL;

fn at(seconds: f64) -> SimTime {
    SimTime::from_secs(seconds)
}

/// A drone that has measured its link already: its time-out is the base time-out.
fn machine(id: u32) -> Election {
    Election {
        adaptive_timeout: AdaptiveTimeout::new(SimTime::ZERO),
        ..Election::new(DroneId(id), 1, PARAMS, SimTime::ZERO)
    }
}

fn ballot(round: u32, claimant: u32) -> Ballot {
    Ballot { round, incarnation: 1, claimant: DroneId(claimant) }
}

fn tick(drone: &mut Election, now_s: f64, closer: usize) -> Option<Leadership> {
    drone.handle(at(now_s), 0, Input::Tick { closer, delay_s: 0.02 })
}

fn sign(drone: &mut Election, now_s: f64, ballot: Ballot, scope: GroupId, named: bool) {
    drone.handle(at(now_s), 0, Input::Sign { ballot, scope: Some(scope), named, stamp: Some(at(now_s)) });
}

/// Ticks a drone every 20 ms until it says something of this kind.
fn until_said(drone: &mut Election, from_s: f64, closer: usize, kind: LeadershipKind) -> (f64, Leadership) {
    (0..500)
        .map(|i| from_s + f64::from(i) * 0.02)
        .find_map(|t| tick(drone, t, closer).filter(|said| said.kind() == kind).map(|said| (t, said)))
        .expect("says something within ten seconds")
}

fn claim(drone: &mut Election, from_s: f64, closer: usize) -> (f64, Leadership) {
    until_said(drone, from_s, closer, LeadershipKind::Claim)
}

#[test]
fn the_closest_drone_claims_first_and_the_next_one_only_if_it_hears_no_claim() {
    let (first, said) = claim(&mut machine(5), 0.0, 0);
    let mut second = machine(3);
    assert!((0.2..0.24).contains(&first));
    second.handle(at(first + 0.02), 0, Input::Heard(said));
    assert!(!second.leads() && second.obeyed() == said.ballot);
    let (alone, _) = claim(&mut machine(3), 0.0, 1);
    assert!((0.4..0.44).contains(&alone));
}

#[test]
fn a_restarted_drone_listens_before_it_claims() {
    let again = || Election::new(DroneId(5), 2, PARAMS, at(10.0));
    let (first, _) = claim(&mut again(), 10.0, 0);
    assert!((14.2..14.24).contains(&first), "{first}");
    let mut drone = again();
    sign(&mut drone, 13.9, ballot(1, 0), N, false);
    assert!(
        tick(&mut drone, 14.2, 0).is_none() && drone.obeyed() == ballot(1, 0),
        "a restart does not outbid the leader"
    );
}

#[test]
fn an_unknown_link_is_assumed_to_lose_half_of_all_messages() {
    let mut drone = Election::new(DroneId(1), 1, PARAMS, SimTime::ZERO);
    assert!((4.5..4.7).contains(&drone.silence_s()));
    for beat in 1..=12 {
        sign(&mut drone, 0.2 * f64::from(beat), ballot(1, 0), N, false);
    }
    assert_eq!(drone.silence_s(), PARAMS.leader_timeout_s);
}

#[test]
fn of_two_claims_the_higher_ballot_wins() {
    let (mut a, mut b) = (machine(1), machine(2));
    let (_, said_a) = claim(&mut a, 0.0, 0);
    let (_, said_b) = claim(&mut b, 0.0, 0);
    a.handle(at(0.3), 0, Input::Heard(said_b));
    b.handle(at(0.3), 0, Input::Heard(said_a));
    assert!(!a.leads() && b.leads());
    assert_eq!(a.obeyed(), b.obeyed());
}

#[test]
fn a_silent_leader_is_replaced_after_a_pre_vote_and_steps_down_when_it_returns() {
    let (mut old, mut heir) = (machine(1), machine(2));
    let (t, said) = claim(&mut old, 0.0, 0);
    heir.handle(at(t), 0, Input::Heard(said));
    let (asked, pre_vote) = until_said(&mut heir, t, 0, LeadershipKind::PreVote);
    assert!(asked >= t + PARAMS.leader_timeout_s - PARAMS.wait_s - 1e-9);
    assert_eq!((pre_vote.ballot, pre_vote.stamp), (said.ballot, at(t)));
    let (later, next) = claim(&mut heir, asked + 0.02, 0);
    assert!((0.0..0.021).contains(&(later - t - PARAMS.leader_timeout_s + 1e-9)), "{later}");
    assert!(later >= asked + PARAMS.wait_s - 1e-9 && next.ballot > said.ballot);
    old.handle(at(later), 0, Input::Heard(next));
    assert!(!old.leads());
}

#[test]
fn a_drone_that_heard_the_leader_rejects_a_pre_vote() {
    let (mut leader, mut deaf, mut other) = (machine(1), machine(2), machine(3));
    let (t, said) = claim(&mut leader, 0.0, 0);
    deaf.handle(at(t), 0, Input::Heard(said));
    sign(&mut other, t + 0.7, said.ballot, N, false);
    let (asked, pre_vote) = until_said(&mut deaf, t, 0, LeadershipKind::PreVote);
    let rejection = other.handle(at(asked), 0, Input::Heard(pre_vote)).expect("it has heard the leader since");
    assert_eq!((rejection.kind(), rejection.stamp), (LeadershipKind::PreVoteRejection, at(t + 0.7)));
    let (mut told, mut untold) = (deaf.clone(), deaf);
    told.handle(at(asked + 0.02), 0, Input::Heard(rejection));
    assert!((1..60).all(|i| tick(&mut told, asked + 0.02 + 0.01 * f64::from(i), 0).is_none()));
    assert!(claim(&mut untold, asked, 0).0 < asked + 0.25);
    // It does not answer if it knows nothing newer, nor about another term.
    assert!(other.handle(at(asked), 0, Input::Heard(Leadership { stamp: at(t + 0.7), ..pre_vote })).is_none());
    assert!(other.handle(at(asked), 0, Input::Heard(Leadership { ballot: ballot(9, 9), ..pre_vote })).is_none());
    // The leader itself rejects a pre-vote.
    assert_eq!(leader.handle(at(asked), 0, Input::Heard(pre_vote)).map(|said| said.stamp), Some(at(asked)));
}

#[test]
fn a_rejection_counts_up_to_its_stamp_and_not_if_it_is_from_the_future() {
    let mut drone = machine(2);
    sign(&mut drone, 0.0, ballot(1, 1), N, false);
    let rejection = |stamp| {
        let kind = LeadershipKind::PreVoteRejection.to_wire() as u16;
        Input::Heard(Leadership { stamp, ballot: ballot(1, 1), kind, hops: 0, group: N, epoch: 0, heir: DroneId::NONE })
    };
    drone.handle(at(1.0), 0, rejection(at(60.0)));
    assert!(!drone.has_leader(at(1.1)));
    drone.handle(at(1.0), 0, rejection(at(0.5)));
    assert!(drone.has_leader(at(1.5)) && !drone.has_leader(at(1.6)));
}

#[test]
fn heartbeats_and_plans_show_that_the_leader_lives() {
    let (mut leader, mut member) = (machine(1), machine(2));
    let (mut t, mut said) = claim(&mut leader, 0.0, 3);
    for _ in 0..20 {
        member.handle(at(t), 0, Input::Heard(said));
        (t, said) = until_said(&mut leader, t + 0.02, 3, LeadershipKind::Heartbeat);
        assert!(tick(&mut member, t, 0).is_none() && member.has_leader(at(t)));
    }
    for step in 1..10 {
        let now = t + f64::from(step) * 0.9;
        sign(&mut member, now, said.ballot, N, false);
        assert!(member.has_leader(at(now)));
    }
}

#[test]
fn a_leadership_transfer_takes_effect_at_once() {
    let (mut leader, mut heir, mut third) = (machine(1), machine(2), machine(3));
    let (t, said) = claim(&mut leader, 0.0, 0);
    heir.handle(at(t), 0, Input::Heard(said));
    third.handle(at(t), 0, Input::Heard(said));
    let transfer = leader.handle(at(t + 0.1), 0, Input::Transfer(DroneId(2))).expect("it leads");
    assert!(third.handle(at(t + 0.12), 0, Input::Heard(transfer)).is_none() && !third.leads());
    let next = heir.handle(at(t + 0.12), 0, Input::Heard(transfer)).expect("the heir claims");
    assert!(heir.leads() && leader.leads());
    leader.handle(at(t + 0.14), 0, Input::Heard(next));
    assert!(!leader.leads() && leader.obeyed() == heir.obeyed());
    assert!(heir.clone().handle(at(t + 0.2), 0, Input::Heard(transfer)).is_none(), "a repeated transfer has no effect");
}

#[test]
fn a_term_is_for_the_groups_in_its_scope() {
    let (one, two) = (N.child(1), N.child(2));
    let mut drone = machine(3);
    sign(&mut drone, 0.0, ballot(1, 0), N, false);
    drone.handle(at(0.1), 0, Input::Joined(one.child(1)));
    sign(&mut drone, 0.2, ballot(3, 7), two, false);
    assert_eq!(drone.obeyed(), ballot(1, 0));
    sign(&mut drone, 0.3, ballot(2, 4), one, false);
    assert_eq!((drone.obeyed(), drone.scope()), (ballot(2, 4), one));
    sign(&mut drone, 0.4, ballot(4, 7), two, true);
    assert_eq!((drone.obeyed(), drone.scope()), (ballot(4, 7), two), "an assignment that names the drone wins it over");
    sign(&mut drone, 0.5, ballot(5, 0), N, false);
    assert_eq!((drone.obeyed(), drone.scope()), (ballot(5, 0), N));
}

#[test]
fn a_leader_that_missed_the_split_steps_down_and_waits_to_be_taken_in() {
    let mut leader = machine(1);
    claim(&mut leader, 0.0, 0);
    sign(&mut leader, 0.5, ballot(4, 2), N.child(1), false);
    assert!(!leader.leads());
    // When it claims although it hears the leader of a part.
    let until_leads = |leader: &mut Election, from_s: f64| {
        let times_s = (0..100).map(|i| from_s + 0.2 * f64::from(i));
        times_s.into_iter().find(|&now_s| {
            sign(leader, now_s, ballot(4, 2), N.child(1), false);
            tick(leader, now_s, 0).is_some_and(|said| said.kind() == LeadershipKind::Claim)
        })
    };
    let mut alone = leader.clone();
    let waits_s = until_leads(&mut leader, 0.7).expect("it does not wait for ever");
    assert!(waits_s > PARTED_TIMEOUTS * PARAMS.leader_timeout_s && leader.obeyed().round > 4, "{waits_s}");
    let left_s = claim(&mut alone, 0.7, 0).0;
    assert!(left_s < 0.5 * waits_s, "without any other leader it claims sooner: {left_s}");
}

#[test]
fn the_greatest_round_does_not_panic_wrap_or_win() {
    let mut drone = machine(1);
    let top = Ballot { round: u32::MAX, incarnation: u32::MAX, claimant: DroneId(9) };
    sign(&mut drone, 0.0, top, N, true);
    assert!(!drone.obeyed().is_some() && claim(&mut drone, 0.0, 0).1.ballot == ballot(1, 1));
    // Nor do steps win: the highest round that is accepted is soon outbid.
    for step in 0..5000 {
        sign(&mut drone, 1.0, ballot(1 << (step % 32), 9), N, false);
    }
    assert!(drone.obeyed() == ballot(1024, 9) && claim(&mut drone, 1.0, 0).1.ballot == ballot(1025, 1));
    let mut high = Election { highest_round: u32::MAX, ..machine(1) };
    assert!((0..100).all(|i| tick(&mut high, 60.0 + f64::from(i), 0).is_none()));
}

#[test]
fn a_slow_link_gets_more_time_to_answer() {
    let mut drone = machine(1);
    sign(&mut drone, 0.0, ballot(1, 2), N, false);
    let slow = |now_s: f64, drone: &mut Election| drone.handle(at(now_s), 0, Input::Tick { closer: 1, delay_s: 1.0 });
    assert!(slow(0.4, &mut drone).is_none(), "not before half of the time-out");
    assert_eq!(slow(0.5, &mut drone).map(|said| said.kind()), Some(LeadershipKind::PreVote));
    assert!(slow(3.4, &mut drone).is_none(), "two delays for the answer, one for the claim of the other drone");
    assert_eq!(slow(3.5, &mut drone).map(|said| said.kind()), Some(LeadershipKind::Claim));
}

/// A heartbeat of this term that was passed on `hops` times.
fn heartbeat(stamp_s: f64, ballot: Ballot, hops: u16) -> Input {
    let kind = LeadershipKind::Heartbeat.to_wire() as u16;
    Input::Heard(Leadership { stamp: at(stamp_s), ballot, kind, hops, group: N, epoch: 0, heir: DroneId::NONE })
}

#[test]
fn a_repeated_heartbeat_is_no_sign_of_life_whenever_it_is_heard() {
    let mut drone = machine(1);
    let patience_s = |drone: &Election| drone.silence_s();
    drone.handle(at(5.0), 0, heartbeat(1.0, ballot(1, 0), 3));
    let alone_s = 5.0 + patience_s(&drone);
    for step in 1..40 {
        drone.handle(at(5.0 + 0.1 * f64::from(step)), 0, heartbeat(1.0, ballot(1, 0), 2));
        drone.handle(at(5.0 + 0.1 * f64::from(step)), 0, heartbeat(0.9, ballot(1, 0), 2));
    }
    assert!(drone.has_leader(at(alone_s - 0.001)) && !drone.has_leader(at(alone_s + 0.001)));
    // The next one is a sign, although the leader's clock is four seconds behind.
    drone.handle(at(9.0), 0, heartbeat(1.2, ballot(1, 0), 3));
    assert!(drone.has_leader(at(alone_s + 0.01)));
}

#[test]
fn a_pre_vote_is_rejected_by_what_is_newer_and_not_by_what_was_heard_later() {
    let (mut near, mut far) = (machine(1), machine(2));
    near.handle(at(1.1), 0, heartbeat(1.0, ballot(1, 0), 1));
    far.handle(at(3.0), 0, heartbeat(1.0, ballot(1, 0), 9));
    let (asked, pre_vote) = until_said(&mut near, 1.1, 0, LeadershipKind::PreVote);
    assert!(far.handle(at(asked), 0, Input::Heard(pre_vote)).is_none(), "it heard the same message later");
    far.handle(at(asked), 0, heartbeat(2.0, ballot(1, 0), 9));
    let rejection = far.handle(at(asked), 0, Input::Heard(pre_vote)).unwrap();
    near.handle(at(asked), 0, Input::Heard(rejection));
    // As if it had heard that message itself, 0.1 s after it was sent.
    let alone_s = 2.1 + near.silence_s();
    assert!(near.has_leader(at(alone_s - 0.001)) && !near.has_leader(at(alone_s + 0.001)));
}

#[test]
fn a_term_that_a_message_gives_to_another_group_is_no_sign_of_life() {
    let (mut drone, one) = (machine(3), N.child(1));
    drone.handle(at(0.0), 0, Input::Joined(one));
    // A forged message binds the drone to a term that its claimant has for another group.
    sign(&mut drone, 0.0, ballot(7, 0), one, true);
    let silent = drone.clone();
    (1..10).for_each(|step| sign(&mut drone, 0.1 * f64::from(step), ballot(7, 0), N.child(2), false));
    assert_eq!(drone, Election { disputed: true, ..silent });
    assert!(!drone.has_leader(at(0.1 + PARAMS.leader_timeout_s)));
    sign(&mut drone, 1.2, ballot(7, 0), one, false);
    assert!(drone.has_leader(at(1.2)));
}

#[test]
fn a_beacon_of_a_leader_is_no_sign_of_life_while_the_leader_names_another_group() {
    let (mut drone, one) = (machine(3), N.child(1));
    drone.handle(at(0.0), 0, Input::Joined(one));
    let (leader, two) = (ballot(7, 0), N.child(2));
    let beacon = |drone: &mut Election, now_s: f64| {
        let stamp = Some(at(now_s));
        drone.handle(at(now_s), 0, Input::Sign { ballot: leader, scope: None, named: false, stamp });
    };
    beacon(&mut drone, 0.0);
    assert!(!drone.obeyed().is_some(), "a beacon does not say which group its term is for");
    // A forged message gives the term to this drone's group, the leader's own one to another group.
    sign(&mut drone, 0.1, leader, one, false);
    beacon(&mut drone, 0.2);
    assert!(drone.has_leader(at(0.2 + PARAMS.leader_timeout_s)));
    sign(&mut drone, 0.3, leader, two, false);
    for step in 3..15 {
        beacon(&mut drone, 0.1 * f64::from(step));
    }
    assert!(!drone.has_leader(at(0.21 + PARAMS.leader_timeout_s)));
    // The leader's own word that it leads this drone's group settles it.
    sign(&mut drone, 1.5, leader, one, false);
    beacon(&mut drone, 1.6);
    assert!(drone.has_leader(at(1.6 + PARAMS.leader_timeout_s)));
}
