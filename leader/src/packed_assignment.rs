//! One assignment in little memory. A drone of a large swarm keeps thousands, in which all drones of a group have much in common.

use crate::shared_values::SharedValues;
use skein_protocol::payload::Assignment;
use skein_protocol::{DroneId, GroupId, PlanStamp};

/// What an assignment says of its drone alone, without the 4 bytes by which it would be aligned to 8.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct PackedPlace {
    slot_m: [f64; 2],
    arrival_s: f64,
    /// Index of the rest.
    header: u32,
    route: u16,
    rank: u16,
}

/// The same, and the drone that it is for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PackedAssignment {
    pub(crate) drone: DroneId,
    pub(crate) place: PackedPlace,
}

/// What the drones of a group have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Header {
    id: PlanStamp,
    scope: GroupId,
    group: GroupId,
    leader: DroneId,
    reserved: u32,
}

impl From<&Assignment> for Header {
    fn from(part: &Assignment) -> Self {
        let &Assignment { id, scope, group, leader, reserved, .. } = part;
        Self { id, scope, group, leader, reserved }
    }
}

impl PackedPlace {
    fn new(part: &Assignment, header: u32) -> Self {
        let &Assignment { slot_m, arrival_s, route, rank, .. } = part;
        Self { slot_m, arrival_s, header, route, rank }
    }
}

/// What the packed assignments of one owner have in common, each kept once.
#[derive(Clone, Debug, Default)]
pub(crate) struct AssignmentHeaders(SharedValues<Header>);

impl AssignmentHeaders {
    /// Packs a further assignment.
    pub(crate) fn pack(&mut self, part: &Assignment) -> PackedPlace {
        PackedPlace::new(part, self.0.share(&part.into()))
    }

    /// Packs an assignment that replaces `old`.
    pub(crate) fn repack(&mut self, old: &PackedPlace, part: &Assignment) -> PackedPlace {
        PackedPlace::new(part, self.0.replace(old.header, &part.into()))
    }

    /// Notes that a packed assignment is no longer kept.
    pub(crate) fn release(&mut self, place: &PackedPlace) {
        self.0.release(place.header);
    }

    /// The assignment of a drone, every value as it was packed.
    pub(crate) fn whole(&self, drone: DroneId, place: &PackedPlace) -> Assignment {
        let &PackedPlace { slot_m, arrival_s, header, route, rank } = place;
        let &Header { id, scope, group, leader, reserved } = self.0.get(header);
        Assignment { id, scope, group, drone, leader, slot_m, arrival_s, route, rank, reserved }
    }

    /// The group that the plan is for.
    pub(crate) fn scope(&self, place: &PackedPlace) -> GroupId {
        self.0.get(place.header).scope
    }

    /// The plan that the assignment belongs to.
    pub(crate) fn plan(&self, place: &PackedPlace) -> PlanStamp {
        self.0.get(place.header).id
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    /// Number of different headers.
    #[cfg(test)]
    pub(crate) fn count(&self) -> usize {
        self.0.used().count()
    }
}
