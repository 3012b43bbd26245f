//! SplitMix64, a small seeded generator: the same numbers on every machine, and no system randomness.

/// A SplitMix64 stream (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
pub(crate) struct SplitMix64(u64);

impl SplitMix64 {
    /// The stream that belongs to two keys.
    pub(crate) fn keyed(a: u64, b: u64) -> Self {
        let mut first = Self(a);
        Self(first.next() ^ b.wrapping_mul(0xd134_2543_de82_ef95))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number drawn uniformly from `low` (included) to `high` (excluded).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// An integer drawn uniformly from `low` to `high`, both included.
    pub(crate) fn integer(&mut self, low: u32, high: u32) -> u32 {
        let span = u64::from(high.saturating_sub(low)) + 1;
        low + u32::try_from(self.next() % span).unwrap_or(0)
    }

    /// One of the items; an empty text if there are none.
    pub(crate) fn one<'a>(&mut self, items: &[&'a str]) -> &'a str {
        items.get(self.next() as usize % items.len().max(1)).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitmix64_gives_its_published_values() {
        let mut rng = SplitMix64(1_234_567);
        let first: Vec<u64> = (0..3).map(|_| rng.next()).collect();
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn numbers_stay_in_their_ranges_and_reach_both_ends() {
        let mut rng = SplitMix64::keyed(1, 2);
        let mut seen = [0; 3];
        for _ in 0..300 {
            assert!((2.0..5.0).contains(&rng.between(2.0, 5.0)));
            seen[(rng.integer(7, 9) - 7) as usize] += 1;
        }
        assert!(seen.iter().all(|&count| count > 60), "{seen:?}");
        assert_ne!(SplitMix64::keyed(1, 2).next(), SplitMix64::keyed(2, 1).next());
    }
}
