//! A plan together with the assignments of its drones.

use crate::assignments::Assignments;
use crate::member::Member;
use skein_protocol::payload::Plan;
use skein_protocol::{GroupId, PlanStamp};

/// A plan and the assignment of every drone in it, as its leader made them.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanBundle {
    /// The plan.
    pub plan: Plan,
    /// One assignment per drone, by id.
    pub parts: Assignments,
}

impl PlanBundle {
    /// Leaves the members in the groups they are in. A member of no group within `scope` joins `scope`.
    pub fn unsplit(&mut self, members: &[Member], scope: GroupId) {
        for member in members {
            let group = if scope.contains(member.group) { member.group } else { scope };
            self.parts.change(member.id, |part| part.group = group);
        }
    }

    /// Turns this into a bundle for all drones as one group, under this stamp.
    pub fn unite(&mut self, stamp: PlanStamp) {
        (self.plan.id, self.plan.group) = (stamp, GroupId::ALL);
        self.parts.change_all(|part| (part.id, part.scope, part.group) = (stamp, GroupId::ALL, GroupId::ALL));
    }
}
