//! A pilot with its radio receiver, as both runtimes step it.

use crate::radio_receiver::{Pending, RadioReceiver};
use skein_agent::{Heard, Pilot};
use skein_protocol::downlink::{DownlinkView, Senses};
use skein_protocol::radio::Radio;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use std::sync::Arc;

/// Memory for the work of one tick. Drones that are stepped one after the other share it. It therefore stays in the cache,
/// and it is as large as the busiest of them needs.
#[derive(Default)]
pub struct StepScratch {
    /// Frames that are due in this tick.
    arrived: Vec<Pending>,
    /// The messages of these frames; empty between ticks.
    heard: Vec<Heard<'static>>,
    said: Vec<Message>,
    ages_s: Vec<f64>,
}

/// One drone: its pilot, its radio receiver and its counters.
pub struct PilotHost {
    me: DroneId,
    dt_s: f64,
    radio_receiver: RadioReceiver,
    pilot: Box<dyn Pilot>,
    frames_total: u64,
}

impl PilotHost {
    /// A drone before its first tick. `dt_s` is the length of a tick.
    #[must_use]
    pub fn new(me: DroneId, dt_s: f64, radio: impl Into<Arc<Radio>>, pilot: Box<dyn Pilot>) -> Self {
        let radio_receiver = RadioReceiver::new(me, (dt_s * 1e9).round() as i64, radio.into());
        Self { me, dt_s, radio_receiver, pilot, frames_total: 0 }
    }

    /// Receives the frames of a downlink that came too late to be answered. The pilot hears them in its next step.
    pub fn receive_late(&mut self, down: &DownlinkView<'_>, scratch: &mut StepScratch, stats: &mut LinkStats) {
        self.radio_receiver.receive(down, SimTime(i64::MIN), &mut scratch.arrived, stats);
    }

    /// Receives the frames of the newest downlink and steps the pilot on it. Fills the drone's slot, counts in `stats`, and
    /// returns the messages to send, one frame per message.
    pub fn step<'s>(
        &mut self,
        down: &DownlinkView<'_>,
        scratch: &'s mut StepScratch,
        slot: &mut Slot,
        stats: &mut LinkStats,
    ) -> &'s [Message] {
        scratch.arrived.clear();
        scratch.said.clear();
        let Some(senses) = down.senses(self.me) else { return &scratch.said };
        self.radio_receiver.receive(down, senses.now, &mut scratch.arrived, stats);
        let mut heard = emptied(std::mem::take(&mut scratch.heard));
        self.radio_receiver.deliver(&senses, down.frames, &mut scratch.arrived, &mut heard, stats);
        let command = self.pilot.step(&senses, &heard, &mut scratch.said);
        scratch.heard = emptied(heard);
        self.frames_total += scratch.said.len() as u64;
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
        command.fill(slot);
        &scratch.said
    }

    /// Whenever the drone sends a pose, counts how old the newest pose of each peer is.
    fn count_ages(&self, senses: &Senses<'_>, scratch: &mut StepScratch, stats: &mut LinkStats) {
        if scratch.said.iter().any(|message| matches!(message, Message::Pose(_))) {
            self.pilot.pose_ages_s(senses.now, &mut scratch.ages_s);
            let ticks = |age_s: &f64| (age_s / self.dt_s).round().max(0.0) as u64;
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
