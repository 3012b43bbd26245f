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
    step: PilotScratch,
}

/// Memory for what a pilot hears and says in one tick.
#[derive(Default)]
pub(crate) struct PilotScratch {
    /// Empty between ticks.
    heard: Vec<Heard<'static>>,
    out: Out,
    ages_s: Vec<f64>,
}

impl PilotScratch {
    /// What the pilot has said.
    pub(crate) fn said(&self) -> Said<'_> {
        Said::of(&self.out)
    }
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
    radio_receiver: RadioReceiver,
    seat: PilotSeat,
}

/// A pilot and its counters.
struct PilotSeat {
    params: HostParams,
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
        Self { radio_receiver, seat: PilotSeat { params, pilot, frames_total: 0, failed: false, guard: None } }
    }

    /// Ends a process that the pilot forks and that comes back from the pilot's step: it must not answer for the drone, too.
    #[must_use]
    pub fn guarded(mut self, guard: ForkGuard) -> Self {
        self.seat.guard = Some(guard);
        self
    }

    /// Fetches the pilot into the cache: call it a short time before [`Self::step`].
    pub(crate) fn prefetch(&self) {
        prefetch(&*self.seat.pilot);
    }

    /// The drone.
    #[inline]
    pub(crate) fn drone(&self) -> DroneId {
        self.seat.params.me
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
        let StepScratch { arrived, step } = scratch;
        if let Some(mut begun) = self.begin_step(down, arrived, step, slot, stats) {
            begun.end(down, step, stats);
        }
        step.said()
    }

    /// The first half of [`Self::step`]: receives, and begins the pilot's step. Returns the rest of the step, which needs the same
    /// `scratch`; `None` if the downlink has nothing for this drone.
    pub(crate) fn begin_step<'a>(
        &'a mut self,
        down: &DownlinkView<'a>,
        arrived: &mut Arrived,
        scratch: &mut PilotScratch,
        slot: &'a mut Slot,
        stats: &mut LinkStats,
    ) -> Option<BegunStep<'a>> {
        arrived.begin();
        scratch.out.clear();
        scratch.ages_s.clear();
        let Self { radio_receiver, seat } = self;
        let senses = down.senses(seat.params.me)?;
        radio_receiver.receive(down, senses.now, arrived, stats);
        let mut heard = emptied(std::mem::take(&mut scratch.heard));
        let tally = radio_receiver.deliver(&senses, down.frames, arrived, &mut heard, stats);
        *slot = Slot {
            heard: tally.heard,
            duplicates: tally.duplicates,
            heard_hash: tally.hash,
            dropped: tally.dropped,
            ..Slot::default()
        };
        let pilot = &mut seat.pilot;
        let failure = catch(|| pilot.begin_step(&senses, &Inbox::new(&heard), &mut scratch.out)).err();
        Some(BegunStep { seat, slot, heard, failure })
    }

    /// Whether its pilot has failed. It must not be stepped any more: the world kills the drone when the next tick opens.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.seat.failed
    }
}

/// The step of a drone whose pilot has begun its own.
pub(crate) struct BegunStep<'a> {
    seat: &'a mut PilotSeat,
    slot: &'a mut Slot,
    heard: Vec<Heard<'a>>,
    /// Why the pilot has failed already.
    failure: Option<String>,
}

impl BegunStep<'_> {
    /// The drone.
    #[inline]
    pub(crate) fn drone(&self) -> DroneId {
        self.seat.params.me
    }

    /// The second half of [`PilotHost::step`], on the same downlink and with what the pilot has begun to say in `scratch`.
    pub(crate) fn end(&mut self, down: &DownlinkView<'_>, scratch: &mut PilotScratch, stats: &mut LinkStats) {
        let Self { seat, slot, heard, failure } = self;
        let Some(senses) = down.senses(seat.params.me) else { return };
        let stepped = match failure.take() {
            None => seat.step_pilot(&senses, &Inbox::new(heard), scratch),
            Some(reason) => Err(reason),
        };
        if let Some(guard) = seat.guard {
            guard.end_copy(|| copy_came_back(seat.params.me.0));
        }
        scratch.heard = emptied(std::mem::take(heard));
        match stepped {
            Ok(Answer { acceleration_mps2, status }) => {
                slot.acceleration_mps2 = acceleration_mps2;
                status.fill(slot);
            }
            Err(reason) => seat.fail(reason, &mut scratch.out),
        }
        seat.frames_total += scratch.said().len() as u64;
        slot.frames_total = seat.frames_total;
        slot.flags |= flag(scratch.out.is_done(), SLOT_DONE) | flag(seat.failed, SLOT_FAILED);
        count_ages(seat.params.dt_s, &scratch.ages_s, stats);
    }
}

impl PilotSeat {
    /// Steps the pilot, and checks what it commands and says. An error says why the pilot has failed.
    fn step_pilot(
        &mut self,
        senses: &Senses<'_>,
        inbox: &Inbox<'_>,
        scratch: &mut PilotScratch,
    ) -> Result<Answer, String> {
        let (pilot, PilotScratch { out, ages_s, .. }) = (&mut self.pilot, scratch);
        let command = catch(|| {
            let command = pilot.step(senses, inbox, out);
            ages_s.clear();
            if out.messages().iter().any(|message| matches!(message, Message::Pose(_))) {
                pilot.pose_ages_s(senses.now, ages_s);
            }
            command
        })?;
        let acceleration_mps2 = command.acceleration_mps2(senses.velocity_mps, self.params.velocity_gain_per_s);
        if !acceleration_mps2.iter().all(|mps2| mps2.is_finite()) {
            return Err(format!("it commanded {:?}, which is not finite", command.motion()));
        }
        check_said(out)?;
        Ok(Answer { acceleration_mps2, status: *command.status() })
    }

    /// The pilot has failed: what it said in this tick is forgotten, and the reason is reported instead.
    fn fail(&mut self, reason: String, out: &mut Out) {
        tracing::warn!("the pilot of drone {} failed: {reason}", self.params.me);
        self.failed = true;
        out.report_failure(reason);
    }
}

/// Counts how old the newest pose of each peer is, as the pilot has told whenever it sends a pose.
fn count_ages(dt_s: f64, ages_s: &[f64], stats: &mut LinkStats) {
    for age_s in ages_s {
        // Rounded by hand: a thousand calls of a function for that take a while.
        stats.age((age_s / dt_s + 0.5) as u64);
    }
}

/// A pilot's answer to a tick.
struct Answer {
    acceleration_mps2: [f64; 3],
    status: Status,
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

#[cfg(test)]
mod tests {
    use super::*;
    use skein_pilot::Command;
    use skein_protocol::UserMessage;
    use skein_protocol::downlink::{Downlink, SensesHeader};
    use skein_protocol::telemetry::Telemetry;

    /// Speaks in both halves of a step, and panics in the given one.
    struct Speaker(Option<&'static str>);

    impl Pilot for Speaker {
        fn begin_step(&mut self, _: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) {
            out.say("half", b"first");
            assert_ne!(self.0, Some("first"), "the first half fails");
        }

        fn step(&mut self, _: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) -> Command {
            out.say("half", b"second");
            assert_ne!(self.0, Some("second"), "the second half fails");
            Command::acceleration([1.0, 2.0, 3.0])
        }
    }

    /// Steps such a pilot once, and calls `look` with its host, its slot and what it said.
    fn step(fails: Option<&'static str>, look: impl FnOnce(&PilotHost, &Slot, &[Message], &[Telemetry])) {
        let mut down =
            Downlink { drones: vec![SensesHeader { alive: 1, ..Default::default() }], ..Downlink::default() };
        down.seal(0, SimTime::ZERO);
        let params = HostParams { me: DroneId(0), dt_s: 0.02, velocity_gain_per_s: 1.0 };
        let mut host = PilotHost::new(params, Radio::default(), Box::new(Speaker(fails)));
        let (mut scratch, mut slot, mut stats) = (StepScratch::default(), Slot::default(), LinkStats::default());
        host.step(&down.view(), &mut scratch, &mut slot, &mut stats);
        look(&host, &slot, scratch.step.out.messages(), scratch.step.out.telemetry());
    }

    #[test]
    fn what_a_pilot_says_in_both_halves_is_sent() {
        step(None, |host, slot, said, _| {
            let bytes = |message: &Message| match message {
                Message::User(message) => UserMessage::bytes(message).to_vec(),
                other => panic!("{other:?}"),
            };
            assert_eq!(said.iter().map(bytes).collect::<Vec<_>>(), [b"first".to_vec(), b"second".to_vec()]);
            assert_eq!((slot.frames_total, slot.acceleration_mps2), (2, [1.0, 2.0, 3.0]));
            assert!(!host.has_failed() && slot.flags & SLOT_FAILED == 0);
        });
    }

    #[test]
    fn a_pilot_that_fails_in_either_half_says_why_and_nothing_else() {
        for half in ["first", "second"] {
            step(Some(half), |host, slot, said, telemetry| {
                assert!(host.has_failed() && slot.flags & SLOT_FAILED != 0 && said.is_empty(), "{half}");
                assert_eq!((slot.frames_total, slot.acceleration_mps2), (1, [0.0; 3]));
                let [Telemetry::Failure { reason }] = telemetry else { panic!("{telemetry:?}") };
                assert!(reason.contains(&format!("the {half} half fails")), "{reason}");
            });
        }
    }
}
