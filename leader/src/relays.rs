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
//! - An assignment is repeated while its drone does not obey it; first only by drones that are closer to that drone. Assignments
//!   that are due together share a frame.
//! - The states of drones are collected, so that a frame holds several.

use crate::beacons::Beacon;
use crate::beats::Beats;
use crate::knowledge::Knowledge;
use crate::news::News;
use crate::own_state::OwnState;
use crate::params::LeadingParams;
use crate::presences::Presences;
use crate::relay_pace::RelayPace;
use crate::relayed_facts::RelayedFacts;
use crate::tuning::{
    CLOCKS_S, COUNT_S, FORGET_S, MAX_RELAYED_PER_TICK, NEAR, OLDEST_S, REACHED, RELAY_MEMORY_S, SETTLED_S,
    STAYS_WIDE_S, UNSETTLED_S, WIDE_S,
};
use skein_protocol::payload::{Leadership, Pose};
use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, Message, MessageRef, SimTime, Vec2};

/// What one drone passes on. Memory is bounded by the size of the swarm.
#[derive(Clone, Debug)]
pub(crate) struct Relays {
    me: DroneId,
    drones: u32,
    /// Whether it passes anything on at all.
    used: bool,
    start: SimTime,
    /// Where this drone is, world frame, m.
    position: Vec2,
    /// Distance within which it hears most beacons, m.
    reach_m: f64,
    /// Distances of the drones that were heard last, m: kept for their memory only.
    distances_m: Vec<f64>,
    /// Since when some neighbour hears other drones than this one.
    differs: Option<SimTime>,
    /// When one last did.
    differed: SimTime,
    /// Whether this drone passes messages on.
    wide: bool,
    /// Whether some drone is close to this one.
    crowded: bool,
    /// Whether a neighbour obeys an earlier term than this drone.
    lags: bool,
    pace: RelayPace,
    beat_pace: RelayPace,
    /// Whether the greater half of what it may say next is for states.
    states_first: bool,
    beats: Beats,
    facts: RelayedFacts,
    /// When it next forgets what was not heard for long.
    forgets: SimTime,
    /// Distance within which drones share the bandwidth, m.
    carrier_sense_m: f64,
    /// When it next counts the drones that share the bandwidth with it.
    counts: SimTime,
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
            position: Vec2::zeros(),
            reach_m: 0.0,
            distances_m: Vec::new(),
            differs: None,
            differed: params.start,
            wide: false,
            crowded: false,
            lags: false,
            pace: RelayPace::of_facts(params),
            beat_pace: RelayPace::of_beats(params),
            states_first: false,
            beats: Beats::new(params),
            facts: RelayedFacts::new(params),
            forgets: params.start,
            carrier_sense_m: params.channel.carrier_sense_m,
            counts: params.start,
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

    /// Distance within which this drone hears others without a relay, m; `None` if all living drones hear each other.
    pub(crate) fn reach_m(&self) -> Option<f64> {
        self.wide.then_some(self.reach_m)
    }

    /// Whether a drone hears much the same drones as this one: it is close.
    pub(crate) fn is_near(&self, k: &Knowledge, other: DroneId) -> bool {
        k.peers().last(other).is_some_and(|pose| (pose.position() - self.position).norm() <= self.near_m())
    }

    /// Whether further drones may still become known, so that it is too early for a first claim.
    pub(crate) fn is_settling(&self, k: &Knowledge, now: SimTime) -> bool {
        let complete = k.peers().stamps().len() + 1 >= self.drones as usize;
        let news = now.since(self.presences.last_new()) < SETTLED_S;
        self.differs.is_some() && !complete && news && now.since(self.start) < UNSETTLED_S
    }

    /// Looks at its neighbours: does each of them hear the same drones as this one? `mine`: a hash of those, [`Pose::hears`]. Call with
    /// each beacon.
    pub(crate) fn look(&mut self, k: &Knowledge, now: SimTime, own: &OwnState, beacon_s: f64, mine: u32) {
        if !self.used {
            return;
        }
        self.position = own.position;
        let mut differs = false;
        let (term, scope) = (k.election().obeyed(), k.election().scope());
        self.lags = false;
        if k.peers().may_differ(term, scope) {
            for (_, pose) in k.peers().direct(now) {
                // A drone that hears nobody cannot be told anything, and one that hears all drones need not be.
                differs |= pose.hears() != 0 && pose.hears() != mine;
                self.lags |= pose.term() < term && scope.contains(pose.group());
            }
        }
        self.measure_reach(k, now, beacon_s);
        if differs {
            self.differed = now;
        }
        let stays = self.wide && now.since(self.differed) < STAYS_WIDE_S;
        self.differs = (differs || stays).then(|| self.differs.unwrap_or(now));
        let patience_s = WIDE_S.max(3.0 * beacon_s) + 2.0 * k.peers().delay_s();
        let first = !k.election().obeyed().is_some();
        self.wide = self.differs.is_some_and(|since| first || now.since(since) >= patience_s);
        self.presences.set_open(k, self.wide);
        if self.wide && self.carrier_sense_m.is_finite() && now >= self.counts {
            self.counts = now.after(COUNT_S);
            self.count_channel_drones(k, now);
        }
        self.beats.forget(now);
        if !self.wide {
            self.facts.clear();
        } else if now >= self.forgets {
            self.facts.forget(now);
            self.forgets = now.after(FORGET_S);
        }
    }

    /// Measures how far this drone hears: most of the drones whose last beacon it heard are not farther away. Now and then a beacon is
    /// heard from a drone that is several times as far away.
    fn measure_reach(&mut self, k: &Knowledge, now: SimTime, beacon_s: f64) {
        let away_m = |pose: Beacon<'_>| (pose.position() - self.position).norm();
        self.distances_m.clear();
        self.distances_m.extend(k.peers().heard_within(now, beacon_s).map(|(_, pose)| away_m(pose)));
        let last = (REACHED * self.distances_m.len() as f64).ceil() as usize;
        let Some(last) = last.checked_sub(1) else { return };
        let (_, reach_m, _) = self.distances_m.select_nth_unstable_by(last, f64::total_cmp);
        self.reach_m = *reach_m;
        self.crowded = self.distances_m.iter().any(|away_m| *away_m <= self.near_m());
    }

    /// A drone within this distance is heard by much the same drones as this one, m.
    fn near_m(&self) -> f64 {
        NEAR * self.reach_m
    }

    /// Counts the drones that share the bandwidth with this one, and sets its part accordingly.
    fn count_channel_drones(&mut self, k: &Knowledge, now: SimTime) {
        let square_m2 = self.carrier_sense_m * self.carrier_sense_m;
        let near =
            k.peers().living(now).filter(|(_, pose)| (pose.position() - self.position).norm_squared() <= square_m2);
        let drones = 1 + u32::try_from(near.count()).unwrap_or(u32::MAX - 1);
        self.pace.set_drones(drones);
        self.beat_pace.set_drones(drones);
    }

    /// Notes that a drone's state was heard: from itself, or passed on. `before`: what was known of it. `near`: what a drone close to this one
    /// passed on.
    pub(crate) fn hear_state(
        &mut self,
        k: &Knowledge,
        now: SimTime,
        drone: DroneId,
        before: Option<News>,
        near: Option<&Pose>,
    ) {
        let has_news = self.wide && k.peers().last(drone).map(News::of_last) != before;
        self.presences.hear(k, now, drone, has_news, near);
        if has_news {
            self.facts.wake(now, drone);
        }
    }

    /// Notes that a drone close to this one said the newest state of `drone`, which this drone knows.
    pub(crate) fn hear_newest(&mut self, now: SimTime, drone: DroneId, stamp: SimTime) {
        self.presences.hear_newest(now, drone, stamp);
    }

    /// Fetches what was said of a drone into the cache.
    #[inline]
    pub(crate) fn warm(&self, drone: DroneId) {
        self.presences.warm(drone);
    }

    /// Fetches what is kept of the subjects of a message into the cache.
    #[inline]
    pub(crate) fn warm_facts(&self, source: DroneId, message: MessageRef<'_>) {
        if self.wide {
            self.facts.warm(source, message);
        }
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

    /// The newest message of each group's leader, from itself or passed on, that was news within the last `within_s`.
    pub(crate) fn newest(&self, now: SimTime, within_s: f64) -> impl Iterator<Item = &Leadership> {
        self.beats.newest(now, within_s)
    }

    /// Whether this drone has heard of late that this term is for a part of the swarm.
    pub(crate) fn is_of_part(&self, now: SimTime, term: Ballot) -> bool {
        self.newest(now, RELAY_MEMORY_S).any(|l| l.ballot == term && l.group != GroupId::ALL)
    }

    /// Notes a message of a term. Returns whether it is news.
    fn hear_beat(&mut self, k: &Knowledge, now: SimTime, source: DroneId, message: &Leadership) -> bool {
        let near = self.is_near(k, source);
        self.beats.hear(now, message, near, self.crowded)
    }

    /// Notes a message of `source` that may have to be passed on. `near`: whether [`Self::is_near`] holds for the source.
    pub(crate) fn hear(&mut self, k: &Knowledge, now: SimTime, source: DroneId, near: bool, message: MessageRef<'_>) {
        if self.is_of_no_own_term(k, message) {
            return;
        }
        self.facts.hear(now, source, message, near);
    }

    /// Whether a message names this drone as the leader of a term that it has not led in this life. The message is from its last life, or
    /// it is invented. If this drone passed it on, other drones would take it for the word of a living leader.
    fn is_of_no_own_term(&self, k: &Knowledge, message: MessageRef<'_>) -> bool {
        let ballot = match message {
            MessageRef::Plan(plan) => plan.id.ballot,
            MessageRef::Assignment(part) => part.id.ballot,
            _ => return false,
        };
        ballot.claimant == self.me && ballot > k.election().obeyed()
    }

    /// Says what is due to be passed on.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, say: &mut Vec<Message>) {
        if !self.wide {
            return;
        }
        // The leaders' messages are few and come first.
        let beats = say.len();
        let frames = self.beat_pace.frames(now).min(MAX_RELAYED_PER_TICK);
        self.beats.speak(k, now, frames, self.lags, say);
        self.beat_pace.note(&say[beats..]);
        let first = say.len();
        let last = first + self.pace.frames(now).min((MAX_RELAYED_PER_TICK + beats).saturating_sub(first));
        // What is said until states show that it was obeyed must leave room for those states.
        self.states_first ^= last > first;
        let for_states = if self.states_first { (last - first).div_ceil(2) } else { (last - first) / 2 };
        self.presences.speak(k, now, for_states, say);
        self.facts.speak(k, now, self.position, last, say);
        self.pace.note(&say[first..]);
    }
}
