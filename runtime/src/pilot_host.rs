//! A pilot with its radio receiver, as both runtimes step it.

use crate::forked::copy_came_back;
use crate::radio_receiver::{Arrived, RadioReceiver};
use crate::reported_panic::catch;
use crate::said::Said;
use crate::tuning::{MAX_MESSAGES, MAX_OWN_MESSAGES, MAX_TELEMETRY};
use skein_bus::ForkGuard;
use skein_pilot::{Heard, Inbox, Out, Pilot, Status};
use skein_protocol::downlink::{DownlinkView, Senses};
use skein_protocol::radio::Radio;
use skein_protocol::slot::{LinkStats, SLOT_DONE, SLOT_FAILED, Slot};
use skein_protocol::{DroneId, Message, SimTime, flag, prefetch};
use std::sync::Arc;

/// Memory for the work of one tick. Drones that are stepped one after the other share it. It therefore stays in the cache,
/// and it is as large as the busiest of them needs.
#[derive(Default)]
pub struct StepScratch {
    arrived: Arrived,
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
    failed: bool,
    guard: Option<ForkGuard>,
}

impl PilotHost {
    /// A drone before its first tick.
    #[must_use]
    pub fn new(params: HostParams, radio: impl Into<Arc<Radio>>, pilot: Box<dyn Pilot>) -> Self {
        let radio_receiver = RadioReceiver::new(params.me, (params.dt_s * 1e9).round() as i64, radio.into());
        Self { params, radio_receiver, pilot, frames_total: 0, failed: false, guard: None }
    }

    /// Ends a process that the pilot forks and that comes back from the pilot's step: it must not answer for the drone, too.
    #[must_use]
    pub fn guarded(self, guard: ForkGuard) -> Self {
        Self { guard: Some(guard), ..self }
    }

    /// Fetches the pilot into the cache: call it a short time before [`Self::step`].
    pub(crate) fn prefetch(&self) {
        prefetch(&*self.pilot);
    }

    /// The drone.
    #[inline]
    pub(crate) fn drone(&self) -> DroneId {
        self.params.me
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
        scratch.arrived.begin();
        scratch.out.clear();
        scratch.ages_s.clear();
        let Some(senses) = down.senses(self.params.me) else { return Said::of(&scratch.out) };
        self.radio_receiver.receive(down, senses.now, &mut scratch.arrived, stats);
        let mut heard = emptied(std::mem::take(&mut scratch.heard));
        self.radio_receiver.deliver(&senses, down.frames, &mut scratch.arrived, &mut heard, stats);
        let gain_per_s = self.params.velocity_gain_per_s;
        let stepped = step_pilot(&mut *self.pilot, gain_per_s, &senses, &Inbox::new(&heard), scratch);
        if let Some(guard) = self.guard {
            guard.end_copy(|| copy_came_back(self.params.me.0));
        }
        scratch.heard = emptied(heard);
        if let Err(reason) = &stepped {
            self.fail(reason.clone(), &mut scratch.out);
        }
        self.frames_total += Said::of(&scratch.out).len() as u64;
        self.count_ages(scratch, stats);
        let tally = self.radio_receiver.tally();
        *slot = Slot {
            heard: tally.heard,
            duplicates: tally.duplicates,
            heard_hash: tally.hash,
            dropped: tally.dropped,
            frames_total: self.frames_total,
            ..Slot::default()
        };
        if let Ok(Answer { acceleration_mps2, status }) = stepped {
            slot.acceleration_mps2 = acceleration_mps2;
            status.fill(slot);
        }
        slot.flags |= flag(scratch.out.is_done(), SLOT_DONE) | flag(self.failed, SLOT_FAILED);
        Said::of(&scratch.out)
    }

    /// Whether its pilot has failed. It must not be stepped any more: the world kills the drone when the next tick opens.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failed
    }

    /// The pilot has failed: what it said in this tick is forgotten, and the reason is reported instead.
    fn fail(&mut self, reason: String, out: &mut Out) {
        tracing::warn!("the pilot of drone {} failed: {reason}", self.params.me);
        self.failed = true;
        out.report_failure(reason);
    }

    /// Counts how old the newest pose of each peer is, as the pilot has told whenever it sends a pose.
    fn count_ages(&self, scratch: &mut StepScratch, stats: &mut LinkStats) {
        // Rounded by hand: a thousand calls of a function for that take a while.
        let ticks = |age_s: &f64| (age_s / self.params.dt_s + 0.5) as u64;
        for age_s in &scratch.ages_s {
            stats.age(ticks(age_s));
        }
    }
}

/// A pilot's answer to a tick.
struct Answer {
    acceleration_mps2: [f64; 3],
    status: Status,
}

/// Steps the pilot, and checks what it commands and says. An error says why the pilot has failed.
fn step_pilot(
    pilot: &mut dyn Pilot,
    velocity_gain_per_s: f64,
    senses: &Senses<'_>,
    inbox: &Inbox<'_>,
    scratch: &mut StepScratch,
) -> Result<Answer, String> {
    let StepScratch { out, ages_s, .. } = scratch;
    let command = catch(|| {
        let command = pilot.step(senses, inbox, out);
        ages_s.clear();
        if out.messages().iter().any(|message| matches!(message, Message::Pose(_))) {
            pilot.pose_ages_s(senses.now, ages_s);
        }
        command
    })?;
    let acceleration_mps2 = command.acceleration_mps2(senses.velocity_mps, velocity_gain_per_s);
    if !acceleration_mps2.iter().all(|mps2| mps2.is_finite()) {
        return Err(format!("it commanded {:?}, which is not finite", command.motion()));
    }
    check_said(out)?;
    Ok(Answer { acceleration_mps2, status: *command.status() })
}

/// Whether the radio and the record can take what a pilot has said; otherwise why not.
fn check_said(out: &Out) -> Result<(), String> {
    if let Some(misuse) = out.misuse() {
        return Err(misuse.to_owned());
    }
    let too_many = |what: &str, found: usize, most: usize| format!("it said {found} {what} in a tick, {most} at most");
    let (all, telemetry) = (out.messages().len(), out.telemetry().len());
    if all > MAX_OWN_MESSAGES {
        let own = out.messages().iter().filter(|message| matches!(message, Message::User(_))).count();
        if own > MAX_OWN_MESSAGES {
            return Err(too_many("messages", own, MAX_OWN_MESSAGES));
        }
    }
    if all > MAX_MESSAGES {
        return Err(too_many("messages", all, MAX_MESSAGES));
    }
    if telemetry > MAX_TELEMETRY {
        return Err(too_many("figures, marks and lines", telemetry, MAX_TELEMETRY));
    }
    Ok(())
}

/// Returns an empty vector with another lifetime that reuses the memory: the standard library collects in place.
fn emptied<'b>(mut heard: Vec<Heard<'_>>) -> Vec<Heard<'b>> {
    heard.clear();
    heard.into_iter().map_while(|_| None).collect()
}
