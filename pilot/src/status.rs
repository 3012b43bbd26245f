//! What a drone reports about itself.

use skein_protocol::payload::NO_ROUTE;
use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED, Slot};
use skein_protocol::{Ballot, GroupId, Phase, PlanStamp, flag};

/// What a drone reports about itself beside its command. It goes into the record and into the checks of the leadership. A
/// pilot without groups, leaders and plans leaves the default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// The plan that the drone obeys.
    pub obeyed: PlanStamp,
    /// Hash of its assignment under that plan; 0 before the first.
    pub part_hash: u64,
    /// Its group.
    pub group: GroupId,
    /// The group that it leads, if it leads.
    pub leads: Option<GroupId>,
    /// The term that it obeys, or leads in.
    pub term: Ballot,
    /// Phase of the plan that it obeys.
    pub phase: Phase,
    /// Route and place in its queue while the drone passes an obstacle set.
    pub place: Option<(u16, u16)>,
}

impl Default for Status {
    fn default() -> Self {
        Self {
            obeyed: PlanStamp::default(),
            part_hash: 0,
            group: GroupId::ALL,
            leads: None,
            term: Ballot::NONE,
            phase: Phase::Cruise,
            place: None,
        }
    }
}

impl Status {
    /// Writes the status into an actuator slot.
    pub fn fill(&self, slot: &mut Slot) {
        slot.obeyed = self.obeyed;
        slot.part_hash = self.part_hash;
        slot.group = self.group;
        slot.term = self.term;
        slot.phase = self.phase.to_wire();
        slot.led = self.leads.unwrap_or_default();
        slot.flags = flag(self.leads.is_some(), SLOT_LEADS) | flag(self.place.is_some(), SLOT_QUEUED);
        (slot.route, slot.rank) = self.place.unwrap_or((NO_ROUTE, 0));
    }
}
