//! The radio between sending and hearing: whether a frame is heard, and when. A pure, keyed function without shared
//! generator or memory, so that it does not matter which process asks first.

use crate::Vec2;
use crate::ids::DroneId;
use crate::message::Topic;
use crate::time::SimTime;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Number of [`DropReason`]s.
pub const DROP_REASONS: usize = 6;

/// Why a frame was not heard.
#[repr(usize)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DropReason {
    /// Lost on its own.
    Loss = 0,
    /// Lost in a burst.
    Burst = 1,
    /// Out of range.
    Range = 2,
    /// Between two sides of a partition.
    Partition = 3,
    /// The receiver is deaf, or the sender mute.
    Deaf = 4,
    /// It could not be decoded.
    Malformed = 5,
}

impl DropReason {
    /// All reasons, in the order of their counters.
    pub const ALL: [Self; DROP_REASONS] =
        [Self::Loss, Self::Burst, Self::Range, Self::Partition, Self::Deaf, Self::Malformed];
}

/// What the air does to frames. The default is ideal: nothing is lost, a frame takes one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Radio {
    /// Key of all verdicts.
    pub seed: u64,
    /// Time on the air, s; a frame takes at least one tick.
    pub delay_s: f64,
    /// Probability that a receiver does not hear a frame, 0 to 1, independent for each (Bernoulli).
    pub loss: f64,
    /// Greatest distance at which a frame is heard, m; `None`: no limit.
    pub range_m: Option<f64>,
}

/// Which frame, from whom, to whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// Who sent it.
    pub source: DroneId,
    /// Whose radio asks.
    pub destination: DroneId,
    /// The frame's kind as it stands on the wire.
    pub topic: u16,
    /// Running number of the source's frames.
    pub sequence: u32,
}

impl Link {
    /// The topic, if the kind is known.
    #[must_use]
    pub fn topic(&self) -> Option<Topic> {
        Topic::from_wire(self.topic)
    }
}

/// What becomes of a frame at one receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Not heard.
    Drop(DropReason),
    /// Heard in the first tick at or after this instant.
    Deliver(SimTime),
}

impl Radio {
    /// What becomes of a frame that was sent at `sent` over `path` (from sender to receiver, m).
    #[must_use]
    pub fn verdict(&self, link: Link, path: Vec2, sent: SimTime) -> Verdict {
        if self.range_m.is_some_and(|range| path.norm_squared() > range * range) {
            return Verdict::Drop(DropReason::Range);
        }
        if self.loss > 0.0 && self.draw(link, b"loss") < self.loss {
            return Verdict::Drop(DropReason::Loss);
        }
        Verdict::Deliver(sent.after(self.delay_s))
    }

    /// A number in [0, 1) that depends on the seed, the link's fields and the purpose alone.
    fn draw(&self, link: Link, purpose: &[u8; 4]) -> f64 {
        let mut key = [0u8; 20];
        key[..4].copy_from_slice(&link.source.0.to_le_bytes());
        key[4..8].copy_from_slice(&link.destination.0.to_le_bytes());
        key[8..12].copy_from_slice(&link.sequence.to_le_bytes());
        key[12..14].copy_from_slice(&link.topic.to_le_bytes());
        key[16..].copy_from_slice(purpose);
        (xxh3_64_with_seed(&key, self.seed) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(source: u32, destination: u32, sequence: u32) -> Link {
        Link { source: DroneId(source), destination: DroneId(destination), topic: Topic::Pose as u16, sequence }
    }

    #[test]
    fn an_ideal_radio_delivers_at_once() {
        let verdict = Radio::default().verdict(link(0, 1, 0), Vec2::new(1e6, 0.0), SimTime(5));
        assert_eq!(verdict, Verdict::Deliver(SimTime(5)));
    }

    #[test]
    fn loss_has_its_rate_on_every_link() {
        let radio = Radio { seed: 3, loss: 0.2, ..Radio::default() };
        for (source, destination) in [(0, 1), (1, 0), (6, 7)] {
            let lost = (0..20_000)
                .filter(|&s| {
                    radio.verdict(link(source, destination, s), Vec2::zeros(), SimTime::ZERO)
                        == Verdict::Drop(DropReason::Loss)
                })
                .count();
            // Five standard deviations of a binomial with p = 0.2, n = 20 000.
            assert!((lost as f64 - 4000.0).abs() < 5.0 * (20_000.0f64 * 0.2 * 0.8).sqrt(), "{lost} of 20000");
        }
    }

    #[test]
    fn verdicts_are_keyed_not_drawn_in_turn() {
        let radio = Radio { seed: 9, loss: 0.5, delay_s: 0.1, ..Radio::default() };
        let ask = |s| radio.verdict(link(2, 3, s), Vec2::zeros(), SimTime::ZERO);
        let forward: Vec<_> = (0..100).map(ask).collect();
        let mut backward: Vec<_> = (0..100).rev().map(ask).collect();
        backward.reverse();
        assert_eq!(forward, backward);
        assert_ne!(forward, (100..200).map(ask).collect::<Vec<_>>());
    }

    #[test]
    fn range_is_a_reason_of_its_own() {
        let radio = Radio { range_m: Some(100.0), ..Radio::default() };
        let at = |x| radio.verdict(link(0, 1, 0), Vec2::new(x, 0.0), SimTime::ZERO);
        assert_eq!(at(100.0), Verdict::Deliver(SimTime::ZERO));
        assert_eq!(at(100.1), Verdict::Drop(DropReason::Range));
    }
}
