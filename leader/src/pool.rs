//! A block of memory for many entries that come and go.

/// The block grows by room for this part of its entries, so little of it is not used. No unit. By hand.
const GROWTH: usize = 16;

/// Entries, each at a place of its own until it is removed.
#[derive(Clone, Debug)]
pub(crate) struct Pool<T> {
    entries: Vec<T>,
    /// The places that are free.
    free: Vec<u32>,
}

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self { entries: Vec::new(), free: Vec::new() }
    }
}

impl<T> Pool<T> {
    /// Adds an entry. Returns its place.
    pub(crate) fn add(&mut self, entry: T) -> u32 {
        if let Some(place) = self.free.pop() {
            self.entries[place as usize] = entry;
            return place;
        }
        if self.entries.len() == self.entries.capacity() {
            self.entries.reserve_exact(self.entries.len() / GROWTH + 8);
        }
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
        self.free.push(place);
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

    #[test]
    fn an_entry_keeps_its_place_and_a_free_place_is_used_again() {
        let mut pool = Pool::default();
        let places = [1, 2, 3].map(|entry| pool.add(entry));
        pool.remove(places[1]);
        assert_eq!(pool.add(4), places[1]);
        *pool.get_mut(places[2]).unwrap() += 10;
        assert_eq!(places.map(|place| *pool.get(place).unwrap()), [1, 4, 13]);
        assert_eq!((pool.get(3), pool.places()), (None, 3));
        (0..10_000).for_each(|entry| _ = pool.add(entry));
        assert!(pool.entries.capacity() < 11_000, "{}", pool.entries.capacity());
    }
}
