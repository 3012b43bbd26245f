//! The assignments of one plan, in little memory: every drone of a swarm keeps those of all others, in which all drones of a group
//! have much in common.

use crate::packed_assignment::{AssignmentHeaders, PackedAssignment};
use crate::roster::{OfDrone, Roster};
use skein_protocol::DroneId;
use skein_protocol::payload::Assignment;
use std::fmt;

/// At most one assignment per drone, by id. Every value is kept as it was heard.
#[derive(Clone, Default)]
pub struct Assignments {
    entries: Roster<PackedAssignment>,
    headers: AssignmentHeaders,
}

impl OfDrone for PackedAssignment {
    fn drone(&self) -> DroneId {
        self.drone
    }
}

impl Assignments {
    /// The assignment of a drone.
    #[must_use]
    pub fn get(&self, drone: DroneId) -> Option<Assignment> {
        self.entries.get(drone).map(|entry| self.headers.whole(drone, &entry.place))
    }

    /// Whether a drone has an assignment.
    #[must_use]
    pub fn contains(&self, drone: DroneId) -> bool {
        self.entries.contains(drone)
    }

    /// Adds an assignment, unless its drone has one already.
    pub fn add(&mut self, part: &Assignment) {
        if !self.contains(part.drone) {
            self.entries.add(PackedAssignment { drone: part.drone, place: self.headers.pack(part) });
        }
    }

    /// Changes the assignment of a drone that has one. Its drone must stay the same.
    pub fn change(&mut self, drone: DroneId, change: impl FnOnce(&mut Assignment)) {
        let Some(mut part) = self.get(drone) else { return };
        change(&mut part);
        if let Some(entry) = self.entries.get_mut(drone) {
            entry.place = self.headers.repack(&entry.place, &part);
        }
    }

    /// Changes all assignments. Their drones must stay the same.
    pub fn change_all(&mut self, mut change: impl FnMut(&mut Assignment)) {
        let changed = self.iter().map(|mut part| {
            change(&mut part);
            part
        });
        *self = changed.collect();
    }

    /// All assignments, by drone.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Assignment> + Clone {
        self.entries.iter().map(|entry| self.headers.whole(entry.drone, &entry.place))
    }

    /// Number of assignments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no assignment.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Removes the assignments of all other drones.
    pub fn retain(&mut self, stays: impl Fn(DroneId) -> bool) {
        *self = self.iter().filter(|part| stays(part.drone)).collect();
    }

    /// Removes all assignments.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.headers.clear();
    }
}

/// Of several assignments of one drone the first one counts.
impl FromIterator<Assignment> for Assignments {
    fn from_iter<I: IntoIterator<Item = Assignment>>(parts: I) -> Self {
        let parts = parts.into_iter();
        let mut all =
            Self { entries: Roster::with_capacity(parts.size_hint().0), headers: AssignmentHeaders::default() };
        for part in parts {
            all.add(&part);
        }
        all
    }
}

/// What the assignments say, not how they are kept.
impl PartialEq for Assignments {
    fn eq(&self, other: &Self) -> bool {
        self.iter().eq(other.iter())
    }
}

/// The assignments themselves: how they are kept depends on the order in which they were heard.
impl fmt::Debug for Assignments {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::{GroupId, PlanStamp};

    fn part(drone: u32) -> Assignment {
        Assignment {
            id: PlanStamp { epoch: 3, ..PlanStamp::default() },
            group: GroupId::ALL.child((drone % 3) as u8),
            drone: DroneId(drone),
            leader: DroneId(drone % 2),
            slot_m: [f64::from(drone) / 7.0, -0.0],
            arrival_s: f64::from(drone) / 3.0,
            route: drone as u16 % 4,
            rank: 9,
            ..Assignment::zeroed()
        }
    }

    #[test]
    fn every_assignment_is_kept_as_it_was_heard() {
        let order = [5, 1, 9, 3, 0, 8, 7];
        let mut heard: Assignments = order.map(part).into_iter().collect();
        heard.add(&Assignment { rank: 1, ..part(9) });
        let mut expected = order.map(part);
        expected.sort_by_key(|part| part.drone);
        let bytes = |parts: &[Assignment]| bytemuck::cast_slice::<_, u8>(parts).to_vec();
        assert_eq!(bytes(&heard.iter().collect::<Vec<_>>()), bytes(&expected));
        assert_eq!((heard.get(DroneId(7)), heard.get(DroneId(2))), (Some(part(7)), None));
        assert_eq!(heard, expected.into_iter().collect());
        assert_eq!(format!("{heard:?}"), format!("{expected:?}"));
    }

    #[test]
    fn one_assignment_or_all_can_be_changed() {
        let mut parts: Assignments = (0..6).map(part).collect();
        parts.change(DroneId(4), |part| part.group = GroupId::ALL.child(7));
        parts.change(DroneId(17), |part| part.rank = 0);
        assert_eq!(parts.get(DroneId(4)), Some(Assignment { group: GroupId::ALL.child(7), ..part(4) }));
        assert_eq!(parts.get(DroneId(1)), Some(part(1)));
        parts.change_all(|part| part.scope = GroupId::ALL.child(2));
        assert!(parts.len() == 6 && parts.iter().all(|part| part.scope == GroupId::ALL.child(2)));
        parts.retain(|id| id.0 > 3);
        assert_eq!(parts.iter().map(|part| part.drone.0).collect::<Vec<_>>(), [4, 5]);
    }
}
