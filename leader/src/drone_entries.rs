//! A few entries about each drone, in one block of memory. A drone of a swarm of a thousand keeps thousands of them.

use crate::pool::{Linked, NONE, Pool};
use skein_protocol::{DroneId, prefetch};

/// Any number of entries about each drone. Those of a drone are found by a look at each of them.
#[derive(Clone, Debug)]
pub(crate) struct DroneEntries<T> {
    drones: u32,
    /// By drone: the place of its newest entry, or [`NONE`]. Empty before the first entry.
    newest: Vec<u32>,
    entries: Pool<Chained<T>>,
    /// Number of entries.
    len: usize,
}

/// An entry, and the place of the next one about the same drone, or [`NONE`].
#[derive(Clone, Debug)]
struct Chained<T> {
    entry: T,
    next: u32,
}

impl<T> Linked for Chained<T> {
    fn link(&self) -> u32 {
        self.next
    }

    fn set_link(&mut self, place: u32) {
        self.next = place;
    }
}

impl<T> DroneEntries<T> {
    /// No entry, in a swarm of `drones`.
    pub(crate) fn new(drones: u32) -> Self {
        Self { drones, newest: Vec::new(), entries: Pool::default(), len: 0 }
    }

    /// Number of entries.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The place of the newest entry about a drone, or [`NONE`].
    fn newest(&self, drone: DroneId) -> u32 {
        self.newest.get(drone.index()).copied().unwrap_or(NONE)
    }

    /// The entries about a drone, newest first, with their places.
    fn chain(&self, drone: DroneId) -> impl Iterator<Item = (u32, &Chained<T>)> {
        let at = |place: u32| self.entries.get(place).map(|chained| (place, chained));
        std::iter::successors(at(self.newest(drone)), move |(_, chained)| at(chained.next))
    }

    /// The entries about a drone, newest first.
    pub(crate) fn of(&self, drone: DroneId) -> impl Iterator<Item = &T> {
        self.chain(drone).map(|(_, chained)| &chained.entry)
    }

    /// The newest of the entries about a drone that `is_it` chooses.
    pub(crate) fn find_mut(&mut self, drone: DroneId, is_it: impl Fn(&T) -> bool) -> Option<&mut T> {
        let (place, _) = self.chain(drone).find(|(_, chained)| is_it(&chained.entry))?;
        self.entries.get_mut(place).map(|chained| &mut chained.entry)
    }

    /// Changes all entries about a drone, newest first.
    pub(crate) fn change(&mut self, drone: DroneId, mut change: impl FnMut(&mut T)) {
        let mut place = self.newest(drone);
        while let Some(chained) = self.entries.get_mut(place) {
            change(&mut chained.entry);
            place = chained.next;
        }
    }

    /// Puts an entry about a drone of the swarm in place of the newest one that `is_it` chooses, and returns that one.
    pub(crate) fn put(&mut self, drone: DroneId, is_it: impl Fn(&T) -> bool, entry: T) -> Option<T> {
        if let Some(old) = self.find_mut(drone, is_it) {
            return Some(std::mem::replace(old, entry));
        }
        if self.newest.is_empty() {
            self.newest = vec![NONE; self.drones as usize];
        }
        let newest = self.newest.get_mut(drone.index())?;
        *newest = self.entries.add(Chained { entry, next: *newest });
        self.len += 1;
        None
    }

    /// Removes all other entries.
    pub(crate) fn retain(&mut self, mut stays: impl FnMut(DroneId, &T) -> bool) {
        for (drone, newest) in (0..).map(DroneId).zip(&mut self.newest) {
            let (mut kept, mut place) = (NONE, std::mem::replace(newest, NONE));
            while let Some(chained) = self.entries.get_mut(place) {
                let next = std::mem::replace(&mut chained.next, NONE);
                if !stays(drone, &chained.entry) {
                    self.entries.remove(place);
                    self.len -= 1;
                } else {
                    // Those that stay keep their order.
                    let before = self.entries.get_mut(kept).map_or(&mut *newest, |before| &mut before.next);
                    *before = place;
                    kept = place;
                }
                place = next;
            }
        }
        if self.len == 0 {
            self.clear();
        }
    }

    /// Removes all entries, and gives their memory back.
    pub(crate) fn clear(&mut self) {
        *self = Self::new(self.drones);
    }

    /// Fetches the newest entry about a drone into the cache.
    #[inline]
    pub(crate) fn warm(&self, drone: DroneId) {
        self.entries.get(self.newest(drone)).into_iter().for_each(prefetch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_entries_of_each_drone_are_those_that_were_added_and_not_removed() {
        let mut all = DroneEntries::new(10);
        let mut expected: [Vec<u32>; 10] = std::array::from_fn(|_| Vec::new());
        let mut most = 0;
        for step in 0..3000_u32 {
            let draw = step.wrapping_mul(0x9e37_79b9) >> 16;
            let drone = DroneId(draw % 10);
            match draw % 7 {
                0 => {
                    let stays = |entry: &u32| !(entry + draw).is_multiple_of(3);
                    all.retain(|_, entry| stays(entry));
                    expected.iter_mut().for_each(|entries| entries.retain(stays));
                }
                1 => {
                    all.change(drone, |entry| *entry += 1);
                    expected[drone.index()].iter_mut().for_each(|entry| *entry += 1);
                }
                2 => {
                    let found = all.find_mut(drone, |entry| entry % 2 == 0);
                    let wanted = expected[drone.index()].iter_mut().find(|entry| **entry % 2 == 0);
                    assert_eq!(found, wanted);
                }
                3 => {
                    let old = all.put(drone, |entry| entry % 5 < 2, step);
                    let place = expected[drone.index()].iter().position(|entry| entry % 5 < 2);
                    assert_eq!(old, place.map(|place| expected[drone.index()].remove(place)));
                    expected[drone.index()].insert(place.unwrap_or(0), step);
                }
                _ => {
                    assert_eq!(all.put(drone, |_| false, step), None);
                    expected[drone.index()].insert(0, step);
                }
            }
            for (drone, expected) in (0..).map(DroneId).zip(&expected) {
                assert!(all.of(drone).eq(expected), "{drone:?} at {step}");
            }
            let len = expected.iter().map(Vec::len).sum();
            assert_eq!(all.len(), len);
            most = most.max(len);
        }
        let places = all.entries.places();
        assert!(most > 20 && places <= most, "what was removed is used again: {places} of {most}");
        all.put(DroneId(10), |_| true, 0);
        assert_eq!(all.of(DroneId(10)).count(), 0, "no drone of the swarm");
        all.retain(|_, _| false);
        assert_eq!((all.len(), all.entries.places(), all.newest.capacity()), (0, 0, 0));
    }
}
