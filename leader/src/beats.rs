//! The newest message of each term's leader, and when this drone passes it on.
//!
//! The leader's own time stamps number its messages: a message counts as news only if its stamp is greater than that of every
//! message of the term that was heard before. What others repeat is never news twice, so that no echo keeps a dead leader alive.
//! The stamps are compared with each other only, and never with the clock of this drone.
//!
//! News is passed on at once, or after a short wait if a close drone may say it first. If the next message is overdue, the
//! newest one is repeated until the leader is missed.

use crate::knowledge::Knowledge;
use crate::params::LeadingParams;
use crate::tuning::{BEAT_OVERDUE, BEAT_REPEAT, FOREIGN_BEATS, HOP_S, NEAR_REDUNDANCY, RELAY_MEMORY_S};
use skein_protocol::digest::Digest;
use skein_protocol::payload::Leadership;
use skein_protocol::{DroneId, GroupId, Message, SimTime};
use std::collections::BTreeMap;

/// The newest message of a term.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Beat {
    message: Leadership,
    /// When it was first heard.
    since: SimTime,
    /// How often a close drone said it since this drone's last turn.
    copies: u32,
    /// Whether this drone has had a turn.
    over: bool,
    /// This drone's next turn.
    turn: SimTime,
}

/// The newest message of the newest term of each group. Memory is bounded by the number of groups.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Beats {
    me: DroneId,
    period_s: f64,
    room: usize,
    beats: BTreeMap<GroupId, Beat>,
}

impl Beats {
    /// Nothing heard.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let period_s = params.election.heartbeat_period_s;
        Self { me: params.me, period_s, room: 2 * params.drones as usize + 16, beats: BTreeMap::new() }
    }

    /// Notes a message. `near`: it was said by a drone close to this one. `crowded`: some drone is close to this one. Returns
    /// whether it is news.
    pub(crate) fn hear(&mut self, now: SimTime, message: &Leadership, near: bool, crowded: bool) -> bool {
        let version = |l: &Leadership| (l.ballot, l.stamp);
        let known = self.beats.get_mut(&message.group);
        if let Some(beat) = known.filter(|beat| version(&beat.message) >= version(message)) {
            beat.copies += u32::from(near && version(&beat.message) == version(message));
            return false;
        }
        if self.beats.len() < self.room || self.beats.contains_key(&message.group) {
            let wait_s = if crowded { HOP_S * (0.5 + 0.5 * self.draw(now)) } else { 0.0 };
            let beat = Beat { message: *message, since: now, copies: 0, over: false, turn: now.after(wait_s) };
            self.beats.insert(message.group, beat);
        }
        true
    }

    /// The newest message of each group's leader that was news within the last `within_s`.
    pub(crate) fn newest(&self, now: SimTime, within_s: f64) -> impl Iterator<Item = &Leadership> {
        let recent = self.beats.values().filter(move |beat| now.since(beat.since) <= within_s);
        recent.map(|beat| &beat.message)
    }

    /// Forgets what was news long ago.
    pub(crate) fn forget(&mut self, now: SimTime) {
        self.beats.retain(|_, beat| now.since(beat.since) < RELAY_MEMORY_S);
    }

    /// Says at most `frames` of what is due. `lags`: whether a neighbour obeys an earlier term.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, frames: usize, lags: bool, say: &mut Vec<Message>) {
        let (draw, period_s, last) = (self.draw(now), self.period_s, say.len() + frames);
        for beat in self.beats.values_mut() {
            if now < beat.turn || say.len() >= last {
                continue;
            }
            if beat.copies < NEAR_REDUNDANCY && (!beat.over || beat.is_wanted(k, now, period_s)) {
                let hops = beat.message.hops.saturating_add(1);
                say.push(Message::Leadership(Leadership { hops, ..beat.message }));
            }
            let wait_s = match beat.over {
                _ if lags && beat.message.ballot == k.election().obeyed() => HOP_S,
                false => BEAT_OVERDUE * period_s,
                true => BEAT_REPEAT * period_s,
            };
            beat.turn = now.after(wait_s * (1.0 + 0.25 * draw));
            (beat.over, beat.copies) = (true, 0);
        }
    }

    /// A number from 0 to 1 that differs between drones and between ticks.
    fn draw(&self, now: SimTime) -> f64 {
        (Digest::chain(u64::from(self.me.0), now.0 as u64) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

impl Beat {
    /// Whether the message is worth repeating: this drone follows its leader, or it may be the way to drones that do.
    fn is_wanted(&self, k: &Knowledge, now: SimTime, period_s: f64) -> bool {
        let (ballot, obeyed) = (self.message.ballot, k.election().obeyed());
        let is_over = ballot < obeyed && self.message.group == k.election().scope();
        let foreign = !is_over && now.since(self.since) <= FOREIGN_BEATS * period_s;
        foreign || (ballot == obeyed && k.election().has_leader(now))
    }
}
