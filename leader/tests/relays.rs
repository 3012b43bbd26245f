//! Tests of what one drone of a large swarm passes on.
#![allow(clippy::unwrap_used, reason = "test helpers")]

mod swarm;

use bytemuck::Zeroable;
use skein_leader::channel_params::ChannelParams;
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_leader::params::LeadingParams;
use skein_protocol::payload::{Assignment, Leadership, MAX_LISTED, MAX_PRESENT, Plan, Pose, Presence, Present};
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, Message, PlanStamp, SimTime, Vec2};
use std::collections::{BTreeMap, BTreeSet};
use swarm::{DEFAULT, params, step};

const DRONES: u32 = 600;
const TERM: Ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };
const PLAN: PlanStamp = PlanStamp { ballot: TERM, epoch: 1 };

/// What drone 1 says. It hears the leader 0 and drone 2 only; drone 2 hears all others, none of which obeys the plan yet.
struct Middle {
    leading: Leading,
    tick: u64,
    /// What its two neighbours say of the drones that they hear.
    hears: [u32; 2],
}

impl Middle {
    fn new() -> Self {
        Self::over(ChannelParams::default())
    }

    fn over(channel: ChannelParams) -> Self {
        let params = LeadingParams { channel, ..params(&DEFAULT, DRONES, 1, 1, SimTime::ZERO) };
        Self { leading: Leading::new(&params), tick: 0, hears: [17, 18] }
    }

    fn now(&self) -> SimTime {
        SimTime::from_secs(0.02 * self.tick as f64)
    }

    fn hear(&mut self, source: u32, message: Message) {
        let now = self.now();
        self.leading.hear(now, DroneId(source), &message, &mut Vec::new());
    }

    /// Hears that these drones obey a plan.
    fn hear_of(&mut self, drones: impl Iterator<Item = u32>, obeyed: PlanStamp) {
        self.hear_of_lives(drones, obeyed, 1);
    }

    /// Hears that these drones, in this incarnation, obey a plan.
    fn hear_of_lives(&mut self, drones: impl Iterator<Item = u32>, obeyed: PlanStamp, incarnation: u32) {
        let stamp = self.now();
        for drones in drones.collect::<Vec<_>>().chunks(MAX_PRESENT) {
            let mut presence = Presence { obeyed, group: GroupId::ALL, term: TERM, ..Presence::default() };
            presence.count = drones.len() as u32;
            for (entry, &drone) in presence.drones.iter_mut().zip(drones) {
                let position_m = [-40.0 * drone as f32, 0.0, 50.0];
                *entry = Present { stamp, drone: DroneId(drone), incarnation, position_m, ..Present::zeroed() };
            }
            self.hear(2, Message::Presence(presence));
        }
    }

    /// Hears an assignment of each drone.
    fn hear_assignments(&mut self) {
        self.hear_assignments_of(0, PLAN);
    }

    /// Hears from `source` an assignment of each drone in this plan.
    fn hear_assignments_of(&mut self, source: u32, id: PlanStamp) {
        for drone in 2..DRONES {
            let (scope, group) = (GroupId::ALL, GroupId::ALL);
            let part = Assignment { id, scope, group, drone: DroneId(drone), leader: DroneId(0), ..Zeroable::zeroed() };
            self.hear(source, Message::Assignment(part));
        }
    }

    /// The drones whose assignments it says within this many ticks.
    fn passes_on(&mut self, ticks: u32) -> BTreeSet<u32> {
        let said = (0..ticks).flat_map(|_| self.step());
        let listed = |message| if let Message::AssignmentList(list) = message { Some(list) } else { None };
        said.filter_map(listed)
            .flat_map(|list| list.assignments().map(|part| part.drone.0).collect::<Vec<_>>())
            .collect()
    }

    /// One tick, in which both neighbours are heard. Returns what the drone says.
    fn step(&mut self) -> Vec<Message> {
        self.tick += 1;
        let stamp = self.now();
        for (source, hears) in [0, 2].into_iter().zip(self.hears) {
            let position_m = [-40.0 * f64::from(source), 0.0, 50.0];
            let common = Pose { stamp, position_m, group: GroupId::ALL, term: TERM, incarnation: 1, ..Pose::zeroed() };
            self.hear(source, Message::Pose(Pose { hears, obeyed: PLAN, ..common }));
        }
        let (kind, ballot, group) = (LeadershipKind::Claim as u16, TERM, GroupId::ALL);
        self.hear(0, Message::Leadership(Leadership { stamp, ballot, group, kind, ..Leadership::zeroed() }));
        let position = Vec2::new(-40.0, 0.0);
        let own = OwnState { tick: self.tick, position, velocity: Vec2::zeros(), altitude_m: 50.0, climb_mps: 0.0 };
        let mut said = Vec::new();
        step(&mut self.leading, stamp, &own, &mut said);
        said
    }
}

/// A drone with 598 assignments to pass on says each of them before it says one of them often, and it passes news of a drone on
/// at once.
#[test]
fn many_assignments_starve_neither_each_other_nor_the_states_of_drones() {
    let mut middle = Middle::new();
    for _ in 0..60 {
        middle.step();
    }
    middle.hear_of(3..DRONES, PlanStamp::default());
    // Until the states are passed on.
    for _ in 0..300 {
        middle.step();
    }
    middle.hear_assignments();
    let mut parts: BTreeMap<u32, u32> = BTreeMap::new();
    let (mut news_after, mut lists) = (None, Vec::new());
    for tick in 0..400 {
        if tick == 25 {
            middle.hear_of(500..501, PLAN);
        }
        for message in middle.step() {
            match message {
                Message::AssignmentList(list) => {
                    list.assignments().for_each(|part| *parts.entry(part.drone.0).or_default() += 1);
                    lists.push(list.count);
                }
                Message::Presence(presence) if tick >= 25 && presence.obeyed == PLAN => {
                    let is_news = presence.poses().any(|(drone, _)| drone == DroneId(500));
                    news_after = news_after.or(is_news.then_some(tick - 25));
                }
                _ => {}
            }
        }
    }
    let late = (3..DRONES).filter(|drone| *drone != 500);
    let (least, most) =
        late.map(|drone| parts.get(&drone).copied().unwrap_or(0)).fold((u32::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
    assert!(news_after.is_some_and(|ticks| ticks <= 20), "news after {news_after:?} ticks");
    let full = lists.iter().filter(|count| **count as usize == MAX_LISTED).count();
    assert!(2 * full > lists.len(), "{full} of {} lists are full", lists.len());
    assert!(least >= 1 && most <= 2 * least + 1, "assignments were passed on {least} to {most} times");
}

/// Assignments that were obeyed are not looked at again, unless what their drone obeys changes.
#[test]
fn a_drone_that_was_restarted_gets_its_assignment_again() {
    let mut middle = Middle::new();
    for _ in 0..60 {
        middle.step();
    }
    middle.hear_of(3..DRONES, PlanStamp::default());
    middle.hear_assignments();
    let said = middle.passes_on(300);
    let restarted = *said.iter().nth(500).expect("more than 500 assignments were passed on");
    middle.hear_of(3..DRONES, PLAN);
    middle.passes_on(100);
    assert!(middle.passes_on(100).is_empty(), "all drones obey the plan");
    middle.hear_of_lives(restarted..restarted + 1, PlanStamp::default(), 2);
    assert_eq!(middle.passes_on(100), BTreeSet::from([restarted]));
}

/// Assignments that all drones obeyed before this drone had its turn are never said, unless their drones fall silent: others may take those for
/// members of no part.
#[test]
fn an_assignment_that_was_never_said_is_said_once_if_its_drone_falls_silent() {
    let mut middle = Middle::new();
    let seconds = |middle: &mut Middle, count: u32, silent: std::ops::Range<u32>| {
        let second = |_| {
            middle.hear_of((3..DRONES).filter(|drone| !silent.contains(drone)), PLAN);
            middle.passes_on(50)
        };
        (0..count).flat_map(second).collect::<Vec<_>>()
    };
    seconds(&mut middle, 100, 0..0);
    middle.hear_assignments();
    assert_eq!(seconds(&mut middle, 5, 0..0), []);
    assert_eq!(seconds(&mut middle, 24, 40..43), [40, 41, 42]);
}

/// Other drones would take it for a sign that this drone leads that term. The term is from its last life, or it is invented.
#[test]
fn a_drone_passes_nothing_on_of_a_term_that_it_would_lead_but_never_claimed() {
    let heard_of = |claimant: u32| {
        let mut middle = Middle::new();
        (0..60).for_each(|_| drop(middle.step()));
        middle.hear_of(3..DRONES, PlanStamp::default());
        (middle, PlanStamp { ballot: Ballot { round: 7, incarnation: 1, claimant: DroneId(claimant) }, epoch: 1 })
    };
    let assignments_of = |claimant: u32| {
        let (mut middle, id) = heard_of(claimant);
        middle.hear_assignments_of(2, id);
        middle.passes_on(300).len()
    };
    let plans_of = |claimant: u32| {
        let (mut middle, id) = heard_of(claimant);
        let stamp = middle.now();
        middle.hear(2, Message::Plan(Plan { id, stamp, members: DRONES, ..Zeroable::zeroed() }));
        let said = (0..300).flat_map(|_| middle.step());
        said.filter(|message| matches!(message, Message::Plan(plan) if plan.id == id)).count()
    };
    assert!(assignments_of(5) > 0 && plans_of(5) > 0);
    assert_eq!((assignments_of(1), plans_of(1)), (0, 0));
}

/// Drone 1, which heard from drone 2 that `claimant` leads the first part of a split, and then learnt that it is in that part.
fn told_of_a_part_led_by(claimant: u32) -> Middle {
    let mut middle = Middle::new();
    for _ in 0..60 {
        middle.step();
    }
    let (part, ballot) = (GroupId::ALL.child(1), Ballot { round: 2, incarnation: 1, claimant: DroneId(claimant) });
    let (kind, stamp) = (LeadershipKind::Heartbeat as u16, middle.now());
    middle.hear(2, Message::Leadership(Leadership { stamp, ballot, kind, hops: 3, group: part, ..Zeroable::zeroed() }));
    middle.step();
    assert_eq!(middle.leading.term(), TERM, "it does not know yet that it belongs to that part");
    let (id, leader) = (PlanStamp { ballot: TERM, epoch: 2 }, DroneId(5));
    middle.hear(0, Message::Plan(Plan { id, stamp, members: DRONES, ..Zeroable::zeroed() }));
    let drone = DroneId(1);
    middle.hear(0, Message::Assignment(Assignment { id, group: part, drone, leader, ..Zeroable::zeroed() }));
    middle.step();
    assert_eq!(middle.leading.group(), part);
    middle
}

/// The heartbeats of a part's leader travel faster than the assignments that make the part.
#[test]
fn a_drone_that_learns_its_part_obeys_the_leader_that_it_has_heard_of() {
    assert_eq!(told_of_a_part_led_by(5).leading.term().claimant, DroneId(5));
}

/// What others say about a drone that this drone hears itself does not count.
#[test]
fn a_drone_that_learns_its_part_does_not_believe_others_about_a_leader_that_it_hears() {
    assert_eq!(told_of_a_part_led_by(0).leading.term(), TERM);
}

/// A state that is newer by a period than the last one that was said goes on at once, not at the end of a period. What others said in
/// between is not repeated.
#[test]
fn states_travel_on_at_once() {
    let mut middle = Middle::new();
    for _ in 0..60 {
        middle.step();
    }
    let mut delays = Vec::new();
    for _ in 0..20 {
        middle.hear_of(500..501, PLAN);
        let heard = middle.now();
        let mut said = None;
        for _ in 0..350 {
            let is_said = middle.step().iter().any(|message| match message {
                Message::Presence(presence) => {
                    presence.present().iter().any(|p| p.drone == DroneId(500) && p.stamp == heard)
                }
                _ => false,
            });
            said = said.or(is_said.then(|| middle.now().since(heard)));
        }
        delays.extend(said);
    }
    assert!(delays.len() >= 18, "{delays:?}");
    let most_s = delays.iter().copied().fold(0.0, f64::max);
    assert!(most_s < 0.65, "{delays:?}");
}

/// Drones that obey the newest plan do not wait for word of all that still obey an older one.
#[test]
fn word_of_a_new_plan_does_not_wait_for_all_others() {
    // Some five frames per second, for 598 states.
    let mut middle = Middle::over(ChannelParams { bandwidth_bytes_per_s: 3_000.0, ..ChannelParams::default() });
    for _ in 0..60 {
        middle.step();
    }
    for _ in 0..30 {
        middle.hear_of(3..DRONES, PlanStamp::default());
        (0..50).for_each(|_| drop(middle.step()));
    }
    middle.hear_of(500..501, PLAN);
    let is_news = |message: &Message| match message {
        Message::Presence(presence) => presence.obeyed == PLAN && presence.present()[0].drone == DroneId(500),
        _ => false,
    };
    let ticks = (0..500).position(|_| middle.step().iter().any(is_news));
    assert!(ticks.is_some_and(|ticks| ticks < 100), "{ticks:?} ticks");
}

/// A beacon that comes from far away by chance does not make the drones on the way there close ones.
#[test]
fn a_drone_that_is_heard_by_chance_does_not_count_for_the_range() {
    let mut middle = Middle::new();
    for tick in 0..400 {
        middle.step();
        let stamp = middle.now();
        let heard = (3..11).map(|drone| (drone, -40.0 - 30.0 * (f64::from(drone) - 7.0)));
        let by_chance = (tick % 5 == 0).then_some((11 + tick % 40, -1500.0));
        for (source, x) in heard.chain(by_chance) {
            let common = Pose { stamp, position_m: [x, 0.0, 50.0], group: GroupId::ALL, term: TERM, ..Pose::zeroed() };
            middle.hear(source, Message::Pose(Pose { hears: source, incarnation: 1, obeyed: PLAN, ..common }));
        }
    }
    let reach_m = middle.leading.reach_m().unwrap();
    assert!((60.0..=120.0).contains(&reach_m), "{reach_m}");
}

#[test]
fn a_drone_passes_messages_on_while_its_neighbours_agree_for_a_moment() {
    let mut middle = Middle::new();
    let mut passes_on = |hears, ticks| {
        middle.hears = hears;
        for _ in 0..ticks {
            middle.step();
        }
        middle.leading.reach_m().is_some()
    };
    assert!(passes_on([17, 18], 60));
    assert!(passes_on([0, 0], 100), "they agree for 2 s");
    assert!(!passes_on([0, 0], 100), "they agree for 4 s");
    assert!(!passes_on([17, 18], 10), "it begins after a while");
}
