//! Where a drone keeps what it may pass on. A large swarm has a thousand assignments and passages: each is found by its drone, without a
//! search, and takes little memory.

use crate::drone_entries::DroneEntries;
use crate::fact_values::{Fact, FactValues, Passage, Version};
use crate::packed_assignment::PackedPlace;
use crate::subject::Subject;
use skein_protocol::payload::{Arrivals, Assignment, Plan};
use skein_protocol::{DroneId, GroupId, Message, MessageRef};
use std::collections::BTreeMap;

/// At most one fact per subject, each with what `T` says of it.
#[derive(Clone, Debug)]
pub(crate) struct FactStore<T> {
    values: FactValues,
    parts: DroneEntries<Kept<PackedPlace, T>>,
    passages: DroneEntries<Kept<Passage, T>>,
    plans: BTreeMap<GroupId, Kept<Plan, T>>,
    arrivals: BTreeMap<Subject, Kept<Arrivals, T>>,
}

/// A fact, and what is kept with it.
#[derive(Clone, Copy, Debug)]
struct Kept<F, T> {
    fact: F,
    with: T,
}

/// What is known about a subject.
#[derive(Debug)]
pub(crate) struct Known<'a, T> {
    values: &'a FactValues,
    fact: Fact<'a>,
    /// What is kept with the fact.
    pub(crate) with: &'a mut T,
}

impl<T> Known<'_, T> {
    /// What the message said, in little memory.
    pub(crate) fn fact(&self) -> Fact<'_> {
        self.fact
    }

    /// Its version.
    pub(crate) fn version(&self) -> Version {
        self.values.version(self.fact)
    }

    /// The assignment that it is, if it is one.
    pub(crate) fn assignment(&self) -> Option<Assignment> {
        self.values.assignment_of(self.fact)
    }

    /// The message that passes it on. `subject`: what it is about.
    pub(crate) fn passed_on(&self, subject: Subject) -> Option<Message> {
        self.values.passed_on(self.fact, subject)
    }

    /// Whether it is that a drone has passed the same obstacles as this message reports.
    pub(crate) fn is_same_passage(&self, heard: MessageRef<'_>) -> bool {
        self.values.is_same_passage(self.fact, heard)
    }
}

impl<T: Copy> FactStore<T> {
    /// Nothing, in a swarm of `drones`.
    pub(crate) fn new(drones: u32) -> Self {
        Self {
            values: FactValues::default(),
            parts: DroneEntries::new(drones),
            passages: DroneEntries::new(drones),
            plans: BTreeMap::new(),
            arrivals: BTreeMap::new(),
        }
    }

    /// Number of facts.
    pub(crate) fn len(&self) -> usize {
        self.parts.len() + self.passages.len() + self.plans.len() + self.arrivals.len()
    }

    /// What is known about a subject.
    pub(crate) fn get_mut(&mut self, subject: &Subject) -> Option<Known<'_, T>> {
        let values = &self.values;
        let (fact, with) = match *subject {
            Subject::Plan(scope) => {
                let kept = self.plans.get_mut(&scope)?;
                (Fact::Plan(&kept.fact), &mut kept.with)
            }
            Subject::Part(scope, drone) => {
                let kept = self.parts.find_mut(drone, |kept| values.scope(&kept.fact) == scope)?;
                (Fact::Part(drone, kept.fact), &mut kept.with)
            }
            Subject::Arrivals(..) => {
                let kept = self.arrivals.get_mut(subject)?;
                (Fact::Arrivals(&kept.fact), &mut kept.with)
            }
            Subject::Passed(drone) => {
                let kept = self.passages.find_mut(drone, |_| true)?;
                (Fact::Passed(kept.fact), &mut kept.with)
            }
        };
        Some(Known { values, fact, with })
    }

    /// Whether something is known about a subject.
    pub(crate) fn contains(&self, subject: &Subject) -> bool {
        match *subject {
            Subject::Plan(scope) => self.plans.contains_key(&scope),
            Subject::Part(scope, drone) => self.parts.of(drone).any(|kept| self.values.scope(&kept.fact) == scope),
            Subject::Arrivals(..) => self.arrivals.contains_key(subject),
            Subject::Passed(drone) => self.passages.of(drone).next().is_some(),
        }
    }

    /// Fetches what is about a drone into the cache.
    #[inline]
    pub(crate) fn warm(&self, subject: &Subject) {
        match *subject {
            Subject::Part(_, drone) => self.parts.warm(drone),
            Subject::Passed(drone) => self.passages.warm(drone),
            Subject::Plan(_) | Subject::Arrivals(..) => {}
        }
    }

    /// Keeps what a message says about a subject, in place of what was known about it. Returns what was kept with that.
    pub(crate) fn keep(&mut self, subject: Subject, message: MessageRef<'_>, with: T) -> Option<T> {
        let values = &mut self.values;
        match (subject, message) {
            (Subject::Plan(scope), MessageRef::Plan(&fact)) => {
                self.plans.insert(scope, Kept { fact, with }).map(|old| old.with)
            }
            (Subject::Part(scope, drone), MessageRef::Assignment(part)) => {
                let kept = Kept { fact: values.keep_part(part), with };
                let old = self.parts.put(drone, |kept| values.scope(&kept.fact) == scope, kept)?;
                values.release_part(&old.fact);
                Some(old.with)
            }
            (Subject::Arrivals(..), MessageRef::Arrivals(&fact)) => {
                self.arrivals.insert(subject, Kept { fact, with }).map(|old| old.with)
            }
            (Subject::Passed(drone), MessageRef::Passed(passed)) => {
                let kept = Kept { fact: values.keep_passage(passed), with };
                let old = self.passages.put(drone, |_| true, kept)?;
                values.release_passage(&old.fact);
                Some(old.with)
            }
            // No other message is passed on.
            _ => None,
        }
    }

    /// Changes what is kept with the assignments of a drone. `change` is also told for which group the plan is.
    pub(crate) fn change_parts_of(&mut self, drone: DroneId, mut change: impl FnMut(GroupId, &mut T)) {
        let values = &self.values;
        self.parts.change(drone, |kept| change(values.scope(&kept.fact), &mut kept.with));
    }

    /// Removes all other facts. Returns whether any was removed.
    pub(crate) fn retain(&mut self, mut stays: impl FnMut(Fact<'_>, &T) -> bool) -> bool {
        let before = self.len();
        let values = &mut self.values;
        self.plans.retain(|_, kept| stays(Fact::Plan(&kept.fact), &kept.with));
        self.arrivals.retain(|_, kept| stays(Fact::Arrivals(&kept.fact), &kept.with));
        self.parts.retain(|drone, kept| {
            let stays = stays(Fact::Part(drone, kept.fact), &kept.with);
            if !stays {
                values.release_part(&kept.fact);
            }
            stays
        });
        self.passages.retain(|_, kept| {
            let stays = stays(Fact::Passed(kept.fact), &kept.with);
            if !stays {
                values.release_passage(&kept.fact);
            }
            stays
        });
        self.len() < before
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.values = FactValues::default();
        self.parts.clear();
        self.passages.clear();
        self.plans.clear();
        self.arrivals.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::payload::Passed;

    fn part(drone: u32, scope: GroupId, rank: u16) -> (Subject, Assignment) {
        let part = Assignment { drone: DroneId(drone), scope, rank, ..Assignment::zeroed() };
        (Subject::Part(scope, part.drone), part)
    }

    #[test]
    fn each_subject_has_one_fact_and_the_assignments_of_a_drone_are_found() {
        let (all, first) = (GroupId::ALL, GroupId::ALL.child(1));
        let mut store: FactStore<u32> = FactStore::new(10);
        let parts = [part(9, first, 1), part(9, all, 2), part(2, all, 3)];
        for ((subject, part), with) in parts.iter().zip(1..) {
            assert_eq!(store.keep(*subject, MessageRef::Assignment(part), with), None);
        }
        let (plan, row, passed) = (Plan::zeroed(), Arrivals::zeroed(), Passed::zeroed());
        let others = [Subject::Plan(all), Subject::Arrivals(0, DroneId(2)), Subject::Passed(DroneId(9))];
        let messages = [MessageRef::Plan(&plan), MessageRef::Arrivals(&row), MessageRef::Passed(&passed)];
        for ((subject, message), with) in others.into_iter().zip(messages).zip(4..) {
            assert_eq!(store.keep(subject, message, with), None);
            assert_eq!(store.keep(subject, message, with), Some(with));
        }
        let (subject, later) = part(2, all, 7);
        assert_eq!(store.keep(subject, MessageRef::Assignment(&later), 30), Some(3));
        assert_eq!(store.len(), 6);
        let subjects = [parts[0].0, parts[1].0, parts[2].0, others[0], others[1], others[2]];
        assert_eq!(subjects.map(|subject| *store.get_mut(&subject).unwrap().with), [1, 2, 30, 4, 5, 6]);
        assert_eq!(store.get_mut(&subject).unwrap().assignment(), Some(later));
        assert!(store.get_mut(&part(2, first, 0).0).is_none());
        let mut found = Vec::new();
        store.change_parts_of(DroneId(9), |scope, with| found.push((scope, *with)));
        assert_eq!(found, [(all, 2), (first, 1)]);
        assert!(!store.retain(|_, _| true));
        assert!(store.retain(|fact, with| matches!(fact, Fact::Part(..)) && with % 2 == 0));
        assert_eq!(subjects.map(|subject| store.contains(&subject)), [false, true, true, false, false, false]);
        store.clear();
        assert_eq!((store.len(), store.contains(&subjects[1])), (0, false));
    }
}
