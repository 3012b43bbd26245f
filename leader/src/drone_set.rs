//! A set of drones: one bit per drone. A thousand drones keep one for every obstacle.

use skein_protocol::DroneId;
use std::fmt;

/// Drones, by the bits of their ids.
#[derive(Clone, Default)]
pub(crate) struct DroneSet {
    words: Vec<u64>,
}

/// The word and the bit of a drone.
fn place(drone: DroneId) -> (usize, u64) {
    (drone.index() / 64, 1 << (drone.0 % 64))
}

impl DroneSet {
    /// Adds a drone. The set takes memory up to its id.
    pub(crate) fn insert(&mut self, drone: DroneId) {
        let (word, bit) = place(drone);
        if word >= self.words.len() {
            self.words.resize(word + 1, 0);
        }
        self.words[word] |= bit;
    }

    /// Whether the drone is in the set.
    pub(crate) fn contains(&self, drone: DroneId) -> bool {
        let (word, bit) = place(drone);
        self.words.get(word).is_some_and(|bits| bits & bit != 0)
    }

    /// Number of drones in the set with lower ids than this one.
    pub(crate) fn rank(&self, drone: DroneId) -> usize {
        let (word, bit) = place(drone);
        let ones = |bits: &u64| bits.count_ones() as usize;
        let before: usize = self.words.iter().take(word).map(ones).sum();
        before + self.words.get(word).map_or(0, |bits| ones(&(bits & (bit - 1))))
    }

    /// Removes all drones.
    pub(crate) fn clear(&mut self) {
        self.words.clear();
    }

    fn iter(&self) -> impl Iterator<Item = DroneId> {
        (0..self.words.len() as u32 * 64).map(DroneId).filter(|&drone| self.contains(drone))
    }
}

impl fmt::Debug for DroneSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drones_that_were_added_are_in_the_set() {
        let mut set = DroneSet::default();
        for id in [3, 64, 63, 900, 3] {
            set.insert(DroneId(id));
        }
        assert_eq!(set.iter().map(|drone| drone.0).collect::<Vec<_>>(), [3, 63, 64, 900]);
        assert!(!set.contains(DroneId(4)) && !set.contains(DroneId(70_000)));
        let rank = |id| set.rank(DroneId(id));
        assert_eq!([0, 3, 4, 63, 64, 65, 900, 901, 70_000].map(rank), [0, 0, 1, 1, 2, 3, 3, 4, 4]);
    }
}
