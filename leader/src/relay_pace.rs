//! How much a drone may pass on: a token bucket, so that relays leave the channel room for beacons and plans.

use crate::channel_params::ChannelParams;
use crate::params::LeadingParams;
use crate::tuning::{BEAT_SHARE, MAX_RELAYED_PER_TICK, RELAY_SHARE};
use skein_protocol::payload::{Leadership, Presence};
use skein_protocol::radio::HEAD_BYTES;
use skein_protocol::{Message, SimTime};

/// What one drone may pass on now.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RelayPace {
    channel: ChannelParams,
    /// The part of the bandwidth that these messages of all drones that share it may take. No unit.
    share: f64,
    /// Number of drones that share the bandwidth.
    drones: u32,
    /// The longest frame that is passed on, bytes.
    longest_bytes: f64,
    credit_bytes: f64,
    /// When it last gained credit.
    last: SimTime,
}

impl RelayPace {
    /// That of messages of leaders, with all the credit that it can have.
    pub(crate) fn of_beats(params: &LeadingParams) -> Self {
        Self::at(params.start, params.channel, BEAT_SHARE, size_of::<Leadership>())
    }

    /// That of all other messages, with all the credit that it can have.
    pub(crate) fn of_facts(params: &LeadingParams) -> Self {
        Self::at(params.start, params.channel, RELAY_SHARE, size_of::<Presence>())
    }

    fn at(start: SimTime, channel: ChannelParams, share: f64, longest_bytes: usize) -> Self {
        let longest_bytes = HEAD_BYTES as f64 + longest_bytes as f64;
        let drones = channel.drones;
        Self { channel, share, drones, longest_bytes, credit_bytes: most(longest_bytes), last: start }
    }

    /// Takes note of how many drones share the bandwidth now. Never fewer than in the formation count.
    pub(crate) fn set_drones(&mut self, drones: u32) {
        self.drones = drones.max(self.channel.drones);
    }

    /// What it may say on average, bytes/s.
    fn bytes_per_s(&self) -> f64 {
        self.share * self.channel.part_bytes_per_s(self.drones)
    }

    /// How many frames it may say now, however long they are.
    pub(crate) fn frames(&mut self, now: SimTime) -> usize {
        let passed_s = now.since(self.last);
        self.last = now;
        if passed_s > 0.0 {
            self.credit_bytes = (self.credit_bytes + passed_s * self.bytes_per_s()).min(most(self.longest_bytes));
        }
        (self.credit_bytes / self.longest_bytes) as usize
    }

    /// Notes what it said.
    pub(crate) fn note(&mut self, said: &[Message]) {
        let bytes = |message: &Message| (HEAD_BYTES + u64::from(message.encode().len)) as f64;
        if self.bytes_per_s().is_finite() {
            self.credit_bytes -= said.iter().map(bytes).sum::<f64>();
        }
    }
}

/// The most that a drone saves up, bytes: what it may say in one tick.
fn most(longest_bytes: f64) -> f64 {
    MAX_RELAYED_PER_TICK as f64 * longest_bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::payload::Assignment;

    /// The longest frame, bytes.
    const LONGEST: f64 = HEAD_BYTES as f64 + size_of::<Presence>() as f64;

    /// What a drone says in 500 ticks of 20 ms that wants to say this many messages in each.
    fn said(bytes_per_s: f64, wanted: usize, message: Message) -> Vec<usize> {
        let channel = ChannelParams { bandwidth_bytes_per_s: bytes_per_s, ..ChannelParams::default() };
        let mut pace = RelayPace::at(SimTime::ZERO, channel, 1.0, size_of::<Presence>());
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
        let expected = (most(LONGEST) + 100.0 * LONGEST) / bytes;
        assert!((total as f64 - expected).abs() < 5.0, "{total}, expected {expected}");
    }

    #[test]
    fn without_a_limit_each_tick_has_the_most() {
        let said = said(f64::INFINITY, usize::MAX, Message::Presence(Presence::default()));
        assert!(said.iter().all(|frames| *frames == MAX_RELAYED_PER_TICK));
    }
}
