//! Which peers were heard since a reader last looked.

use std::fmt;

/// The log has room for one change per this number of entries. A reader that missed more looks at all entries.
const ENTRIES_PER_CHANGE: usize = 2;

/// The indices at which entries changed lately. Each reader remembers [`Self::count`] and asks for what came after it.
#[derive(Clone, Default)]
pub struct Changes {
    /// Number of changes so far.
    count: usize,
    /// The number of changes after which the indices last moved.
    moved: usize,
    /// The last changes. The place of a change is its number modulo the length, which is a power of two.
    log: Vec<u32>,
}

impl Changes {
    /// Number of changes so far.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The indices of the changes after the first `count`, oldest first. An index may come more than once. `None` if a reader has to
    /// look at all entries: too much has changed, or entries have moved.
    #[must_use]
    pub fn since(&self, count: usize) -> Option<impl Iterator<Item = usize>> {
        let known = self.moved.max(self.count.saturating_sub(self.log.len()));
        let place = |number: usize| self.log[number & (self.log.len() - 1)] as usize;
        (count >= known).then(|| (count..self.count).map(place))
    }

    /// Notes that the entry at this index changed.
    #[inline]
    pub fn note(&mut self, index: usize) {
        let last = self.log.len().wrapping_sub(1);
        if let Some(place) = self.log.get_mut(self.count & last) {
            *place = index as u32;
        }
        self.count += 1;
    }

    /// Notes that entries moved, and that there are `len` entries now.
    pub fn note_moved(&mut self, len: usize) {
        self.count += 1;
        self.moved = self.count;
        let room = len.div_ceil(ENTRIES_PER_CHANGE).next_power_of_two();
        if room > self.log.len() {
            self.log.resize(room, 0);
        }
    }
}

/// The log says nothing about the state of the machine, so it is not shown: the model check compares states by what is shown.
impl fmt::Debug for Changes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Changes")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn since(changes: &Changes, count: usize) -> Option<Vec<usize>> {
        changes.since(count).map(Iterator::collect)
    }

    #[test]
    fn a_reader_learns_of_each_change_or_that_it_has_missed_some() {
        let mut changes = Changes::default();
        assert_eq!(since(&changes, 0), Some(Vec::new()));
        changes.note_moved(8);
        assert_eq!(since(&changes, 0), None, "entries have moved");
        let start = changes.count();
        [7, 2, 7].into_iter().for_each(|index| changes.note(index));
        assert_eq!(since(&changes, start), Some(vec![7, 2, 7]));
        assert_eq!(since(&changes, start + 2), Some(vec![7]));
        changes.note(0);
        assert_eq!(since(&changes, start), Some(vec![7, 2, 7, 0]));
        changes.note(5);
        assert_eq!(since(&changes, start), None, "the log has room for four");
        assert_eq!(since(&changes, start + 1), Some(vec![2, 7, 0, 5]));
        changes.note_moved(9);
        assert_eq!(since(&changes, start + 1), None);
        assert_eq!(since(&changes, changes.count()), Some(Vec::new()));
    }
}
