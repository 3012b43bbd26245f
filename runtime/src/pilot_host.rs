//! What both runtimes put around a pilot: its radio, and the tick's tally.

use crate::radio_receiver::{Pending, RadioReceiver};
use skein_agent::{Heard, Pilot};
use skein_protocol::downlink::{DownlinkView, Senses};
use skein_protocol::radio::Radio;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use std::sync::Arc;

/// Memory for the work of one tick. Drones that are stepped in turn share it: it stays in the caches, and holds what the
/// busiest of them needs, not what each of them once needed.
#[derive(Default)]
pub struct StepScratch {
    /// Due now.
    arrived: Vec<Pending>,
    /// Empty between ticks.
    heard: Vec<Heard<'static>>,
    said: Vec<Message>,
    ages: Vec<f64>,
}

/// One drone: its pilot and its radio.
pub struct PilotHost {
    me: DroneId,
    dt_s: f64,
    radio_receiver: RadioReceiver,
    pilot: Box<dyn Pilot>,
    frames_total: u64,
}

impl PilotHost {
    /// A drone before its first tick.
    #[must_use]
    pub fn new(me: DroneId, dt_s: f64, radio: impl Into<Arc<Radio>>, pilot: Box<dyn Pilot>) -> Self {
        let radio_receiver = RadioReceiver::new(me, (dt_s * 1e9).round() as i64, radio.into());
        Self { me, dt_s, radio_receiver, pilot, frames_total: 0 }
    }

    /// Puts the frames of a downlink that comes too late to be answered through the radio, which counts in `stats`.
    pub fn overhear(&mut self, down: &DownlinkView<'_>, desk: &mut StepScratch, stats: &mut LinkStats) {
        self.radio_receiver.receive(down, SimTime(i64::MIN), &mut desk.arrived, stats);
    }

    /// Puts the frames of the newest downlink through the radio, and steps the pilot on it: fills its actuator slot and
    /// returns what it says, one frame a message.
    pub fn step<'d>(
        &mut self,
        down: &DownlinkView<'_>,
        desk: &'d mut StepScratch,
        slot: &mut Slot,
        stats: &mut LinkStats,
    ) -> &'d [Message] {
        desk.arrived.clear();
        desk.said.clear();
        let Some(senses) = down.senses(self.me) else { return &desk.said };
        self.radio_receiver.receive(down, senses.now, &mut desk.arrived, stats);
        let mut heard = emptied(std::mem::take(&mut desk.heard));
        self.radio_receiver.deliver((senses.tick, senses.now), down.frames, &mut desk.arrived, &mut heard, stats);
        let command = self.pilot.step(&senses, &heard, &mut desk.said);
        desk.heard = emptied(heard);
        self.frames_total += desk.said.len() as u64;
        self.count_ages(&senses, desk, stats);
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
        &desk.said
    }

    /// How old its knowledge of its peers is whenever it beacons.
    fn count_ages(&self, senses: &Senses<'_>, desk: &mut StepScratch, stats: &mut LinkStats) {
        if desk.said.iter().any(|message| matches!(message, Message::Pose(_))) {
            self.pilot.pose_ages_s(senses.now, &mut desk.ages);
            let ticks = |age_s: &f64| (age_s / self.dt_s).round().max(0.0) as u64;
            desk.ages.iter().map(ticks).for_each(|age| stats.age(age));
        }
    }
}

/// The same memory for what lives shorter or longer: collecting in place, the standard library keeps it.
fn emptied<'b>(mut heard: Vec<Heard<'_>>) -> Vec<Heard<'b>> {
    heard.clear();
    heard.into_iter().map_while(|_| None).collect()
}
