//! The trivial pilot, with which the cost of the runtime is measured.

use skein_agent::{Command, Heard, Pilot};
use skein_protocol::downlink::Senses;
use skein_protocol::payload::{MAX_PLACES, Pose, QueuePlace};
use skein_protocol::{Ballot, DroneId, GroupId, Message, PlanStamp, SimTime};

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
    fn step(&mut self, senses: &Senses<'_>, _: &[Heard<'_>], say: &mut Vec<Message>) -> Command {
        if senses.tick % self.beacon_ticks == u64::from(self.me.0) % self.beacon_ticks {
            say.push(Message::Pose(Pose {
                stamp: senses.now,
                position_m: senses.position.into(),
                velocity_mps: senses.velocity.into(),
                queue: [QueuePlace::default(); MAX_PLACES],
                obeyed: PlanStamp::default(),
                group: GroupId::ALL,
                term: Ballot::NONE,
                incarnation: self.incarnation,
                flags: 0,
                reserved: 0,
            }));
        }
        Command::default()
    }

    fn pose_ages_s(&self, _: SimTime, ages: &mut Vec<f64>) {
        ages.clear();
    }
}
