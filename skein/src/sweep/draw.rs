//! A small keyed generator (splitmix64): the same on every machine, and no system randomness.

/// A stream of draws.
pub struct Draw(u64);

impl Draw {
    /// The stream of two keys.
    pub fn keyed(a: u64, b: u64) -> Self {
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

    /// Uniform from `low` (included) to `high` (excluded).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// Uniform from `low` to `high`, both included.
    pub fn integer(&mut self, low: u32, high: u32) -> u32 {
        let span = u64::from(high.saturating_sub(low)) + 1;
        low + u32::try_from(self.next() % span).unwrap_or(0)
    }

    /// One of the items.
    pub fn one<'a>(&mut self, items: &[&'a str]) -> &'a str {
        items.get(self.next() as usize % items.len().max(1)).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splitmix64_gives_its_published_values() {
        let mut draw = Draw(1_234_567);
        let first: Vec<u64> = (0..3).map(|_| draw.next()).collect();
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn draws_stay_in_their_ranges_and_reach_both_ends() {
        let mut draw = Draw::keyed(1, 2);
        let mut seen = [0; 3];
        for _ in 0..300 {
            assert!((2.0..5.0).contains(&draw.between(2.0, 5.0)));
            seen[(draw.integer(7, 9) - 7) as usize] += 1;
        }
        assert!(seen.iter().all(|&count| count > 60), "{seen:?}");
        assert_ne!(Draw::keyed(1, 2).next(), Draw::keyed(2, 1).next());
    }
}
