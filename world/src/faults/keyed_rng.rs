//! Random numbers by key: a draw depends on the seed and the key alone, not on the order of the draws. The generator uses
//! sums, shifts and products only, so that no bit depends on a platform's logarithm.

use skein_protocol::Vec2;
use skein_protocol::digest::Digest;

/// The random numbers of one key (SplitMix64).
pub(crate) struct KeyedRng(u64);

impl KeyedRng {
    /// The generator of a seed and a key.
    pub(crate) fn new(seed: u64, key: [u64; 3]) -> Self {
        let mut digest = Digest::default();
        digest.word(seed);
        for word in key {
            digest.word(word);
        }
        Self(digest.value())
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A uniform number from 0 to `count` − 1; 0 if `count` is 0.
    pub(crate) fn one_of(&mut self, count: usize) -> usize {
        // The bias, count/2⁶⁴, is too small to measure.
        ((u128::from(self.next()) * count as u128) >> 64) as usize
    }

    /// A uniform number from 0 to 1, without 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A uniform number from −1 to 1, without 1.
    pub(crate) fn symmetric(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A uniform vector of at most this length.
    pub(crate) fn disc(&mut self, length: f64) -> Vec2 {
        loop {
            let vector = Vec2::new(self.symmetric(), self.symmetric());
            if vector.norm_squared() <= 1.0 {
                return vector * length;
            }
        }
    }

    /// A normal number with standard deviation 1, as the sum of twelve uniform numbers. It is within ±6.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    /// A vector whose coordinates are normal with this standard deviation.
    pub(crate) fn vector(&mut self, std: f64) -> Vec2 {
        Vec2::new(self.normal(), self.normal()) * std
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_0_and_the_given_deviation() {
        let drawn: Vec<f64> = (0..20_000).map(|i| KeyedRng::new(7, [1, 2, i]).vector(3.0).x).collect();
        let mean = drawn.iter().sum::<f64>() / 20_000.0;
        let std = (drawn.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 20_000.0).sqrt();
        // Five standard errors: 3/√n, and 3/√(2n).
        assert!(mean.abs() < 0.106, "{mean}");
        assert!((std - 3.0).abs() < 0.075, "{std}");
    }

    #[test]
    fn every_choice_is_equally_frequent() {
        let mut counts = [0; 5];
        for i in 0..10_000 {
            counts[KeyedRng::new(3, [i, 0, 0]).one_of(5)] += 1;
        }
        // Five standard deviations of a binomial with p = 0.2, n = 10 000.
        assert!(counts.iter().all(|&count: &i32| (count - 2000).abs() < 200), "{counts:?}");
        assert_eq!(KeyedRng::new(3, [0; 3]).one_of(0), 0);
    }

    #[test]
    fn a_disc_is_filled_evenly() {
        let drawn: Vec<Vec2> = (0..10_000).map(|i| KeyedRng::new(9, [i, 0, 1]).disc(2.0)).collect();
        assert!(drawn.iter().all(|v| v.norm() <= 2.0));
        // Half of the area is within 2/√2. Five standard deviations of a binomial with p = 0.5, n = 10 000.
        let inner = drawn.iter().filter(|v| v.norm_squared() <= 2.0).count() as i32;
        assert!((inner - 5000).abs() < 250, "{inner}");
    }

    #[test]
    fn equal_keys_draw_equal_numbers() {
        let draw = |seed, key| KeyedRng::new(seed, key).vector(1.0);
        assert_eq!(draw(1, [1, 2, 3]), draw(1, [1, 2, 3]));
        assert!([draw(2, [1, 2, 3]), draw(1, [2, 1, 3]), draw(1, [1, 2, 4])].iter().all(|v| *v != draw(1, [1, 2, 3])));
    }
}
