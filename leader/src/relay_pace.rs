//! How much a drone may pass on: a token bucket, so that relays leave the channel room for beacons and plans.

use crate::params::LeadingParams;
use crate::tuning::MAX_RELAYED_PER_TICK;
use skein_protocol::payload::Presence;
use skein_protocol::radio::HEAD_BYTES;
use skein_protocol::{Message, SimTime};

/// The longest frame that is passed on, bytes.
const LONGEST: f64 = HEAD_BYTES as f64 + size_of::<Presence>() as f64;

/// The most that a drone saves up, bytes: what it may say in one tick.
const MOST: f64 = MAX_RELAYED_PER_TICK as f64 * LONGEST;

/// What one drone may pass on now.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RelayPace {
    bytes_per_s: f64,
    credit_bytes: f64,
    /// When it last gained credit.
    last: SimTime,
}

impl RelayPace {
    /// With all the credit that it can have.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        Self::at(params.start, params.relay_bytes_per_s)
    }

    fn at(start: SimTime, bytes_per_s: f64) -> Self {
        Self { bytes_per_s, credit_bytes: MOST, last: start }
    }

    /// How many frames it may say now, however long they are.
    pub(crate) fn frames(&mut self, now: SimTime) -> usize {
        let passed_s = now.since(self.last);
        self.last = now;
        if passed_s > 0.0 {
            self.credit_bytes = (self.credit_bytes + passed_s * self.bytes_per_s).min(MOST);
        }
        (self.credit_bytes / LONGEST) as usize
    }

    /// Notes what it said.
    pub(crate) fn note(&mut self, said: &[Message]) {
        let bytes = |message: &Message| (HEAD_BYTES + u64::from(message.encode().len)) as f64;
        if self.bytes_per_s.is_finite() {
            self.credit_bytes -= said.iter().map(bytes).sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::payload::Assignment;

    /// What a drone says in 500 ticks of 20 ms that wants to say this many messages in each.
    fn said(bytes_per_s: f64, wanted: usize, message: Message) -> Vec<usize> {
        let mut pace = RelayPace::at(SimTime::ZERO, bytes_per_s);
        let tick = |tick: u32| {
            let frames = pace.frames(SimTime::from_secs(0.02 * f64::from(tick))).min(wanted);
            pace.note(&vec![message; frames]);
            frames
        };
        (0..500).map(tick).collect()
    }

    #[test]
    fn it_passes_its_bytes_per_second_on_after_what_it_saved() {
        let presence = Message::Presence(Presence::default());
        let said = said(10.0 * LONGEST, usize::MAX, presence);
        assert_eq!(said[0], MAX_RELAYED_PER_TICK);
        assert!(said[1..].iter().all(|frames| *frames <= 1), "{said:?}");
        assert!((102..=104).contains(&said.iter().sum::<usize>()), "{said:?}");
    }

    #[test]
    fn short_frames_may_come_more_often() {
        let part = Message::Assignment(Assignment::zeroed());
        let bytes = (HEAD_BYTES + u64::from(part.encode().len)) as f64;
        let total: usize = said(10.0 * LONGEST, usize::MAX, part).iter().sum();
        let expected = (MOST + 100.0 * LONGEST) / bytes;
        assert!((total as f64 - expected).abs() < 5.0, "{total}, expected {expected}");
    }

    #[test]
    fn without_a_limit_each_tick_has_the_most() {
        let said = said(f64::INFINITY, usize::MAX, Message::Presence(Presence::default()));
        assert!(said.iter().all(|frames| *frames == MAX_RELAYED_PER_TICK));
    }
}
