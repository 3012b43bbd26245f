//! A pilot with its radio receiver, as both runtimes step it.

use crate::radio_receiver::{Pending, RadioReceiver};
use crate::said::Said;
use skein_pilot::{Command, Heard, Inbox, Out, Pilot};
use skein_protocol::downlink::{DownlinkView, Senses};
use skein_protocol::radio::Radio;
use skein_protocol::slot::{LinkStats, SLOT_DONE, Slot};
use skein_protocol::{DroneId, Message, SimTime, flag};
use std::sync::Arc;

/// Memory for the work of one tick. Drones that are stepped one after the other share it. It therefore stays in the cache,
/// and it is as large as the busiest of them needs.
#[derive(Default)]
pub struct StepScratch {
    /// Frames that are due in this tick.
    arrived: Vec<Pending>,
    /// The messages of these frames; empty between ticks.
    heard: Vec<Heard<'static>>,
    out: Out,
    ages_s: Vec<f64>,
}

/// What a drone's host knows besides its pilot and its radio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostParams {
    /// The drone.
    pub me: DroneId,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Gain of the inner loop that holds a commanded velocity, 1/s.
    pub velocity_gain_per_s: f64,
}

/// One drone: its pilot, its radio receiver and its counters.
pub struct PilotHost {
    params: HostParams,
    radio_receiver: RadioReceiver,
    pilot: Box<dyn Pilot>,
    frames_total: u64,
}

impl PilotHost {
    /// A drone before its first tick.
    #[must_use]
    pub fn new(params: HostParams, radio: impl Into<Arc<Radio>>, pilot: Box<dyn Pilot>) -> Self {
        let radio_receiver = RadioReceiver::new(params.me, (params.dt_s * 1e9).round() as i64, radio.into());
        Self { params, radio_receiver, pilot, frames_total: 0 }
    }

    /// Receives the frames of a downlink that came too late to be answered. The pilot hears them in its next step.
    pub fn receive_late(&mut self, down: &DownlinkView<'_>, scratch: &mut StepScratch, stats: &mut LinkStats) {
        self.radio_receiver.receive(down, SimTime(i64::MIN), &mut scratch.arrived, stats);
    }

    /// Receives the frames of the newest downlink and steps the pilot on it. Fills the drone's slot, counts in `stats`, and
    /// returns what to send.
    pub fn step<'s>(
        &mut self,
        down: &DownlinkView<'_>,
        scratch: &'s mut StepScratch,
        slot: &mut Slot,
        stats: &mut LinkStats,
    ) -> Said<'s> {
        scratch.arrived.clear();
        scratch.out.clear();
        let Some(senses) = down.senses(self.params.me) else { return Said::of(&scratch.out) };
        self.radio_receiver.receive(down, senses.now, &mut scratch.arrived, stats);
        let mut heard = emptied(std::mem::take(&mut scratch.heard));
        self.radio_receiver.deliver(&senses, down.frames, &mut scratch.arrived, &mut heard, stats);
        let command = self.pilot.step(&senses, &Inbox::new(&heard), &mut scratch.out);
        scratch.heard = emptied(heard);
        self.frames_total += Said::of(&scratch.out).len() as u64;
        self.count_ages(&senses, scratch, stats);
        let tally = self.radio_receiver.tally();
        *slot = Slot {
            heard: tally.heard,
            duplicates: tally.duplicates,
            heard_hash: tally.hash,
            dropped: tally.dropped,
            frames_total: self.frames_total,
            ..Slot::default()
        };
        self.fill(&senses, &command, slot);
        slot.flags |= flag(scratch.out.is_done(), SLOT_DONE);
        Said::of(&scratch.out)
    }

    /// Writes a command and its status into the slot.
    fn fill(&self, senses: &Senses<'_>, command: &Command, slot: &mut Slot) {
        slot.acceleration_mps2 = command.acceleration_mps2(senses.velocity_mps, self.params.velocity_gain_per_s);
        command.status().fill(slot);
    }

    /// Whenever the drone sends a pose, counts how old the newest pose of each peer is.
    fn count_ages(&self, senses: &Senses<'_>, scratch: &mut StepScratch, stats: &mut LinkStats) {
        if scratch.out.messages().iter().any(|message| matches!(message, Message::Pose(_))) {
            self.pilot.pose_ages_s(senses.now, &mut scratch.ages_s);
            let ticks = |age_s: &f64| (age_s / self.params.dt_s).round().max(0.0) as u64;
            for age_s in &scratch.ages_s {
                stats.age(ticks(age_s));
            }
        }
    }
}

/// Returns an empty vector with another lifetime that reuses the memory: the standard library collects in place.
fn emptied<'b>(mut heard: Vec<Heard<'_>>) -> Vec<Heard<'b>> {
    heard.clear();
    heard.into_iter().map_while(|_| None).collect()
}
