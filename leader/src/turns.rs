//! What is to be looked at, in the order of its turns.

use skein_protocol::SimTime;
use std::collections::BTreeMap;

/// A turn that is full gets room for so many more subjects. By hand: most turns get several, and each list is short-lived.
const MORE: usize = 4;

/// Subjects by their turns. Most subjects share a turn with others, so they are kept in one block of memory per turn. The first turn is kept
/// apart, so that a look in vain touches little memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Turns<S> {
    first: SimTime,
    /// By turn: its subjects, the last one first.
    turns: BTreeMap<SimTime, Vec<S>>,
}

impl<S> Default for Turns<S> {
    fn default() -> Self {
        Self { first: SimTime::MAX, turns: BTreeMap::new() }
    }
}

impl<S: Ord + Copy> Turns<S> {
    /// Adds a turn of a subject.
    pub(crate) fn add(&mut self, turn: SimTime, subject: S) {
        self.first = self.first.min(turn);
        let subjects = self.turns.entry(turn).or_default();
        if let Err(place) = place(subjects, &subject) {
            if subjects.len() == subjects.capacity() {
                subjects.reserve_exact(MORE);
            }
            subjects.insert(place, subject);
        }
    }

    /// Removes a turn of a subject.
    pub(crate) fn remove(&mut self, turn: SimTime, subject: S) {
        let Some(subjects) = self.turns.get_mut(&turn) else { return };
        if let Ok(place) = place(subjects, &subject) {
            subjects.remove(place);
        }
        if subjects.is_empty() {
            self.turns.remove(&turn);
            self.find_first();
        }
    }

    /// Removes and returns the subject whose turn comes first, if it has come.
    pub(crate) fn take_due(&mut self, now: SimTime) -> Option<S> {
        if now < self.first {
            return None;
        }
        let mut next = self.turns.first_entry()?;
        let due = next.get_mut().pop();
        if next.get().is_empty() {
            next.remove();
            self.find_first();
        }
        due
    }

    /// The subject whose turn comes first, if it has come.
    pub(crate) fn first_due(&self, now: SimTime) -> Option<S> {
        self.due(now).next()
    }

    /// The subjects whose turn has come, the first ones first.
    pub(crate) fn due(&self, now: SimTime) -> impl Iterator<Item = S> {
        let some = if now < self.first { 0 } else { self.turns.len() };
        let due = self.turns.iter().take(some).take_while(move |(turn, _)| **turn <= now);
        due.flat_map(|(_, subjects)| subjects.iter().rev().copied())
    }

    /// Removes the turns of all other subjects.
    pub(crate) fn retain(&mut self, stays: impl Fn(&S) -> bool) {
        self.turns.retain(|_, subjects| {
            subjects.retain(&stays);
            !subjects.is_empty()
        });
        self.find_first();
    }

    /// Removes all turns.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    fn find_first(&mut self) {
        self.first = self.turns.first_key_value().map_or(SimTime::MAX, |(turn, _)| *turn);
    }
}

/// The index of a subject among these, the last one first, or where it belongs.
fn place<S: Ord>(subjects: &[S], subject: &S) -> Result<usize, usize> {
    subjects.binary_search_by(|other| subject.cmp(other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subjects_come_in_the_order_of_their_turns_and_not_before() {
        let mut turns = Turns::default();
        for (turn, subject) in [(5, 'c'), (3, 'b'), (3, 'a'), (9, 'd'), (2, 'x'), (1, 'y')] {
            turns.add(SimTime(turn), subject);
        }
        turns.remove(SimTime(1), 'y');
        turns.retain(|subject| *subject != 'x');
        let coming = |now| turns.due(SimTime(now)).collect::<String>();
        assert_eq!([coming(2), coming(3), coming(5)], ["", "ab", "abc"]);
        let mut due = |now| std::iter::from_fn(|| turns.take_due(SimTime(now))).collect::<String>();
        assert_eq!([due(2), due(3), due(4), due(8), due(100), due(100)], ["", "ab", "", "c", "d", ""]);
        turns.add(SimTime(4), 'z');
        turns.clear();
        assert_eq!((turns.take_due(SimTime(4)), &turns), (None, &Turns::default()));
    }
}
