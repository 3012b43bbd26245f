//! When a fact is repeated that any drone may have missed: the Trickle algorithm (RFC 6206).
//!
//! The time between two repetitions doubles as long as nothing changes. A drone that hears the fact often enough from others
//! does not repeat it in that interval. A change, such as a drone that is heard again after a silence, starts with the
//! shortest interval. So a fact spreads at once, and a swarm that agrees says little.

use crate::tuning::{MAX_GOSSIP_DOUBLINGS, MAX_SILENT_TURNS, NEAR_REDUNDANCY, REDUNDANCY};
use skein_protocol::digest::Digest;
use skein_protocol::{DroneId, SimTime};

/// What the repetitions of all facts of one kind by one drone have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GossipRhythm {
    me: DroneId,
    /// Length of the shortest interval, s.
    shortest_s: f64,
    /// Whether the point within an interval at which this drone speaks is drawn anew for each interval, so that each drone comes first at
    /// some time.
    varies: bool,
}

impl GossipRhythm {
    /// Those of drone `me`, which speaks at the same point of each interval.
    pub(crate) fn steady(shortest_s: f64, me: DroneId) -> Self {
        Self { me, shortest_s, varies: false }
    }

    /// Those of drone `me`, which speaks at another point of each interval.
    pub(crate) fn varying(shortest_s: f64, me: DroneId) -> Self {
        Self { me, shortest_s, varies: true }
    }

    /// Length of the shortest interval, s.
    pub(crate) fn shortest_s(&self) -> f64 {
        self.shortest_s
    }

    /// The point within the second half of an interval at which this drone speaks, 0 to 1. It differs between drones. `since`: when the
    /// interval began.
    fn phase(&self, since: SimTime) -> f64 {
        if self.varies {
            return (Digest::chain(u64::from(self.me.0), since.0 as u64) >> 11) as f64 / (1_u64 << 53) as f64;
        }
        // Multiples of the golden ratio spread the drones evenly, whatever their number is.
        (f64::from(self.me.0) * 0.618_033_988_749_894_9).fract()
    }

    /// How often a fact has to be heard in an interval, so that this drone need not say it.
    fn redundancy(&self) -> u32 {
        if self.varies { NEAR_REDUNDANCY } else { REDUNDANCY }
    }
}

/// The repetitions of one fact by one drone. A drone of a large swarm keeps thousands of them, so they are small.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gossip {
    /// Start of the present interval.
    since: SimTime,
    /// How often the fact was heard in the present interval, up to 255.
    heard: u8,
    /// How often the shortest interval has been doubled.
    doublings: u8,
    /// Number of turns, one after the other, in which it was silent because others had said the fact. Only if the rhythm varies.
    silent_turns: u8,
    /// Whether this drone has had its turn in the present interval.
    over: bool,
}

impl Gossip {
    /// A fact that this drone learnt at `now`. Its first interval is the shortest one.
    pub(crate) fn new(now: SimTime) -> Self {
        Self { since: now, heard: 0, doublings: 0, silent_turns: 0, over: false }
    }

    /// Whether this is the first interval since the fact was new, and this drone has not had its turn.
    pub(crate) fn is_first(&self) -> bool {
        self.doublings == 0 && !self.over
    }

    /// How often the shortest interval has been doubled.
    pub(crate) fn doublings(&self) -> u32 {
        self.doublings.into()
    }

    /// When [`Self::is_due`] next changes anything.
    pub(crate) fn next_turn(&self, rhythm: &GossipRhythm) -> SimTime {
        let part = if self.over { 1.0 } else { 0.5 + 0.5 * rhythm.phase(self.since) };
        self.since.after(self.length_s(rhythm) * part)
    }

    /// Length of the present interval, s.
    fn length_s(&self, rhythm: &GossipRhythm) -> f64 {
        rhythm.shortest_s * f64::from(1_u32 << self.doublings)
    }

    /// Starts again with the shortest interval: some drone may not know the fact.
    pub(crate) fn restart(&mut self, now: SimTime) {
        self.begin(now, 0);
    }

    fn begin(&mut self, now: SimTime, doublings: u8) {
        *self = Self { silent_turns: self.silent_turns, doublings, ..Self::new(now) };
    }

    /// Notes that another drone has said the fact.
    pub(crate) fn hear(&mut self) {
        self.heard = self.heard.saturating_add(1);
    }

    /// Whether this drone says the fact now. Call once per tick, or at least when [`Self::next_turn`] has come.
    pub(crate) fn is_due(&mut self, rhythm: &GossipRhythm, now: SimTime) -> bool {
        let length_s = self.length_s(rhythm);
        let age_s = now.since(self.since);
        let turn = !self.over && age_s >= length_s * (0.5 + 0.5 * rhythm.phase(self.since));
        // The drones that said it may be heard by others than this one.
        let unheard = self.silent_turns >= MAX_SILENT_TURNS;
        let due = turn && (u32::from(self.heard) < rhythm.redundancy() || unheard);
        if turn && rhythm.varies {
            self.silent_turns = if due { 0 } else { self.silent_turns.saturating_add(1) };
        }
        self.over |= turn;
        if age_s >= length_s {
            self.begin(now, self.doublings.saturating_add(1).min(MAX_GOSSIP_DOUBLINGS));
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn says(rhythm: GossipRhythm, gossip: &mut Gossip, from_s: f64, to_s: f64) -> Vec<f64> {
        let ticks = (from_s * 50.0).round() as u32..(to_s * 50.0).round() as u32;
        let due = ticks.filter(|tick| gossip.is_due(&rhythm, SimTime::from_secs(f64::from(*tick) / 50.0)));
        due.map(|tick| f64::from(tick) / 50.0).collect()
    }

    #[test]
    fn a_drone_that_hears_no_other_repeats_less_and_less_often() {
        let mut gossip = Gossip::new(SimTime::ZERO);
        let said = says(GossipRhythm::steady(0.2, DroneId(0)), &mut gossip, 0.0, 20.0);
        assert!(said[0] < 0.2 && (12..=16).contains(&said.len()), "{said:?}");
        assert!(said.windows(2).all(|two| two[1] - two[0] < 1.5 * 0.2 * f64::from(1_u32 << MAX_GOSSIP_DOUBLINGS)));
    }

    #[test]
    fn a_fact_that_is_heard_often_is_not_repeated() {
        let (rhythm, mut gossip) = (GossipRhythm::steady(0.2, DroneId(1)), Gossip::new(SimTime::ZERO));
        (0..REDUNDANCY).for_each(|_| gossip.hear());
        assert_eq!(says(rhythm, &mut gossip, 0.0, 0.22), Vec::<f64>::new());
        assert!(!says(rhythm, &mut gossip, 0.22, 0.7).is_empty(), "the next interval counts anew");
    }

    #[test]
    fn a_fact_that_is_looked_at_in_its_turns_only_is_said_as_often() {
        let rhythm = GossipRhythm::varying(0.2, DroneId(3));
        let (mut each_tick, mut in_turns) = (Gossip::new(SimTime::ZERO), Gossip::new(SimTime::ZERO));
        let mut said = [Vec::new(), Vec::new()];
        for tick in 0..2000 {
            let now = SimTime::from_secs(0.02 * f64::from(tick));
            // Two others say it in some intervals.
            if tick % 300 < 2 {
                each_tick.hear();
                in_turns.hear();
            }
            said[0].extend(each_tick.is_due(&rhythm, now).then_some(tick));
            if in_turns.next_turn(&rhythm) <= now {
                said[1].extend(in_turns.is_due(&rhythm, now).then_some(tick));
            }
        }
        assert!(said[0].len() > 10, "{said:?}");
        assert_eq!(said[0], said[1]);
    }

    #[test]
    fn after_a_restart_the_shortest_interval_comes_first() {
        let (rhythm, mut gossip) = (GossipRhythm::steady(0.2, DroneId(2)), Gossip::new(SimTime::ZERO));
        says(rhythm, &mut gossip, 0.0, 30.0);
        gossip.restart(SimTime::from_secs(30.0));
        assert!(says(rhythm, &mut gossip, 30.0, 30.22).len() == 1);
    }
}
