//! One entry per drone, such as its place in a queue: one block of memory, sorted by drone. It is read far more often than
//! added to, and additions mostly come in the order of ids.

use crate::drone_set::DroneSet;
use crate::growth::make_room;
use skein_protocol::DroneId;

/// An entry that belongs to one drone.
pub trait OfDrone {
    /// That drone. It must not change while the entry is in a roster.
    fn drone(&self) -> DroneId;
}

/// At most one entry per drone, by id.
#[derive(Clone, Debug)]
pub struct Roster<T> {
    entries: Vec<T>,
    /// The drones that have entries.
    drones: DroneSet,
}

impl<T> Default for Roster<T> {
    fn default() -> Self {
        Self { entries: Vec::new(), drones: DroneSet::default() }
    }
}

impl<T: PartialEq> PartialEq for Roster<T> {
    fn eq(&self, other: &Self) -> bool {
        self.entries == other.entries
    }
}

impl<T: OfDrone> Roster<T> {
    /// No entry yet, and room for so many.
    pub(crate) fn with_capacity(count: usize) -> Self {
        Self { entries: Vec::with_capacity(count), drones: DroneSet::default() }
    }

    /// The index of a drone's entry, or where it belongs. Finds it without a look at any entry.
    fn place(&self, drone: DroneId) -> Result<usize, usize> {
        let place = self.drones.rank(drone);
        if self.drones.contains(drone) { Ok(place) } else { Err(place) }
    }

    /// The entry of a drone.
    #[must_use]
    pub fn get(&self, drone: DroneId) -> Option<&T> {
        self.place(drone).ok().map(|place| &self.entries[place])
    }

    /// The entry of a drone, to be changed. Its drone must stay the same.
    pub fn get_mut(&mut self, drone: DroneId) -> Option<&mut T> {
        self.place(drone).ok().map(|place| &mut self.entries[place])
    }

    /// Whether a drone has an entry.
    #[must_use]
    pub fn contains(&self, drone: DroneId) -> bool {
        self.drones.contains(drone)
    }

    /// Adds an entry, unless its drone has one already. Returns the one that the drone has then.
    pub fn add(&mut self, part: T) -> &mut T {
        let place = self.place(part.drone()).unwrap_or_else(|place| {
            self.drones.insert(part.drone());
            make_room(&mut self.entries);
            self.entries.insert(place, part);
            place
        });
        &mut self.entries[place]
    }

    /// All entries, by drone.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &T> + Clone {
        self.entries.iter()
    }

    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Removes all entries.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.drones.clear();
    }
}

/// Of several entries of one drone the first one counts.
impl<T: OfDrone> FromIterator<T> for Roster<T> {
    fn from_iter<I: IntoIterator<Item = T>>(parts: I) -> Self {
        let parts = parts.into_iter();
        let mut roster = Self::with_capacity(parts.size_hint().0);
        for part in parts {
            roster.add(part);
        }
        roster
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Place {
        drone: DroneId,
        rank: u16,
    }

    impl OfDrone for Place {
        fn drone(&self) -> DroneId {
            self.drone
        }
    }

    fn part(drone: u32, rank: u16) -> Place {
        Place { drone: DroneId(drone), rank }
    }

    #[test]
    fn entries_are_sorted_by_drone_and_the_first_of_each_drone_counts() {
        let mut roster: Roster<Place> =
            [part(5, 0), part(1, 1), part(9, 2), part(5, 3), part(3, 4)].into_iter().collect();
        let all = |roster: &Roster<Place>| roster.iter().map(|p| (p.drone.0, p.rank)).collect::<Vec<_>>();
        assert_eq!(all(&roster), [(1, 1), (3, 4), (5, 0), (9, 2)]);
        assert_eq!(roster.add(part(3, 7)).rank, 4);
        assert_eq!(roster.add(part(10, 8)).rank, 8);
        assert!(roster.contains(DroneId(9)) && !roster.contains(DroneId(4)) && roster.get(DroneId(11)).is_none());
        assert_eq!(all(&roster), [(1, 1), (3, 4), (5, 0), (9, 2), (10, 8)]);
    }

    #[test]
    fn every_entry_is_found_however_the_drones_are_spread() {
        let spreads: [fn(u32) -> bool; 6] =
            [|_| true, |id| id != 7, |id| id % 2 == 1, |id| id % 3 == 0, |id| !(4..37).contains(&id), |id| id == 39];
        for is_in in spreads {
            let drones: Vec<u32> = (0..40).filter(|id| is_in(*id)).collect();
            let mut roster: Roster<Place> = drones.iter().map(|id| part(*id, *id as u16)).collect();
            for id in 0..45 {
                assert_eq!(roster.get(DroneId(id)).map(|entry| entry.drone.0), drones.contains(&id).then_some(id));
            }
            (0..45).rev().for_each(|id| _ = roster.add(part(id, 0)));
            assert!(roster.iter().map(|entry| entry.drone.0).eq(0..45));
        }
    }
}
