//! What flies a drone: senses and messages in, a command and messages out.

use skein_protocol::downlink::Senses;
use skein_protocol::payload::NO_ROUTE;
use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED, Slot};
use skein_protocol::{Ballot, DroneId, GroupId, Message, MessageRef, Phase, PlanStamp, SimTime, Vec2, flag};

/// A message that came in by the radio, read where it lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard<'a> {
    /// Who said it.
    pub source: DroneId,
    /// What.
    pub message: MessageRef<'a>,
}

/// What a drone's actuators are to do, and what it obeys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// World frame, m/s².
    pub acceleration: Vec2,
    /// The plan it obeys.
    pub obeyed: PlanStamp,
    /// Hash of its part under that plan; 0 before the first.
    pub part_hash: u64,
    /// Its group.
    pub group: GroupId,
    /// The group it leads, if it leads.
    pub leads: Option<GroupId>,
    /// The term it obeys, or leads in.
    pub term: Ballot,
    /// Phase of the plan it obeys.
    pub phase: Phase,
    /// Route and place in its queue while it passes an obstacle set.
    pub place: Option<(u16, u16)>,
}

impl Default for Command {
    fn default() -> Self {
        Self {
            acceleration: Vec2::zeros(),
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

impl Command {
    /// Puts the command into an actuator slot.
    pub fn fill(&self, slot: &mut Slot) {
        slot.acceleration_mps2 = self.acceleration.into();
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

/// One drone's mind. Deterministic: equal senses and messages give equal commands and messages.
pub trait Pilot: Send {
    /// One tick: `heard` in the order in which it was heard; what is to be said is pushed to `say`.
    fn step(&mut self, senses: &Senses<'_>, heard: &[Heard<'_>], say: &mut Vec<Message>) -> Command;

    /// Ages of what it knows of its peers at `now`, in s, one a peer it knows: for the statistics.
    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>);
}
