//! What the messages that a drone may pass on say, in little memory: a drone of a large swarm keeps thousands of them, and most have much in
//! common.

use crate::packed_assignment::{AssignmentHeaders, PackedPlace};
use crate::shared_values::SharedValues;
use crate::subject::Subject;
use skein_protocol::payload::{Arrivals, Assignment, AssignmentList, MAX_SET, Passed, Plan};
use skein_protocol::{Ballot, DroneId, GroupId, Message, MessageRef, ObstacleId, PlanStamp, SimTime};

/// Which of two messages about the same subject is newer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Version {
    ballot: Ballot,
    epoch: u32,
    stamp: SimTime,
}

impl Version {
    /// That of what belongs to a plan.
    pub(crate) fn of(plan: PlanStamp) -> Self {
        Self { ballot: plan.ballot, epoch: plan.epoch, ..Self::default() }
    }

    /// That of what a drone said at this time.
    pub(crate) fn at(stamp: SimTime) -> Self {
        Self { stamp, ..Self::default() }
    }
}

/// What a message says. Most are assignments and passages, of which a large swarm has thousands. So what many of them have in common is in
/// [`FactValues`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fact<'a> {
    Plan(&'a Plan),
    /// The assignment of this drone.
    Part(DroneId, PackedPlace),
    Arrivals(&'a Arrivals),
    Passed(Passage),
}

/// What differs between the passages of one set.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    stamp: SimTime,
    /// Index of the set.
    set: u32,
}

/// The obstacles of a passage.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PassedSet {
    count: u32,
    ids: [ObstacleId; MAX_SET],
}

/// What many facts have in common, each kept once.
#[derive(Clone, Debug, Default)]
pub(crate) struct FactValues {
    headers: AssignmentHeaders,
    sets: SharedValues<PassedSet>,
}

impl FactValues {
    /// Keeps an assignment.
    pub(crate) fn keep_part(&mut self, part: &Assignment) -> PackedPlace {
        self.headers.pack(part)
    }

    /// Keeps a passage.
    pub(crate) fn keep_passage(&mut self, passed: &Passed) -> Passage {
        let set = self.sets.share(&PassedSet { count: passed.set_count, ids: passed.set });
        Passage { stamp: passed.stamp, set }
    }

    /// Notes that an assignment is no longer kept.
    pub(crate) fn release_part(&mut self, part: &PackedPlace) {
        self.headers.release(part);
    }

    /// Notes that a passage is no longer kept.
    pub(crate) fn release_passage(&mut self, passage: &Passage) {
        self.sets.release(passage.set);
    }

    /// The group that the plan of an assignment is for.
    pub(crate) fn scope(&self, part: &PackedPlace) -> GroupId {
        self.headers.scope(part)
    }

    /// The assignment that a fact is, if it is one.
    pub(crate) fn assignment_of(&self, fact: Fact<'_>) -> Option<Assignment> {
        let Fact::Part(drone, part) = fact else { return None };
        Some(self.headers.whole(drone, &part))
    }

    /// The message that passes a fact about this subject on.
    pub(crate) fn passed_on(&self, fact: Fact<'_>, subject: Subject) -> Option<Message> {
        Some(match fact {
            Fact::Plan(plan) => Message::Plan(*plan),
            Fact::Part(drone, part) => Message::AssignmentList(AssignmentList::of(&self.headers.whole(drone, &part))),
            Fact::Arrivals(row) => Message::Arrivals(*row),
            Fact::Passed(passage) => {
                let &PassedSet { count, ids } = self.sets.get(passage.set);
                let of = subject.drone()?.0.saturating_add(1);
                Message::Passed(Passed { stamp: passage.stamp, set_count: count, set: ids, of })
            }
        })
    }

    /// The version of a fact.
    pub(crate) fn version(&self, fact: Fact<'_>) -> Version {
        match fact {
            Fact::Plan(plan) => Version::of(plan.id),
            Fact::Part(_, part) => Version::of(self.headers.plan(&part)),
            Fact::Arrivals(row) => Version::at(row.stamp),
            Fact::Passed(passage) => Version::at(passage.stamp),
        }
    }

    /// Whether a fact is that a drone has passed the same obstacles as this message reports.
    pub(crate) fn is_same_passage(&self, known: Fact<'_>, heard: MessageRef<'_>) -> bool {
        let (Fact::Passed(passage), MessageRef::Passed(heard)) = (known, heard) else { return false };
        *self.sets.get(passage.set) == PassedSet { count: heard.set_count, ids: heard.set }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn part(epoch: u32, drone: u32) -> Assignment {
        let id = PlanStamp { epoch, ..PlanStamp::default() };
        let slot_m = [f64::from(drone), -1.5];
        let (arrival_s, route, rank) = (2.5 * f64::from(drone), 3, 4);
        Assignment { id, drone: DroneId(drone), slot_m, arrival_s, route, rank, ..Assignment::zeroed() }
    }

    #[test]
    fn what_was_heard_is_passed_on_as_it_was() {
        let mut values = FactValues::default();
        let parts: Vec<Assignment> = (0..30).map(|number| part(number % 3, number)).collect();
        let kept: Vec<PackedPlace> = parts.iter().map(|part| values.keep_part(part)).collect();
        assert_eq!(values.headers.count(), 3);
        for (part, kept) in parts.iter().zip(&kept) {
            let (subject, fact) = (Subject::Part(part.scope, part.drone), Fact::Part(part.drone, *kept));
            assert_eq!((values.assignment_of(fact), values.scope(kept)), (Some(*part), part.scope));
            assert_eq!(values.passed_on(fact, subject), Some(Message::AssignmentList(AssignmentList::of(part))));
            assert_eq!(values.version(fact), Version::of(part.id));
        }
        kept.iter().for_each(|part| values.release_part(part));
        assert_eq!(values.headers.count(), 0);
    }

    #[test]
    fn a_passage_is_that_of_its_drone_whichever_drone_says_it() {
        let mut values = FactValues::default();
        let mut heard = Passed { stamp: SimTime(5), set_count: 2, ..Passed::zeroed() };
        heard.set[..2].copy_from_slice(&[ObstacleId(4), ObstacleId(6)]);
        let passage = values.keep_passage(&heard);
        let fact = Fact::Passed(passage);
        let expected = Passed { of: 8, ..heard };
        assert_eq!(values.passed_on(fact, Subject::Passed(DroneId(7))), Some(Message::Passed(expected)));
        assert_eq!(values.version(fact), Version::at(heard.stamp));
        let later = Passed { stamp: SimTime(9), ..heard };
        assert!(values.is_same_passage(fact, MessageRef::Passed(&later)));
        let mut other = later;
        other.set[1] = ObstacleId(7);
        assert!(!values.is_same_passage(fact, MessageRef::Passed(&other)));
        values.release_passage(&passage);
        assert_eq!(values.sets.used().count(), 0);
    }
}
