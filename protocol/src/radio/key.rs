//! Random numbers that depend only on a key. No generator is shared, so the order of the calls has no effect. Logarithms and
//! powers come from the crate libm, so that every bit is the same on all platforms.

use super::link::Link;
use crate::ids::DroneId;
use crate::time::SimTime;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Number of attempts after which a rejection method gives up. For each method in this module, an attempt succeeds with a
/// probability of at least one half.
const TRIES: usize = 64;

/// The sequence of random numbers of one key.
pub(super) struct KeyedRng(u64);

impl KeyedRng {
    /// Numbers for one frame at one receiver. Different values of `purpose` give independent sequences.
    pub(crate) fn of_frame(seed: u64, link: Link, purpose: &[u8; 4]) -> Self {
        let mut key = [0; 20];
        key[..4].copy_from_slice(&link.source.0.to_le_bytes());
        key[4..8].copy_from_slice(&link.destination.0.to_le_bytes());
        key[8..12].copy_from_slice(&link.sequence.to_le_bytes());
        key[12..14].copy_from_slice(&link.topic.to_le_bytes());
        key[16..].copy_from_slice(purpose);
        Self(xxh3_64_with_seed(&key, seed))
    }

    /// Numbers for the frames of one topic that are transmitted on a link at a time. Different values of `purpose` give
    /// independent sequences.
    pub(crate) fn of_moment(seed: u64, link: Link, aired: SimTime, purpose: &[u8; 4]) -> Self {
        let mut key = [0; 24];
        key[..4].copy_from_slice(&link.source.0.to_le_bytes());
        key[4..8].copy_from_slice(&link.destination.0.to_le_bytes());
        key[8..16].copy_from_slice(&aired.0.to_le_bytes());
        key[16..18].copy_from_slice(&link.topic.to_le_bytes());
        key[20..].copy_from_slice(purpose);
        Self(xxh3_64_with_seed(&key, seed))
    }

    /// Numbers for an ordered pair of drones and a number. Different values of `purpose` give independent sequences.
    pub(crate) fn of_pair(seed: u64, pair: [DroneId; 2], number: i64, purpose: &[u8; 4]) -> Self {
        let mut key = [0; 20];
        key[..4].copy_from_slice(&pair[0].0.to_le_bytes());
        key[4..8].copy_from_slice(&pair[1].0.to_le_bytes());
        key[8..16].copy_from_slice(&number.to_le_bytes());
        key[16..].copy_from_slice(purpose);
        Self(xxh3_64_with_seed(&key, seed))
    }

    /// Uniform in [0, 1). The first number is the hash of the key, scaled to this interval.
    pub(crate) fn unit(&mut self) -> f64 {
        let value = (self.0 >> 11) as f64 / (1u64 << 53) as f64;
        self.0 = mix(self.0.wrapping_add(0x9e37_79b9_7f4a_7c15));
        value
    }

    /// Exponential with this mean.
    pub(crate) fn exponential(&mut self, mean: f64) -> f64 {
        -libm::log(1.0 - self.unit()) * mean
    }

    /// Standard normal, by Marsaglia's polar method.
    pub(crate) fn normal(&mut self) -> f64 {
        for _ in 0..TRIES {
            let (x, y) = (2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0);
            let square = x * x + y * y;
            if square > 0.0 && square < 1.0 {
                return x * (-2.0 * libm::log(square) / square).sqrt();
            }
        }
        0.0
    }

    /// Normal, truncated to values at or above 0. `mean` and `deviation` are those before the truncation; `mean` must not be
    /// negative.
    pub(crate) fn normal_above_zero(&mut self, mean: f64, deviation: f64) -> f64 {
        let mut draws = std::iter::repeat_with(|| mean + deviation * self.normal());
        draws.by_ref().take(TRIES).find(|&value| value >= 0.0).unwrap_or(mean)
    }

    /// Gamma with this shape and scale 1, by the method of Marsaglia and Tsang.
    pub(crate) fn gamma(&mut self, shape: f64) -> f64 {
        if shape < 1.0 {
            return self.gamma(shape + 1.0) * libm::pow(1.0 - self.unit(), 1.0 / shape);
        }
        let d = shape - 1.0 / 3.0;
        let c = 1.0 / (9.0 * d).sqrt();
        for _ in 0..TRIES {
            let x = self.normal();
            let t = 1.0 + c * x;
            let v = t * t * t;
            if v > 0.0 && libm::log(1.0 - self.unit()) < 0.5 * x * x + d * (1.0 - v + libm::log(v)) {
                return d * v;
            }
        }
        d
    }
}

/// The finalizer of SplitMix64.
fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}
