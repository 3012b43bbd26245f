//! What a drone passes on of what it has heard, for drones that are out of reach of the source.
//!
//! A beacon says which drones its source hears. While all neighbours of a drone hear the same drones as it does, everybody
//! hears everybody, and it passes nothing on. Otherwise it passes on the newest version of each message after a while,
//! unless it heard a drone close to it say the same: the Trickle algorithm, as in [`crate::gossip`], and the distance rule of
//! Ni, Tseng, Chen and Sheu, *The Broadcast Storm Problem in a Mobile Ad Hoc Network*, 1999.
//!
//! - The newest message of a term is repeated until the next one comes: see [`crate::beats`].
//! - Arrivals and passages are passed on once by each drone.
//! - A plan is repeated while a neighbour does not obey it.
//! - An assignment is repeated while its drone does not obey it; first only by drones that are closer to that drone.
//! - The states of drones are collected, so that a frame holds several.

use crate::beats::Beats;
use crate::gossip::Gossip;
use crate::knowledge::Knowledge;
use crate::own_state::OwnState;
use crate::params::LeadingParams;
use crate::presences::Presences;
use crate::tuning::{
    CLOCKS_S, DETOUR_DOUBLINGS, MAX_RELAYED_PER_TICK, NEAR, OLDEST_S, RELAY_MEMORY_S, SETTLED_S, UNSETTLED_S, WIDE_S,
};
use skein_protocol::payload::{Leadership, Plan, Pose};
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, Message, SimTime, Vec2};
use std::collections::BTreeMap;

/// What a message is about. Of the messages about the same, only the newest is passed on. In the order of urgency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Subject {
    /// The plan for this group.
    Plan(GroupId),
    /// The assignment of this drone in a plan for this group.
    Part(GroupId, DroneId),
    /// The arrivals of this drone, of this kind.
    Arrivals(u32, DroneId),
    /// What this drone has passed.
    Passed(DroneId),
}

/// Which of two messages about the same subject is newer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Version {
    ballot: Ballot,
    epoch: u32,
    stamp: SimTime,
}

/// A message that may be passed on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Relayed {
    message: Message,
    version: Version,
    /// The drone it was first heard from.
    from: DroneId,
    /// When it was last heard.
    heard: SimTime,
    gossip: Gossip,
}

/// What one drone passes on. Memory is bounded by the size of the swarm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Relays {
    me: DroneId,
    drones: u32,
    /// Whether it passes anything on at all.
    used: bool,
    start: SimTime,
    repeat_s: f64,
    /// Where this drone is, world frame, m.
    position: Vec2,
    /// A drone within this distance is heard by much the same drones as this one, m.
    near_m: f64,
    /// Since when some neighbour hears other drones than this one.
    differs: Option<SimTime>,
    /// Whether this drone passes messages on.
    wide: bool,
    /// Whether some drone is close to this one.
    crowded: bool,
    /// Whether a neighbour obeys an earlier term than this drone.
    lags: bool,
    beats: Beats,
    relayed: BTreeMap<Subject, Relayed>,
    presences: Presences,
}

impl Relays {
    /// Nothing heard.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        Self {
            me: params.me,
            drones: params.drones,
            used: true,
            start: params.start,
            repeat_s: params.repeat_period_s,
            position: Vec2::zeros(),
            near_m: 0.0,
            differs: None,
            wide: false,
            crowded: false,
            lags: false,
            beats: Beats::new(params),
            relayed: BTreeMap::new(),
            presences: Presences::new(params),
        }
    }

    /// Those of a drone in a rollout, where all drones hear each other: it passes nothing on.
    pub(crate) fn unused(params: &LeadingParams) -> Self {
        Self { used: false, ..Self::new(params) }
    }

    /// Whether some living drones do not hear each other, as far as this drone knows.
    pub(crate) fn is_wide(&self) -> bool {
        self.wide
    }

    /// Whether a drone hears much the same drones as this one: it is close.
    pub(crate) fn is_near(&self, k: &Knowledge, other: DroneId) -> bool {
        k.peers().last(other).is_some_and(|pose| (pose.position() - self.position).norm() <= self.near_m)
    }

    /// Whether further drones may still become known, so that it is too early for a first claim.
    pub(crate) fn is_settling(&self, k: &Knowledge, now: SimTime) -> bool {
        let complete = k.peers().stamps().len() + 1 >= self.drones as usize;
        let news = now.since(self.presences.last_new()) < SETTLED_S;
        self.differs.is_some() && !complete && news && now.since(self.start) < UNSETTLED_S
    }

    /// Looks at its neighbours: does each of them hear the same drones as this one? Call with each beacon.
    pub(crate) fn look(&mut self, k: &Knowledge, now: SimTime, own: &OwnState, beacon_s: f64) {
        if !self.used {
            return;
        }
        self.position = own.position;
        let (mine, mut differs) = (k.peers().hears(self.me, now), false);
        let (mut near_m, mut far_m) = (f64::INFINITY, 0.0_f64);
        let (term, scope) = (k.election().obeyed(), k.election().scope());
        self.lags = false;
        for (_, pose) in k.peers().direct(now) {
            let away_m = (pose.position() - own.position).norm();
            (near_m, far_m) = (near_m.min(away_m), far_m.max(away_m));
            // A drone that hears nobody cannot be told anything, and one that hears all drones need not be.
            differs |= pose.hears != 0 && pose.hears != mine;
            self.lags |= pose.term < term && scope.contains(pose.group);
        }
        self.near_m = NEAR * far_m;
        self.crowded = near_m <= self.near_m;
        self.differs = differs.then(|| self.differs.unwrap_or(now));
        let patience_s = WIDE_S.max(3.0 * beacon_s) + 2.0 * k.peers().delay_s();
        let first = !k.election().obeyed().is_some();
        self.wide = self.differs.is_some_and(|since| first || now.since(since) >= patience_s);
        self.beats.forget(now);
        if self.wide {
            self.relayed.retain(|_, one| now.since(one.heard) < RELAY_MEMORY_S);
        } else {
            self.relayed.clear();
        }
    }

    /// Notes that a drone's state was heard: from itself, or in a message of `relay`.
    pub(crate) fn hear_state(&mut self, k: &Knowledge, now: SimTime, drone: DroneId, relay: Option<(DroneId, &Pose)>) {
        let near = relay.filter(|(relay, _)| self.is_near(k, *relay)).map(|(_, pose)| pose);
        self.presences.hear(k, now, drone, near);
    }

    /// Notes a message about leadership that `source` said. Returns whether it is to be obeyed: it comes from the leader
    /// itself; or, if this drone does not hear that one, it is newer than what this drone knows.
    pub(crate) fn admits(&mut self, k: &Knowledge, now: SimTime, source: DroneId, message: &Leadership) -> bool {
        if matches!(message.kind(), LeadershipKind::PreVote | LeadershipKind::PreVoteRejection) {
            return true;
        }
        let claimant = message.ballot.claimant;
        if claimant == source {
            if self.wide {
                self.hear_beat(k, now, source, message);
            }
            return true;
        }
        let strange = claimant == self.me || claimant.0 >= self.drones;
        let age_s = now.since(message.stamp);
        let passed_on = (1..=self.drones).contains(&message.hops.into()) && (-CLOCKS_S..OLDEST_S).contains(&age_s);
        if strange || !passed_on {
            return false;
        }
        self.hear_beat(k, now, source, message) && !k.peers().is_heard_now(claimant, now)
    }

    /// Whether this drone had news of this term's leader, from itself or passed on, within the last `within_s`.
    pub(crate) fn knows_term(&self, now: SimTime, ballot: Ballot, within_s: f64) -> bool {
        self.beats.knows(now, ballot, within_s)
    }

    /// Notes a message of a term. Returns whether it is news.
    fn hear_beat(&mut self, k: &Knowledge, now: SimTime, source: DroneId, message: &Leadership) -> bool {
        let near = self.is_near(k, source);
        self.beats.hear(now, message, near, self.crowded)
    }

    /// Notes a message of `source` that may have to be passed on. Returns whether it is new.
    pub(crate) fn hear(&mut self, k: &Knowledge, now: SimTime, source: DroneId, message: &Message) -> bool {
        let Some((subject, version)) = subject(source, message) else { return false };
        let near = self.is_near(k, source);
        let known = self.relayed.get_mut(&subject);
        if let Some(one) = known.filter(|one| one.version >= version || is_same_passage(&one.message, message)) {
            if one.version == version {
                one.heard = now;
                if near {
                    one.gossip.hear();
                }
            }
            return false;
        }
        let room = self.relayed.len() < 8 * self.drones as usize + 64;
        if room || self.relayed.contains_key(&subject) {
            let gossip = Gossip::varying(now, self.repeat_s, self.me);
            self.relayed.insert(subject, Relayed { message: *message, version, from: source, heard: now, gossip });
        }
        true
    }

    /// Says what is due to be passed on.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, say: &mut Vec<Message>) {
        if !self.wide {
            return;
        }
        let last = say.len() + MAX_RELAYED_PER_TICK;
        let position = self.position;
        self.beats.speak(k, now, MAX_RELAYED_PER_TICK, self.lags, say);
        for (subject, one) in &mut self.relayed {
            if say.len() >= last {
                return;
            }
            if is_wanted(k, now, *subject, one) && one.gossip.is_due(now) && is_on_the_way(k, position, one) {
                say.push(passed_on(one.message, one.from));
            }
        }
        self.presences.speak(k, now, last.saturating_sub(say.len()), say);
    }
}

/// What a message is about, and its version; `None` if it is not passed on.
fn subject(source: DroneId, message: &Message) -> Option<(Subject, Version)> {
    let at = |stamp| Version { stamp, ..Version::default() };
    Some(match message {
        Message::Plan(plan) => {
            let version = Version { ballot: plan.id.ballot, epoch: plan.id.epoch, ..Version::default() };
            (Subject::Plan(plan.group), version)
        }
        Message::Assignment(part) => {
            let version = Version { ballot: part.id.ballot, epoch: part.id.epoch, ..Version::default() };
            (Subject::Part(part.scope, part.drone), version)
        }
        Message::Arrivals(row) => (Subject::Arrivals(row.kind, row.drone), at(row.stamp)),
        Message::Passed(passed) => (Subject::Passed(passed.drone(source)), at(passed.stamp)),
        _ => return None,
    })
}

/// Whether both messages report that a drone has passed the same obstacles.
fn is_same_passage(known: &Message, heard: &Message) -> bool {
    matches!((known, heard), (Message::Passed(a), Message::Passed(b)) if a.set_count == b.set_count && a.set == b.set)
}

/// Whether some drone may still need the message.
fn is_wanted(k: &Knowledge, now: SimTime, subject: Subject, one: &Relayed) -> bool {
    match (subject, &one.message) {
        (Subject::Plan(scope), Message::Plan(plan)) => is_plan_wanted(k, now, scope, plan),
        (Subject::Part(..), Message::Assignment(part)) => {
            let Some(pose) = k.peers().last_of_living(part.drone, now) else { return one.gossip.is_first() };
            is_late(pose, part.id.ballot, part.id.epoch)
        }
        _ => one.gossip.is_first(),
    }
}

/// Whether this drone, which is at `position`, is closer to the drone that a message is for than the one it heard it from. In the end
/// the message is passed on in all directions.
fn is_on_the_way(k: &Knowledge, position: Vec2, one: &Relayed) -> bool {
    let Message::Assignment(part) = &one.message else { return true };
    let Some(pose) = k.peers().last(part.drone) else { return true };
    let away_m = |from: Vec2| (from - pose.position()).norm();
    let closer = || k.peers().last(one.from).is_none_or(|from| away_m(position) < away_m(from.position()));
    one.gossip.doublings() >= DETOUR_DOUBLINGS || closer()
}

/// Whether a neighbour of the plan's group does not obey it yet.
fn is_plan_wanted(k: &Knowledge, now: SimTime, scope: GroupId, plan: &Plan) -> bool {
    let late = |pose: &Pose| scope.contains(pose.group) && is_late(pose, plan.id.ballot, plan.id.epoch);
    k.peers().direct(now).any(|(_, pose)| late(pose))
}

/// Whether a drone has not obeyed a plan yet, and will.
fn is_late(pose: &Pose, ballot: Ballot, epoch: u32) -> bool {
    (pose.obeyed.ballot, pose.obeyed.epoch) < (ballot, epoch) && pose.term <= ballot
}

/// The message as it is passed on.
fn passed_on(mut message: Message, from: DroneId) -> Message {
    if let Message::Passed(passed) = &mut message {
        passed.of = passed.drone(from).0.saturating_add(1);
    }
    message
}
