//! The digest of a run. Two equal runs have the same digest, whichever of the two runtimes executed them.

use xxhash_rust::xxh3::Xxh3;

/// An incremental 64-bit hash (XXH3) over the data added so far.
#[derive(Clone)]
pub struct Digest(Xxh3);

impl Default for Digest {
    fn default() -> Self {
        Self(Xxh3::new())
    }
}

impl Digest {
    /// Extends the hash of a sequence of words by one word. The hash of the empty sequence is 0. This is cheaper than a
    /// [`Digest`] for short sequences.
    #[must_use]
    #[inline]
    pub fn chain(hash: u64, word: u64) -> u64 {
        xxhash_rust::xxh3::xxh3_64_with_seed(&word.to_le_bytes(), hash)
    }

    /// The hash of these bytes alone. This is cheaper than a [`Digest`] for few bytes.
    #[must_use]
    #[inline]
    pub fn of(bytes: &[u8]) -> u64 {
        xxhash_rust::xxh3::xxh3_64(bytes)
    }

    /// Adds bytes.
    pub fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.0.update(bytes);
        self
    }

    /// Adds an integer, as eight little-endian bytes.
    pub fn word(&mut self, word: u64) -> &mut Self {
        self.bytes(&word.to_le_bytes())
    }

    /// Adds a float by its bit pattern, so that 0.0 and −0.0 differ.
    pub fn float(&mut self, value: f64) -> &mut Self {
        self.word(value.to_bits())
    }

    /// The hash of everything added so far.
    #[must_use]
    pub fn value(&self) -> u64 {
        self.0.digest()
    }

    /// Returns to the initial state, in which no data has been added.
    pub fn reset(&mut self) {
        self.0.reset();
    }
}
