//! Leadership state machines, run as the pilot runs them, and the invariants between them. Shared by the tests of leadership.
#![allow(dead_code, reason = "each test uses only a part of this module")]
#![allow(clippy::unwrap_used, reason = "test helpers")]

pub(crate) mod air;

use skein_leader::channel_params::ChannelParams;
use skein_leader::election::ElectionParams;
use skein_leader::leading::Leading;
use skein_leader::own_state::OwnState;
use skein_leader::params::LeadingParams;
use skein_leader::params::{Between, Destination, PlannerParams, Strategy};
use skein_leader::routes::RouteParams;
use skein_leader::slots::Reformation;
use skein_protocol::digest::Digest;
use skein_protocol::formation::Shape;
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Ballot, DroneId, Message, ObstacleId, PlanStamp, SimTime, Vec2};
use std::collections::BTreeMap;

/// Nominal speed, m/s.
pub(crate) const SPEED_MPS: f64 = 10.0;

/// Periods and time-outs of a swarm, s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Periods {
    pub dt_s: f64,
    pub beacon_s: f64,
    pub heartbeat_s: f64,
    pub repeat_s: f64,
    pub wait_s: f64,
    pub leader_timeout_s: f64,
    pub peer_timeout_s: f64,
    pub debounce_s: f64,
}

/// The defaults of a scenario.
pub(crate) const DEFAULT: Periods = Periods {
    dt_s: 0.02,
    beacon_s: 0.1,
    heartbeat_s: 0.2,
    repeat_s: 0.2,
    wait_s: 0.2,
    leader_timeout_s: 1.0,
    peer_timeout_s: 1.5,
    debounce_s: 0.1,
};

/// Parameters of the state machine of drone `me`.
pub(crate) fn params(p: &Periods, drones: u32, me: u32, incarnation: u32, start: SimTime) -> LeadingParams {
    LeadingParams {
        me: DroneId(me),
        drones,
        incarnation,
        start,
        dt_s: p.dt_s,
        election: ElectionParams {
            heartbeat_period_s: p.heartbeat_s,
            leader_timeout_s: p.leader_timeout_s,
            wait_s: p.wait_s,
        },
        planner: PlannerParams {
            drones: 8,
            strategy: Strategy::PaperRule,
            speed_mps: SPEED_MPS,
            headway_s: 4.0,
            by_words: false,
            speed_on_sight_mps: f64::INFINITY,
            routes: RouteParams { clearance_m: 15.0, half_gap_m: 15.0, planning_distance_m: 20.0, scale: Scale::FULL },
            shape: Shape::V,
            spacing_m: 40.0,
            reformation: Reformation::Optimal,
            arrival_error_m: 2.0,
            safe_distance_m: 20.0,
            course_y_m: 0.0,
            destination: Destination::Hold { stop_x_m: f64::INFINITY },
            between: Between::CloseUp,
            radio_range_m: f64::INFINITY,
            debounce_s: p.debounce_s,
        },
        beacon_period_s: p.beacon_s,
        beacon_period_max_s: p.beacon_s,
        repeat_period_s: p.repeat_s,
        channel: ChannelParams::default(),
        peer_timeout_s: p.peer_timeout_s,
    }
}

/// A wall across the course line at `x_m`. A route leads past it on either side.
pub(crate) fn wall(id: u32, x_m: f64) -> (ObstacleId, ConvexShape) {
    let shape = ConvexShape::rectangle(Vec2::new(x_m, 0.0), Vec2::new(5.0, 50.0), 0.0).unwrap();
    (ObstacleId(id), shape)
}

/// One tick of a drone after it has received its messages, in the pilot's order. Adds the messages to send to `outgoing`.
pub(crate) fn step(leading: &mut Leading, now: SimTime, own: &OwnState, outgoing: &mut Vec<Message>) {
    leading.elect(now, own, outgoing);
    if leading.is_leader() {
        leading.refresh_members(now, own);
        let mut bundle = leading.decide(now, &[], outgoing);
        if !bundle.is_empty() {
            leading.adopt(now, bundle.swap_remove(0));
        }
    }
    leading.note_passed(own.position);
    leading.speak(now, own, &Default::default(), outgoing);
}

/// A violation of an invariant.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Breach {
    /// Two drones know or obey different plans or assignments with the same stamp (ballot, epoch).
    TwoPlans { drone: DroneId, of: DroneId, stamp: PlanStamp },
    /// The stamp or term that a drone obeys decreased within an incarnation.
    WentBack { drone: DroneId, from: (Ballot, PlanStamp), to: (Ballot, PlanStamp) },
    /// Two drones lead under the same ballot, or a drone leads under the ballot of another drone.
    TwoLeaders { drone: DroneId, other: DroneId, ballot: Ballot },
    /// A drone obeys a plan whose term is later than the drone's term.
    NotOfTheTerm { drone: DroneId, term: Ballot, stamp: PlanStamp },
}

/// Checks the invariants against all states seen so far.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Watch {
    /// Hash of each drone's part in each plan. The entry of [`DroneId::NONE`] is the hash of the plan itself.
    parts: BTreeMap<(PlanStamp, DroneId), u64>,
    /// The leader of each ballot.
    pub leaders: BTreeMap<Ballot, DroneId>,
    /// The last term and stamp that each incarnation of each drone obeyed.
    obeyed: BTreeMap<(DroneId, u32), (Ballot, PlanStamp)>,
}

impl Watch {
    /// Checks a drone, and remembers its state for later checks.
    pub(crate) fn see(&mut self, drone: DroneId, incarnation: u32, leading: &Leading) -> Result<(), Breach> {
        let (term, stamp) = (leading.term(), leading.stamp());
        let (from, to) = (self.obeyed.insert((drone, incarnation), (term, stamp)).unwrap_or_default(), (term, stamp));
        if from.0 > to.0 || from.1 > to.1 {
            return Err(Breach::WentBack { drone, from, to });
        }
        if leading.is_leader() {
            let first = *self.leaders.entry(term).or_insert(drone);
            if let Some(&other) = [first, term.claimant].iter().find(|&&other| other != drone) {
                return Err(Breach::TwoLeaders { drone, other, ballot: term });
            }
        }
        if stamp.ballot > term {
            return Err(Breach::NotOfTheTerm { drone, term, stamp });
        }
        let Some(bundle) = leading.obeyed() else { return Ok(()) };
        let plan = (DroneId::NONE, hash(bytemuck::bytes_of(&bundle.plan)));
        let parts = bundle.parts.iter().map(|part| (part.drone, hash(bytemuck::bytes_of(&part))));
        for (of, value) in std::iter::once(plan).chain(parts) {
            if *self.parts.entry((stamp, of)).or_insert(value) != value {
                return Err(Breach::TwoPlans { drone, of, stamp });
            }
        }
        Ok(())
    }
}

pub(crate) fn hash(bytes: &[u8]) -> u64 {
    let mut digest = Digest::default();
    digest.bytes(bytes);
    digest.value()
}

/// Checks drones that all hear each other. Each must obey the highest term for its group that one of them leads. Returns the
/// first violation.
pub(crate) fn discord(drones: &[(DroneId, &Leading)]) -> Option<String> {
    let leaders: Vec<_> = drones.iter().filter(|(_, l)| l.is_leader()).collect();
    for (id, leading) in drones {
        let group = leading.group();
        let mine = leaders.iter().filter(|(_, l)| l.scope().contains(group));
        let highest = mine.map(|(_, l)| l.term()).max();
        if highest != Some(leading.term()) {
            return Some(format!("{id} of {group} obeys {:?}, the highest is {highest:?}", leading.term()));
        }
    }
    None
}

/// Checks drones that all hear each other and have no obstacle ahead. One must lead, and all must obey one plan for all of
/// them. Returns the first violation.
pub(crate) fn disunion(drones: &[(DroneId, &Leading)]) -> Option<String> {
    if let Some(discord) = discord(drones) {
        return Some(discord);
    }
    let terms = |(id, l): &(DroneId, &Leading)| (*id, l.term(), l.scope(), l.stamp());
    let all: Vec<_> = drones.iter().map(terms).collect();
    let (_, ballot, _, stamp) = *all.first()?;
    let one = all.iter().all(|(_, other, _, plan)| (*other, *plan) == (ballot, stamp));
    let members = drones[0].1.obeyed().map_or(0, |bundle| bundle.plan.members as usize);
    (!one || members != drones.len() || stamp.ballot != ballot)
        .then(|| format!("{} drones, a plan for {members}, terms {all:?}", drones.len()))
}
