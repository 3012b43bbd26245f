//! What both runtimes put around a pilot: its radio, the queue of frames on their way, the tick's tally.

use skein_agent::{Heard, Pilot};
use skein_protocol::digest::Digest;
use skein_protocol::downlink::{DownlinkView, Senses};
use skein_protocol::frame::{AirFrame, Frame};
use skein_protocol::radio::{DropReason, Radio, Verdict};
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime, Tick, Vec2};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// A frame on its way to this drone; the one due first is the greatest.
#[derive(Clone, Copy, Debug)]
struct Pending {
    due: SimTime,
    /// Whether it was delivered before.
    again: bool,
    frame: AirFrame,
}

impl Pending {
    fn key(&self) -> (SimTime, DroneId, u32, bool) {
        (self.due, self.frame.source, self.frame.sequence, self.again)
    }
}

impl Ord for Pending {
    fn cmp(&self, other: &Self) -> Ordering {
        other.key().cmp(&self.key())
    }
}

impl PartialOrd for Pending {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Pending {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Pending {}

/// One drone: its pilot and its radio.
pub struct Cockpit {
    me: DroneId,
    dt_s: f64,
    radio: Radio,
    pilot: Box<dyn Pilot>,
    pending: BinaryHeap<Pending>,
    heard: Vec<Heard>,
    said: Vec<Message>,
    frames: Vec<Frame>,
    ages: Vec<f64>,
    frames_total: u64,
    duplicates: u32,
    dropped: [u32; skein_protocol::radio::DROP_REASONS],
}

impl Cockpit {
    /// A drone before its first tick.
    #[must_use]
    pub fn new(me: DroneId, dt_s: f64, radio: Radio, pilot: Box<dyn Pilot>) -> Self {
        Self {
            me,
            dt_s,
            radio,
            pilot,
            pending: BinaryHeap::new(),
            heard: Vec::new(),
            said: Vec::new(),
            frames: Vec::new(),
            ages: Vec::new(),
            frames_total: 0,
            duplicates: 0,
            dropped: Default::default(),
        }
    }

    /// Puts the frames of a downlink through the radio, which counts in `stats`. Call it for each downlink, also for one
    /// that comes too late to be answered.
    pub fn receive(&mut self, down: &DownlinkView<'_>, stats: &mut LinkStats) {
        let Some(own) = down.drones.get(self.me.index()) else { return };
        let here = Vec2::from(own.position_m);
        let tick_ns = (self.dt_s * 1e9).round() as i64;
        let me = self.me;
        for frame in down.frames.iter().filter(|frame| frame.source != me) {
            if let Some(reason) = own.cut_off(frame) {
                self.drop_frame(reason, stats);
                continue;
            }
            match self.radio.fate(frame, me, here, tick_ns) {
                Verdict::Drop(reason) => self.drop_frame(reason, stats),
                Verdict::Deliver { due, again } => {
                    self.pending.push(Pending { due, again: false, frame: *frame });
                    self.pending.extend(again.map(|due| Pending { due, again: true, frame: *frame }));
                }
            }
        }
    }

    /// Steps the pilot on the newest downlink: fills its actuator slot and returns the frames it sends.
    pub fn step(&mut self, down: &DownlinkView<'_>, slot: &mut Slot, stats: &mut LinkStats) -> &[Frame] {
        self.frames.clear();
        self.said.clear();
        let Some(senses) = down.senses(self.me) else { return &self.frames };
        let heard_hash = self.deliver(senses.tick, senses.now, stats);
        let command = self.pilot.step(&senses, &self.heard, &mut self.said);
        self.frames.extend(self.said.iter().map(Message::encode));
        self.frames_total += self.frames.len() as u64;
        self.count_ages(&senses, stats);
        *slot = Slot {
            heard: self.heard.len() as u32 - self.duplicates,
            duplicates: std::mem::take(&mut self.duplicates),
            heard_hash,
            dropped: std::mem::take(&mut self.dropped),
            frames_total: self.frames_total,
            ..Slot::default()
        };
        command.fill(slot);
        &self.frames
    }

    /// Takes what is due, in the order (due, source, sequence), a second copy after the first.
    fn deliver(&mut self, tick: Tick, now: SimTime, stats: &mut LinkStats) -> u64 {
        self.heard.clear();
        let mut digest = Digest::default();
        while self.pending.peek().is_some_and(|next| next.due <= now) {
            let Some(Pending { frame, again, .. }) = self.pending.pop() else { break };
            match Message::decode(&frame.frame) {
                Ok(message) => {
                    digest.word(u64::from(frame.source.0)).word(u64::from(frame.sequence));
                    digest.bytes(&frame.frame.payload[..frame.frame.len as usize]);
                    if again {
                        self.duplicates += 1;
                        stats.duplicates += 1;
                    } else {
                        stats.delay(tick.saturating_sub(frame.tick));
                    }
                    self.heard.push(Heard { source: frame.source, message });
                }
                Err(_) if again => {}
                Err(_) => {
                    stats.malformed += 1;
                    self.drop_frame(DropReason::Malformed, stats);
                }
            }
        }
        digest.value()
    }

    fn drop_frame(&mut self, reason: DropReason, stats: &mut LinkStats) {
        self.dropped[reason as usize] += 1;
        stats.dropped[reason as usize] += 1;
    }

    /// How old its knowledge of its peers is whenever it beacons.
    fn count_ages(&mut self, senses: &Senses<'_>, stats: &mut LinkStats) {
        if self.said.iter().any(|message| matches!(message, Message::Pose(_))) {
            self.pilot.pose_ages_s(senses.now, &mut self.ages);
            let ticks = |age_s: &f64| (age_s / self.dt_s).round().max(0.0) as u64;
            self.ages.iter().map(ticks).for_each(|age| stats.age(age));
        }
    }
}
