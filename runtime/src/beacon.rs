//! The trivial pilot, with which the cost of the runtime is measured.

use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
use skein_protocol::payload::{MAX_PLACES, Pose, QueuePlace};
use skein_protocol::{Ballot, DroneId, GroupId, Message, PlanStamp};

/// A pilot that commands no acceleration and broadcasts its pose at a fixed period.
#[derive(Clone, Copy, Debug)]
pub struct BeaconPilot {
    me: DroneId,
    incarnation: u32,
    beacon_ticks: u64,
}

impl BeaconPilot {
    /// A pilot that broadcasts its pose every `beacon_ticks` ticks, at least 1.
    #[must_use]
    pub fn new(me: DroneId, incarnation: u32, beacon_ticks: u64) -> Self {
        Self { me, incarnation, beacon_ticks: beacon_ticks.max(1) }
    }
}

impl Pilot for BeaconPilot {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) -> Command {
        if senses.tick % self.beacon_ticks == u64::from(self.me.0) % self.beacon_ticks {
            out.message(Message::Pose(Pose {
                stamp: senses.now,
                position_m: senses.position_m,
                velocity_mps: senses.velocity_mps,
                queue: [QueuePlace::default(); MAX_PLACES],
                obeyed: PlanStamp::default(),
                group: GroupId::ALL,
                term: Ballot::NONE,
                incarnation: self.incarnation,
                flags: 0,
                hears: 0,
            }));
        }
        Command::default()
    }
}
