//! The states of drones that a drone passes on, several in a frame. See [`crate::relays`].

use crate::knowledge::Knowledge;
use crate::news::News;
use crate::params::LeadingParams;
use crate::tuning::{
    BACKLOG, LONGEST_TURN, MAX_THINNING, NEWS_TIMES, PRESENCE_OVERDUE, THICKEN, THIN, WAITS_PER_PERIOD,
};
use skein_protocol::digest::Digest;
use skein_protocol::payload::{MAX_PRESENT, Pose, Presence, Present};
use skein_protocol::{Ballot, DroneId, GroupId, Message, PlanStamp, SimTime, prefetch};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// What the drones of one frame have in common.
type Kind = (PlanStamp, GroupId, Ballot);

/// What was said of one drone. Each drone keeps this for all drones of the swarm, so it is small.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Told {
    /// Time stamp of the newest state of it that the neighbourhood heard, as far as this drone knows.
    said: SimTime,
    /// When the neighbourhood last heard of it, as far as this drone knows, in ns; times 8, because the last three bits are used otherwise:
    /// the first of them tells whether this drone has heard of it, the other two how often the news is said at once.
    covered: i64,
}

impl Told {
    /// Nothing heard.
    const NOTHING: Self = Self { said: SimTime::ZERO, covered: 0 };
    /// News that was not said yet.
    const NEWS: Self = Self { said: SimTime::ZERO, covered: (NEWS_TIMES as i64) << 1 | 1 };

    /// Whether this drone has heard of it.
    fn is_known(&self) -> bool {
        self.covered & 1 != 0
    }

    /// How often the news is said at once.
    fn left(&self) -> i64 {
        (self.covered >> 1) & 3
    }

    /// When the neighbourhood last heard of it, as far as this drone knows.
    fn covered(&self) -> SimTime {
        SimTime(self.covered >> 3)
    }

    /// Notes that the state with this time stamp was said `now`.
    fn cover(&mut self, now: SimTime, stamp: SimTime) {
        self.said = self.said.max(stamp);
        self.covered = now.0 << 3 | (self.left() - 1).max(0) << 1 | (self.covered & 1);
    }
}

/// Two bits have room for it.
const _: () = assert!(NEWS_TIMES <= 3);

/// The states that one drone passes on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Presences {
    me: DroneId,
    drones: u32,
    repeat_s: f64,
    /// Mean time between two times at which this drone says states without news, s: longer in large swarms, so that frames are full.
    turn_s: f64,
    /// A state without news is passed on if it is newer by this than the one that was passed on before, s. So each drone's state comes
    /// once in this time, and travels on at once. What was not heard for longer, because frames were lost, is repeated.
    period_s: f64,
    /// By how much that time is longer now, because more is due than may be said. No unit.
    thinning: f64,
    /// Whether it passes states on. Otherwise it keeps none.
    open: bool,
    /// By drone; empty unless it passes states on.
    told: Vec<Told>,
    /// Number of drones ever heard of.
    known: usize,
    /// When a drone was last heard of for the first time.
    last_new: SimTime,
    /// When this drone speaks next.
    turn: SimTime,
}

impl Presences {
    /// Nothing heard.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let (me, start) = (params.me, params.start);
        let repeat_s = params.repeat_period_s;
        let period_s = params.state_period_s();
        let turn_s = repeat_s * params.thinning().min(LONGEST_TURN);
        let drones = params.drones.max(1);
        Self {
            me,
            drones,
            repeat_s,
            turn_s,
            period_s,
            thinning: 1.0,
            open: false,
            told: Vec::new(),
            known: 0,
            last_new: start,
            turn: start,
        }
    }

    /// When a drone was last heard of for the first time.
    pub(crate) fn last_new(&self) -> SimTime {
        self.last_new
    }

    /// Starts or stops to pass states on.
    pub(crate) fn set_open(&mut self, k: &Knowledge, open: bool) {
        if std::mem::replace(&mut self.open, open) != open {
            self.told = vec![Told::NOTHING; if open { self.drones as usize } else { 0 }];
            for (drone, _) in k.peers().all().filter(|_| open) {
                self.told[drone.index()] = Told::NEWS;
            }
        }
    }

    /// Notes that a drone's state was heard. `has_news`: it differs from the one before by [`News`]. `near`: the state in a message of
    /// a drone close to this one.
    pub(crate) fn hear(&mut self, k: &Knowledge, now: SimTime, drone: DroneId, has_news: bool, near: Option<&Pose>) {
        let known = k.peers().stamps().len();
        if known > self.known {
            (self.known, self.last_new) = (known, now);
        }
        if !self.open || !(has_news || near.is_some()) {
            return;
        }
        let Some(newest) = k.peers().last(drone) else { return };
        let Some(told) = self.told.get_mut(drone.index()) else { return };
        if has_news || !told.is_known() {
            *told = Told::NEWS;
        }
        // The message that brings a state covers nobody: this drone may be the only way on.
        if let Some(pose) = near
            && News::of(pose) == News::of_last(newest)
            && pose.stamp < newest.stamp()
        {
            told.cover(now, pose.stamp);
        }
        if has_news {
            self.hasten(now);
        }
    }

    /// News does not wait for a turn of a large swarm.
    fn hasten(&mut self, now: SimTime) {
        if self.turn_s > self.repeat_s {
            self.turn = self.turn.min(self.next_turn(now, self.repeat_s));
        }
    }

    /// A time at which this drone speaks next, if it speaks once per `mean_s` on average, s.
    fn next_turn(&self, now: SimTime, mean_s: f64) -> SimTime {
        now.after(mean_s * (0.5 + self.draw(now) as f64 / (1_u64 << 53) as f64))
    }

    /// A random number below 2^53, another one for each drone and time.
    fn draw(&self, now: SimTime) -> u64 {
        Digest::chain(u64::from(self.me.0), now.0 as u64) >> 11
    }

    /// Notes that a drone close to this one said the newest state of `drone`, which has this time stamp and which this drone knows.
    pub(crate) fn hear_newest(&mut self, now: SimTime, drone: DroneId, stamp: SimTime) {
        if let Some(told) = self.told.get_mut(drone.index()).filter(|told| told.is_known()) {
            told.cover(now, stamp);
        }
    }

    /// Fetches what was said of a drone into the cache.
    #[inline]
    pub(crate) fn warm(&self, drone: DroneId) {
        self.told.get(drone.index()).into_iter().for_each(prefetch);
    }

    /// Says the states that are due, if it is this drone's turn, in at most `frames`.
    pub(crate) fn speak(&mut self, k: &Knowledge, now: SimTime, frames: usize, say: &mut Vec<Message>) {
        if now < self.turn || frames == 0 {
            return;
        }
        let draw = self.draw(now);
        let mut due = self.due(k, now, (draw % u64::from(self.drones)) as u32);
        let needed = due.iter().map(|(_, drones)| drones.len().div_ceil(MAX_PRESENT)).sum::<usize>();
        // Word that has to wait at each hop is old when it comes; less of it comes sooner.
        let change = if needed > BACKLOG { THIN } else { THICKEN };
        self.thinning = (self.thinning * change).clamp(1.0, MAX_THINNING);
        if needed <= frames {
            self.turn = self.next_turn(now, self.turn_s);
        }
        due.iter_mut().for_each(|(_, drones)| keep_least(drones, frames.saturating_mul(MAX_PRESENT)));
        let chunks = due.iter().flat_map(|(kind, drones)| drones.chunks(MAX_PRESENT).map(move |chunk| (kind, chunk)));
        let mut chunks: Vec<(&Kind, &[Due])> = chunks.collect();
        // No kind has to wait until all others are said.
        chunks.sort_unstable_by_key(|(_, chunk)| chunk.first().copied());
        for (&(obeyed, group, term), chunk) in chunks.into_iter().take(frames) {
            let mut presence = Presence { obeyed, group, term, ..Presence::default() };
            for (entry, due) in presence.drones.iter_mut().zip(chunk) {
                let (Some(pose), Some(told)) = (k.peers().last(due.drone), self.told.get_mut(due.drone.index())) else {
                    continue;
                };
                *entry = present(due.drone, &pose.pose());
                presence.count += 1;
                told.cover(now, entry.stamp);
            }
            say.push(Message::Presence(presence));
        }
    }

    /// The states that are due, by what their drones have in common, in any order. `first`: the drone that comes first of those that are equally
    /// urgent. Drones close to each other begin at different ones, so that they do not all say the same at one time.
    fn due(&self, k: &Knowledge, now: SimTime, first: u32) -> Vec<(Kind, Vec<Due>)> {
        let period_s = self.period_s * self.thinning;
        let (period, overdue) = (least_span(period_s), least_span(PRESENCE_OVERDUE * period_s));
        let mut found = Vec::new();
        for (id, stamp) in k.peers().ids().iter().copied().zip(k.peers().stamps()) {
            let Some(told) = self.told.get(id.index()) else { continue };
            // Without a branch for each condition, because this is done for all drones.
            let is_overdue = (told.left() > 0) | (now.0.saturating_sub(told.covered().0) >= overdue);
            // Few are due, and what is known of a drone is looked up for those only: it is in memory that is not in the cache.
            if told.is_known() & (is_overdue | (stamp.0.saturating_sub(told.said.0) >= period)) {
                k.peers().warm(id);
                found.push((id, now.since(told.covered())));
            }
        }
        let (mut due, mut places) = (Vec::<(Kind, Vec<Due>)>::new(), BTreeMap::<Kind, usize>::new());
        let mut last = 0;
        for (id, silent_s) in found {
            let Some(pose) = k.peers().last_of_living(id, now) else { continue };
            let kind = (pose.obeyed(), pose.group(), pose.term());
            // Most drones have the same in common as the one before.
            if due.get(last).is_none_or(|(other, _)| *other != kind) {
                last = *places.entry(kind).or_insert_with(|| {
                    due.push((kind, Vec::new()));
                    due.len() - 1
                });
            }
            let waits = Reverse((silent_s * WAITS_PER_PERIOD / self.period_s) as u32);
            due[last].1.push(Due { waits, turn: (id.0 + self.drones - first) % self.drones, drone: id });
        }
        due
    }
}

/// Sorts these states, the most urgent first, and keeps the first `most`. If a whole swarm is new, all its states are due in each tick, and few
/// can be said.
fn keep_least(due: &mut Vec<Due>, most: usize) {
    if most > 0 && due.len() > most {
        due.select_nth_unstable(most - 1);
        due.truncate(most);
    }
    due.sort_unstable();
}

/// The least difference of two times that [`SimTime::since`] says is at least so many seconds, ns.
fn least_span(seconds: f64) -> i64 {
    let since = |span: i64| SimTime(span).since(SimTime::ZERO);
    let mut span = (seconds * 1e9) as i64;
    while span > i64::MIN && since(span) >= seconds {
        span -= 1;
    }
    while span < i64::MAX && since(span) < seconds {
        span += 1;
    }
    span
}

/// A state that is due, in the order of urgency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Due {
    /// For how long the neighbourhood has not heard of the drone, in parts of a period. News that was never said waits since the start.
    waits: Reverse<u32>,
    /// Its place among those that wait as long.
    turn: u32,
    drone: DroneId,
}

/// A beacon as it is passed on.
fn present(drone: DroneId, pose: &Pose) -> Present {
    let velocity = pose.velocity();
    Present {
        stamp: pose.stamp,
        drone,
        incarnation: pose.incarnation,
        flags: pose.flags,
        position_m: pose.position_m.map(|value| value as f32),
        velocity_mps: [velocity.x as f32, velocity.y as f32],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_urgent_states_are_kept_in_order() {
        let states: Vec<Due> =
            (0..200).map(|i| Due { waits: Reverse(i * 37 % 5), turn: i * 61 % 200, drone: DroneId(i) }).collect();
        for most in [1, 2, 50, 199, 200, 300] {
            let (mut kept, mut sorted) = (states.clone(), states.clone());
            keep_least(&mut kept, most);
            sorted.sort();
            sorted.truncate(most);
            assert_eq!(kept, sorted, "{most}");
        }
    }

    #[test]
    fn a_span_is_the_least_that_counts_as_so_many_seconds() {
        for seconds in (0..2000).map(|step| f64::from(step) * 0.0123_f64.powi(step % 3) / 7.0) {
            let span = least_span(seconds);
            let since = |span| SimTime(span).since(SimTime::ZERO);
            assert!(since(span) >= seconds && since(span - 1) < seconds, "{seconds} s: {span} ns");
        }
        assert_eq!(least_span(f64::INFINITY), i64::MAX);
    }
}
