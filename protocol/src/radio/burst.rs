//! Losses that come together: Gilbert and Elliott's two states in continuous time, without a memory.

use super::key::KeyedRng;
use super::link::Link;
use crate::ids::DroneId;
use crate::time::SimTime;
use serde::{Deserialize, Serialize};

/// A block of time lasts so many mean bursts. The state is drawn from its stationary distribution at a block's start and
/// evolves within the block by draws of the block's own key, so it can be told for any instant by itself.
pub const BLOCK_BURSTS: f64 = 64.0;

/// Whom a burst befalls together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum BurstScope {
    /// One direction of one link.
    #[default]
    Direction,
    /// Both directions of one link.
    Link,
    /// Everybody at once.
    Swarm,
}

/// Losses that come together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Burst {
    /// Share of time that bursts take, 0 to 1.
    pub share: f64,
    /// Mean length of a burst, s; positive.
    pub length_s: f64,
    /// Probability that a frame is lost in a burst, 0 to 1.
    pub loss: f64,
    /// Whom a burst befalls.
    pub scope: BurstScope,
}

impl Burst {
    /// Length of a block, s.
    #[must_use]
    pub fn block_s(&self) -> f64 {
        BLOCK_BURSTS * self.length_s
    }

    /// Whether a burst is_active on a link.
    #[must_use]
    pub fn is_active(&self, seed: u64, link: Link, at: SimTime) -> bool {
        if self.share <= 0.0 || self.share >= 1.0 {
            return self.share > 0.0;
        }
        let block_ns = SimTime::from_secs(self.block_s()).0.max(1);
        let (block, mut left_s) = (at.0.div_euclid(block_ns), SimTime(at.0.rem_euclid(block_ns)).secs());
        let mut draws = KeyedRng::of_pair(seed, self.pair(link), block, b"brst");
        let (burst_s, quiet_s) = self.means_s();
        let mut active = draws.unit() < self.share;
        loop {
            left_s -= draws.exponential(if active { burst_s } else { quiet_s });
            if left_s < 0.0 {
                return active;
            }
            active = !active;
        }
    }

    /// Mean stay in either state, s. A block's end cuts a burst short unless the next block begins with one: the stay
    /// within a block is by so much longer that a burst has its mean length all the same.
    fn means_s(&self) -> (f64, f64) {
        let burst_s = self.length_s / (1.0 - (1.0 - self.share) / BLOCK_BURSTS);
        (burst_s, burst_s * (1.0 - self.share) / self.share)
    }

    fn pair(&self, Link { source, destination, .. }: Link) -> [DroneId; 2] {
        match self.scope {
            BurstScope::Direction => [source, destination],
            BurstScope::Link => [source.min(destination), source.max(destination)],
            BurstScope::Swarm => [DroneId::NONE; 2],
        }
    }
}
