//! Where a drone keeps what it may pass on. A large swarm has a thousand assignments: each is found by its drone, without a search.

use crate::subject::Subject;
use skein_protocol::{DroneId, GroupId, SimTime};
use std::collections::BTreeMap;
use std::hint::black_box;

/// At most one entry per subject.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FactStore<T> {
    drones: u32,
    /// By drone: its assignments in the plans for these groups. They are few.
    parts: Vec<Vec<(GroupId, T)>>,
    /// All others, and assignments of no drone of the swarm.
    others: BTreeMap<Subject, T>,
    /// Number of entries.
    len: usize,
}

impl<T> FactStore<T> {
    /// No entry, in a swarm of `drones`.
    pub(crate) fn new(drones: u32) -> Self {
        Self { drones, parts: Vec::new(), others: BTreeMap::new(), len: 0 }
    }

    /// Number of entries.
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    /// The drone and the group, if this is the assignment of a drone of the swarm.
    fn part(&self, subject: &Subject) -> Option<(DroneId, GroupId)> {
        match *subject {
            Subject::Part(scope, drone) if drone.0 < self.drones => Some((drone, scope)),
            _ => None,
        }
    }

    /// The entry of a subject.
    pub(crate) fn get_mut(&mut self, subject: &Subject) -> Option<&mut T> {
        let Some((drone, scope)) = self.part(subject) else { return self.others.get_mut(subject) };
        self.parts_of(drone).find(|(of, _)| *of == scope).map(|(_, entry)| entry)
    }

    /// Whether a subject has an entry.
    pub(crate) fn contains(&self, subject: &Subject) -> bool {
        let Some((drone, scope)) = self.part(subject) else { return self.others.contains_key(subject) };
        self.parts.get(drone.index()).is_some_and(|parts| parts.iter().any(|(of, _)| *of == scope))
    }

    /// Reads something of the assignments of a drone, so that they are in the cache.
    #[inline]
    pub(crate) fn warm(&self, drone: DroneId, read: impl Fn(&T) -> SimTime) {
        black_box(self.parts.get(drone.index()).and_then(|parts| parts.first()).map(|(_, entry)| read(entry)));
    }

    /// Adds an entry, or replaces the one of the same subject.
    pub(crate) fn insert(&mut self, subject: Subject, entry: T) {
        if let Some(known) = self.get_mut(&subject) {
            *known = entry;
            return;
        }
        self.len += 1;
        let Some((drone, scope)) = self.part(&subject) else {
            self.others.insert(subject, entry);
            return;
        };
        if self.parts.len() <= drone.index() {
            self.parts.resize_with(drone.index() + 1, Vec::new);
        }
        let parts = &mut self.parts[drone.index()];
        // Mostly there is one.
        parts.reserve_exact(1);
        parts.push((scope, entry));
    }

    /// The assignments of a drone of the swarm, and the groups for which the plans are.
    pub(crate) fn parts_of(&mut self, drone: DroneId) -> impl Iterator<Item = (GroupId, &mut T)> {
        self.parts.get_mut(drone.index()).into_iter().flatten().map(|(scope, entry)| (*scope, entry))
    }

    /// Removes all other entries.
    pub(crate) fn retain(&mut self, stays: impl Fn(&T) -> bool) {
        self.others.retain(|_, entry| stays(entry));
        self.parts.iter_mut().for_each(|parts| parts.retain(|(_, entry)| stays(entry)));
        self.len = self.others.len() + self.parts.iter().map(Vec::len).sum::<usize>();
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
        store.retain(|entry| entry % 2 == 1);
        assert_eq!(subjects.map(|subject| store.contains(&subject)), [false, true, false, true, false, true]);
        assert_eq!(store.len(), 3);
        store.clear();
        assert_eq!((store.len(), store.contains(&subjects[1])), (0, false));
    }
}
