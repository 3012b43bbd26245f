//! Where a drone keeps what it may pass on. A large swarm has a thousand assignments and passages: each is found by its drone, without a
//! search.

use crate::subject::Subject;
use skein_protocol::{DroneId, GroupId, prefetch};
use std::collections::BTreeMap;

/// At most one entry per subject.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FactStore<T> {
    drones: u32,
    /// By drone: what is about it. These are few.
    of_drones: Vec<Vec<(Subject, T)>>,
    /// What is about no drone of the swarm.
    others: BTreeMap<Subject, T>,
    /// Number of entries.
    len: usize,
}

impl<T> FactStore<T> {
    /// No entry, in a swarm of `drones`.
    pub(crate) fn new(drones: u32) -> Self {
        Self { drones, of_drones: Vec::new(), others: BTreeMap::new(), len: 0 }
    }

    /// Number of entries.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The index of the drone of the swarm that a subject is about.
    fn drone(&self, subject: &Subject) -> Option<usize> {
        subject.drone().filter(|drone| drone.0 < self.drones).map(DroneId::index)
    }

    /// The entry of a subject.
    pub(crate) fn get_mut(&mut self, subject: &Subject) -> Option<&mut T> {
        let Some(drone) = self.drone(subject) else { return self.others.get_mut(subject) };
        let mut entries = self.of_drones.get_mut(drone)?.iter_mut();
        entries.find(|(about, _)| about == subject).map(|(_, entry)| entry)
    }

    /// Whether a subject has an entry.
    pub(crate) fn contains(&self, subject: &Subject) -> bool {
        let Some(drone) = self.drone(subject) else { return self.others.contains_key(subject) };
        self.of_drones.get(drone).is_some_and(|entries| entries.iter().any(|(about, _)| about == subject))
    }

    /// Fetches what is about a drone into the cache.
    #[inline]
    pub(crate) fn warm(&self, drone: DroneId) {
        self.of_drones.get(drone.index()).into_iter().for_each(|entries| prefetch(entries.as_slice()));
    }

    /// Adds an entry, or replaces the one of the same subject.
    pub(crate) fn insert(&mut self, subject: Subject, entry: T) {
        if let Some(known) = self.get_mut(&subject) {
            *known = entry;
            return;
        }
        self.len += 1;
        let Some(drone) = self.drone(&subject) else {
            self.others.insert(subject, entry);
            return;
        };
        if self.of_drones.len() <= drone {
            self.of_drones.resize_with(drone + 1, Vec::new);
        }
        let entries = &mut self.of_drones[drone];
        // Mostly there is one.
        entries.reserve_exact(1);
        entries.push((subject, entry));
    }

    /// The assignments of a drone of the swarm, and the groups for which the plans are.
    pub(crate) fn parts_of(&mut self, drone: DroneId) -> impl Iterator<Item = (GroupId, &mut T)> {
        let entries = self.of_drones.get_mut(drone.index()).into_iter().flatten();
        entries.filter_map(|(about, entry)| match *about {
            Subject::Part(scope, _) => Some((scope, entry)),
            _ => None,
        })
    }

    /// Removes all other entries. Returns whether any was removed.
    pub(crate) fn retain(&mut self, mut stays: impl FnMut(&T) -> bool) -> bool {
        let before = self.len;
        self.others.retain(|_, entry| stays(entry));
        self.of_drones.iter_mut().for_each(|entries| entries.retain(|(_, entry)| stays(entry)));
        self.len = self.others.len() + self.of_drones.iter().map(Vec::len).sum::<usize>();
        self.len < before
    }

    /// Removes all entries.
    pub(crate) fn clear(&mut self) {
        *self = Self::new(self.drones);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_subject_has_one_entry_and_the_entries_of_a_drone_are_found() {
        let (all, first) = (GroupId::ALL, GroupId::ALL.child(1));
        let mut store = FactStore::new(10);
        let subjects = [
            Subject::Plan(all),
            Subject::Part(first, DroneId(9)),
            Subject::Part(all, DroneId(9)),
            Subject::Part(all, DroneId(2)),
            Subject::Part(all, DroneId(u32::MAX)),
            Subject::Passed(DroneId(9)),
        ];
        subjects.into_iter().zip(0..).for_each(|(subject, entry)| store.insert(subject, entry));
        store.insert(subjects[3], 7);
        assert_eq!(store.len(), 6);
        assert_eq!(subjects.map(|subject| store.get_mut(&subject).copied()), [0, 1, 2, 7, 4, 5].map(Some));
        assert_eq!(store.get_mut(&Subject::Part(first, DroneId(2))), None);
        assert_eq!(
            store.parts_of(DroneId(9)).map(|(scope, entry)| (scope, *entry)).collect::<Vec<_>>(),
            [(first, 1), (all, 2)]
        );
        assert!(!store.retain(|_| true));
        assert!(store.retain(|entry| entry % 2 == 1));
        assert_eq!(subjects.map(|subject| store.contains(&subject)), [false, true, false, true, false, true]);
        assert_eq!(store.len(), 3);
        store.clear();
        assert_eq!((store.len(), store.contains(&subjects[1])), (0, false));
    }
}
