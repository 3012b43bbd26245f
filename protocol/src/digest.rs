//! The digest of a run: equal runs have equal digests, in both runtimes.

use xxhash_rust::xxh3::Xxh3;

/// A running 64-bit hash (XXH3). Floats are folded by their bits.
#[derive(Clone)]
pub struct Digest(Xxh3);

impl Default for Digest {
    fn default() -> Self {
        Self(Xxh3::new())
    }
}

impl Digest {
    /// A hash of a sequence of words, from 0 on: cheap for a few.
    #[must_use]
    #[inline]
    pub fn chain(hash: u64, word: u64) -> u64 {
        xxhash_rust::xxh3::xxh3_64_with_seed(&word.to_le_bytes(), hash)
    }

    /// Folds bytes in.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.update(bytes);
        self
    }

    /// Folds an integer in.
    pub fn word(&mut self, word: u64) -> &mut Self {
        self.bytes(&word.to_le_bytes())
    }

    /// Folds a float in, by its bits.
    pub fn float(&mut self, value: f64) -> &mut Self {
        self.word(value.to_bits())
    }

    /// The hash so far.
    #[must_use]
    pub fn value(&self) -> u64 {
        self.0.digest()
    }

    /// Back to the start.
    pub fn reset(&mut self) {
        self.0.reset();
    }
}
