//! The paper's pilot with a message of its own in each tick, with which the cost of such messages is measured.

use skein_agent::CoursePilot;
use skein_pilot::{Command, Inbox, Out, Params, Pilot, PilotError, Senses};
use skein_protocol::{SimTime, USER_BYTES};

/// The paper's pilot, which also broadcasts some bytes in each tick. No pilot uses them.
pub(crate) struct TalkerPilot {
    pilot: CoursePilot,
    message: Vec<u8>,
}

impl TalkerPilot {
    /// This pilot with the parameter `bytes`, by default 64: the length of its messages.
    pub(crate) fn new(pilot: CoursePilot, params: &Params) -> Result<Self, PilotError> {
        let bytes = params.get_u64("bytes", 64)? as usize;
        if bytes > USER_BYTES {
            return Err(PilotError::of_param("bytes", format!("expected at most {USER_BYTES}, found {bytes}")));
        }
        Ok(Self { pilot, message: vec![0x55; bytes] })
    }
}

impl Pilot for TalkerPilot {
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        let command = self.pilot.step(senses, inbox, out);
        out.say("talk", &self.message);
        command
    }

    fn begin_step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) {
        self.pilot.begin_step(senses, inbox, out);
    }

    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>) {
        self.pilot.pose_ages_s(now, ages);
    }
}
