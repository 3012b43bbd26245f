//! The interface of a pilot: senses and messages in, a command and messages out.

use skein_protocol::downlink::Senses;
use skein_protocol::payload::NO_ROUTE;
use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED, Slot};
use skein_protocol::{Ballot, DroneId, GroupId, Message, MessageRef, Phase, PlanStamp, SimTime, Vec2, flag};

/// A message received by radio. It is read in place, without a copy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard<'a> {
    /// The drone that sent it.
    pub source: DroneId,
    /// The message.
    pub message: MessageRef<'a>,
}

/// What a drone's actuators are to do, and what the drone reports about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// World frame, m/s².
    pub acceleration: Vec2,
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
    /// Writes the command into an actuator slot.
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

/// The software that flies one drone. It is deterministic: equal senses and messages give equal commands and messages.
pub trait Pilot: Send {
    /// Steps one tick. `heard`: the messages received, in the order of their arrival. The pilot pushes the messages that it
    /// sends to `say`.
    fn step(&mut self, senses: &Senses<'_>, heard: &[Heard<'_>], say: &mut Vec<Message>) -> Command;

    /// Replaces the contents of `ages` with the ages at `now` of what it knows of its peers, s, one per known peer. They go
    /// into the statistics.
    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>);
}
