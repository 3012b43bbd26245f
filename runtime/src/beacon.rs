//! The trivial pilot: it flies on and says where it is. What the runtime costs is measured with it.

use skein_agent::{Command, Heard, Pilot};
use skein_protocol::downlink::Senses;
use skein_protocol::payload::{MAX_PLACES, Pose, QueuePlace};
use skein_protocol::{Ballot, DroneId, GroupId, Message, PlanStamp, SimTime};

/// A drone that does nothing but beacon.
#[derive(Clone, Copy, Debug)]
pub struct BeaconPilot {
    me: DroneId,
    incarnation: u32,
    beacon_ticks: u64,
}

impl BeaconPilot {
    /// One that says a beacon every `beacon_ticks`.
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
