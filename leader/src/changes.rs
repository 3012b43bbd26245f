//! Which peers were heard since a reader last looked.

use std::fmt;

/// Number of neighbouring indices that are counted as one. Small, so that few peers are looked at in vain.
pub const BLOCK: usize = 8;

/// Counts the changes of each block of [`BLOCK`] indices. A reader that remembers the counts need not look at blocks whose counts are
/// the same.
#[derive(Clone, Default)]
pub struct Changes(Vec<u32>);

impl Changes {
    /// The counts, by block. They wrap around.
    #[must_use]
    pub fn counts(&self) -> &[u32] {
        &self.0
    }

    /// Notes that the entry at this index changed.
    pub fn note(&mut self, index: usize) {
        if let Some(count) = self.0.get_mut(index / BLOCK) {
            *count = count.wrapping_add(1);
        }
    }

    /// Notes that the entries from this index on moved, and that there are `len` entries now.
    pub fn note_from(&mut self, index: usize, len: usize) {
        self.0.resize(len.div_ceil(BLOCK), 0);
        self.0.iter_mut().skip(index / BLOCK).for_each(|count| *count = count.wrapping_add(1));
    }
}

/// The counts say nothing about the state of the machine, so they are not shown: the model check compares states by what is shown.
impl fmt::Debug for Changes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Changes")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_block_of_a_change_is_counted_and_all_blocks_behind_an_entry_that_moved() {
        let mut changes = Changes::default();
        changes.note_from(0, 3 * BLOCK);
        let before = changes.counts().to_vec();
        changes.note(2 * BLOCK - 1);
        let differs = |now: &[u32]| now.iter().zip(&before).map(|(a, b)| a != b).collect::<Vec<_>>();
        assert_eq!(differs(changes.counts()), [false, true, false]);
        changes.note_from(2 * BLOCK, 3 * BLOCK + 1);
        assert_eq!((differs(changes.counts()), changes.counts().len()), (vec![false, true, true], 4));
        changes.note(100 * BLOCK);
    }
}
