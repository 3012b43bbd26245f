//! A block of memory for many entries that come and go.

use crate::growth::make_room;

/// No place.
pub(crate) const NONE: u32 = u32::MAX;

/// An entry that has room for a place, which it does not need any more once it is removed. So places that are free take no memory.
pub(crate) trait Linked {
    /// The place that was noted.
    fn link(&self) -> u32;

    /// Notes a place.
    fn set_link(&mut self, place: u32);
}

/// Entries, each at a place of its own until it is removed.
#[derive(Clone, Debug)]
pub(crate) struct Pool<T> {
    entries: Vec<T>,
    /// The place that was freed last, or [`NONE`]. Each free place is linked to the one that was freed before.
    free: u32,
}

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self { entries: Vec::new(), free: NONE }
    }
}

impl<T: Linked> Pool<T> {
    /// Adds an entry. Returns its place.
    pub(crate) fn add(&mut self, entry: T) -> u32 {
        if let Some(free) = self.entries.get_mut(self.free as usize) {
            let place = std::mem::replace(&mut self.free, free.link());
            *free = entry;
            return place;
        }
        make_room(&mut self.entries);
        self.entries.push(entry);
        (self.entries.len() - 1) as u32
    }

    /// The entry at a place that [`Self::add`] returned; `None` if it never did.
    #[inline]
    pub(crate) fn get(&self, place: u32) -> Option<&T> {
        self.entries.get(place as usize)
    }

    /// The entry at a place that [`Self::add`] returned, to be changed; `None` if it never did.
    #[inline]
    pub(crate) fn get_mut(&mut self, place: u32) -> Option<&mut T> {
        self.entries.get_mut(place as usize)
    }

    /// Removes the entry at a place. The place is used again.
    pub(crate) fn remove(&mut self, place: u32) {
        if let Some(entry) = self.entries.get_mut(place as usize) {
            entry.set_link(self.free);
            self.free = place;
        }
    }

    /// Number of places, free or not.
    #[cfg(test)]
    pub(crate) fn places(&self) -> usize {
        self.entries.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl Linked for u32 {
        fn link(&self) -> u32 {
            *self
        }

        fn set_link(&mut self, place: u32) {
            *self = place;
        }
    }

    #[test]
    fn an_entry_keeps_its_place_and_a_free_place_is_used_again() {
        let mut pool = Pool::default();
        let places = [1, 2, 3].map(|entry| pool.add(entry));
        pool.remove(places[0]);
        pool.remove(places[1]);
        assert_eq!([pool.add(4), pool.add(1)], [places[1], places[0]]);
        *pool.get_mut(places[2]).unwrap() += 10;
        assert_eq!(places.map(|place| *pool.get(place).unwrap()), [1, 4, 13]);
        assert_eq!((pool.get(3), pool.places()), (None, 3));
        (0..10_000).for_each(|entry| _ = pool.add(entry));
        assert!(pool.entries.capacity() < 11_000, "{}", pool.entries.capacity());
    }
}
