//! Burst losses: the two-state model of Gilbert and Elliott in continuous time. The state at any time is computed on demand;
//! nothing is stored between calls.

use super::key::KeyedRng;
use super::link::Link;
use crate::ids::DroneId;
use crate::time::SimTime;
use serde::{Deserialize, Serialize};

/// Length of a block of time, in mean burst lengths. At the start of a block, the state is drawn from its stationary
/// distribution. Within the block it evolves by random numbers of the block's own key. The state at any time can therefore
/// be computed from its block alone.
pub const BLOCK_BURSTS: f64 = 64.0;

/// Which links share their bursts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum BurstScope {
    /// Each direction of each link has its own bursts.
    #[default]
    Direction,
    /// Both directions of a link have the same bursts; each link has its own.
    Link,
    /// All links in the swarm have the same bursts.
    Swarm,
}

/// Parameters of the burst losses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Burst {
    /// Share of time that is spent in bursts, 0 to 1.
    pub share: f64,
    /// Mean length of a burst, s; positive.
    pub length_s: f64,
    /// Probability that a frame is lost during a burst, 0 to 1.
    pub loss: f64,
    /// Which links share their bursts.
    pub scope: BurstScope,
}

impl Burst {
    /// Length of a block, s.
    #[must_use]
    pub fn block_s(&self) -> f64 {
        BLOCK_BURSTS * self.length_s
    }

    /// Whether a burst is active on a link at the time `at`. `seed` is the radio's key.
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

    /// Mean time in a burst and mean time between bursts, within a block, s. The end of a block cuts a burst short unless
    /// the next block begins with a burst. Both means are lengthened to compensate, so that bursts still have the mean
    /// length `length_s` overall.
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
