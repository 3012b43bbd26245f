//! What both runtimes put around a pilot: its radio, the queue of frames on their way, the tick's tally.

use skein_agent::{Heard, Pilot};
use skein_protocol::digest::Digest;
use skein_protocol::downlink::{DownlinkView, SenseHead, Senses};
use skein_protocol::frame::{AirFrame, Frame};
use skein_protocol::message::Topic;
use skein_protocol::nearby::Locality;
use skein_protocol::radio::{DropReason, Radio, Verdict};
use skein_protocol::sides::Cuts;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// A frame on its way to this drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Pending {
    due: SimTime,
    source: DroneId,
    sequence: u32,
    /// Whether it was delivered before.
    again: bool,
    place: Place,
}

/// Where a frame on its way is: most are heard in the tick in which they come in, and read where they lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// In the downlink at hand.
    Here(u32),
    /// In [`Cockpit::kept`].
    Kept(u32),
}

/// Memory for the work of one tick. Drones that are stepped in turn share it: it stays in the caches, and holds what the
/// busiest of them needs, not what each of them once needed.
#[derive(Default)]
pub struct Desk {
    /// Due now.
    arrived: Vec<Pending>,
    heard: Vec<Heard>,
    /// What the tick's hash is over.
    folded: Vec<u8>,
    said: Vec<Message>,
    frames: Vec<Frame>,
    ages: Vec<f64>,
}

/// One drone: its pilot and its radio.
pub struct Cockpit {
    me: DroneId,
    dt_s: f64,
    dt_ns: i64,
    radio: Arc<Radio>,
    /// How far it hears each topic, m.
    reach_m: [f64; Topic::ALL.len()],
    pilot: Box<dyn Pilot>,
    /// Due in a later tick than they come in: the one due first is the first.
    pending: BinaryHeap<Reverse<Pending>>,
    /// Their frames, and the places among them that are free.
    kept: Vec<AirFrame>,
    free: Vec<u32>,
    frames_total: u64,
    duplicates: u32,
    dropped: [u32; skein_protocol::radio::DROP_REASONS],
}

impl Cockpit {
    /// A drone before its first tick.
    #[must_use]
    pub fn new(me: DroneId, dt_s: f64, radio: impl Into<Arc<Radio>>, pilot: Box<dyn Pilot>) -> Self {
        let radio = radio.into();
        Self {
            me,
            dt_s,
            dt_ns: (dt_s * 1e9).round() as i64,
            reach_m: Topic::ALL.map(|topic| radio.reach_m(topic, me)),
            radio,
            pilot,
            pending: BinaryHeap::new(),
            kept: Vec::new(),
            free: Vec::new(),
            frames_total: 0,
            duplicates: 0,
            dropped: Default::default(),
        }
    }

    /// Puts the frames of a downlink that comes too late to be answered through the radio, which counts in `stats`.
    pub fn overhear(&mut self, down: &DownlinkView<'_>, desk: &mut Desk, stats: &mut LinkStats) {
        self.receive(down, SimTime(i64::MIN), desk, stats);
    }

    /// Puts the frames of the newest downlink through the radio, and steps the pilot on it: fills its actuator slot and
    /// returns the frames it sends.
    pub fn step<'d>(
        &mut self,
        down: &DownlinkView<'_>,
        desk: &'d mut Desk,
        slot: &mut Slot,
        stats: &mut LinkStats,
    ) -> &'d [Frame] {
        desk.clear();
        let Some(senses) = down.senses(self.me) else { return &desk.frames };
        self.receive(down, senses.now, desk, stats);
        let heard_hash = self.deliver(&senses, down.frames, desk, stats);
        let command = self.pilot.step(&senses, &desk.heard, &mut desk.said);
        desk.frames.extend(desk.said.iter().map(Message::encode));
        self.frames_total += desk.frames.len() as u64;
        self.count_ages(&senses, desk, stats);
        *slot = Slot {
            heard: desk.heard.len() as u32 - self.duplicates,
            duplicates: std::mem::take(&mut self.duplicates),
            heard_hash,
            dropped: std::mem::take(&mut self.dropped),
            frames_total: self.frames_total,
            ..Slot::default()
        };
        command.fill(slot);
        &desk.frames
    }

    /// Takes up what will be heard; frames that are not due by `now` are kept.
    fn receive(&mut self, down: &DownlinkView<'_>, now: SimTime, desk: &mut Desk, stats: &mut LinkStats) {
        let Some(own) = down.drones.get(self.me.index()) else { return };
        if own.cuts != Cuts::default() || !self.hears_nearby(&down.nearby.locality) {
            let frames = 0..down.frames.len();
            frames.for_each(|place| _ = self.take_up((own, now), down.frames, place, desk, stats));
            return;
        }
        let mut looked = 0;
        let here = own.position_m.into();
        down.nearby.each(here, |place| looked += self.take_up((own, now), down.frames, place, desk, stats));
        let from = |id| down.frames.partition_point(|frame| frame.source.0 < id);
        let others = down.frames.len() - (from(self.me.0 + 1) - from(self.me.0));
        self.drop_frames(DropReason::Range, (others - looked) as u32, stats);
    }

    /// Whether what is sorted by place is all this drone hears of these topics.
    fn hears_nearby(&self, locality: &Locality) -> bool {
        let within = |(topic, reach_m): (Topic, f64)| !locality.holds(topic as u16) || reach_m <= locality.cell_m;
        locality.topics != 0 && Topic::ALL.into_iter().zip(self.reach_m).all(within)
    }

    /// Takes up one frame of somebody else; the number of those that there were, 1 or 0.
    fn take_up(
        &mut self,
        (own, now): (&SenseHead, SimTime),
        frames: &[AirFrame],
        place: usize,
        desk: &mut Desk,
        stats: &mut LinkStats,
    ) -> usize {
        let Some(frame) = frames.get(place).filter(|frame| frame.source != self.me) else { return 0 };
        if let Some(reason) = own.cut_off(frame) {
            self.drop_frames(reason, 1, stats);
            return 1;
        }
        match self.radio.fate(frame, self.me, own.position_m.into(), self.dt_ns) {
            Verdict::Drop(reason) => self.drop_frames(reason, 1, stats),
            Verdict::Deliver { due, again } => {
                self.expect(frame, place as u32, (due, false), now, desk);
                again.into_iter().for_each(|due| self.expect(frame, place as u32, (due, true), now, desk));
            }
        }
        1
    }

    fn expect(&mut self, frame: &AirFrame, index: u32, (due, again): (SimTime, bool), now: SimTime, desk: &mut Desk) {
        let pending = |place| Pending { due, source: frame.source, sequence: frame.sequence, again, place };
        if due <= now {
            desk.arrived.push(pending(Place::Here(index)));
        } else {
            let place = Place::Kept(self.keep(frame));
            self.pending.push(Reverse(pending(place)));
        }
    }

    fn keep(&mut self, frame: &AirFrame) -> u32 {
        if let Some(place) = self.free.pop() {
            self.kept[place as usize] = *frame;
            return place;
        }
        self.kept.push(*frame);
        self.kept.len() as u32 - 1
    }

    /// Takes what is due, in the order (due, source, sequence), a second copy after the first; `here`: the frames of the
    /// downlink at hand.
    fn deliver(&mut self, senses: &Senses<'_>, here: &[AirFrame], desk: &mut Desk, stats: &mut LinkStats) -> u64 {
        while self.pending.peek().is_some_and(|Reverse(next)| next.due <= senses.now) {
            desk.arrived.extend(self.pending.pop().map(|Reverse(pending)| pending));
        }
        desk.arrived.sort_unstable();
        for &Pending { source, sequence, again, place, .. } in &desk.arrived {
            let AirFrame { tick, frame, .. } = match place {
                Place::Here(index) => &here[index as usize],
                Place::Kept(index) => {
                    self.free.push(index);
                    &self.kept[index as usize]
                }
            };
            match Message::decode(frame) {
                Ok(message) => {
                    desk.folded.extend_from_slice(&u64::from(source.0).to_le_bytes());
                    desk.folded.extend_from_slice(&u64::from(sequence).to_le_bytes());
                    desk.folded.extend_from_slice(&frame.payload[..frame.len as usize]);
                    if again {
                        self.duplicates += 1;
                        stats.duplicates += 1;
                    } else {
                        stats.delay(senses.tick.saturating_sub(*tick));
                    }
                    desk.heard.push(Heard { source, message });
                }
                Err(_) if again => {}
                Err(_) => {
                    stats.malformed += 1;
                    self.drop_frames(DropReason::Malformed, 1, stats);
                }
            }
        }
        Digest::of(&desk.folded)
    }

    fn drop_frames(&mut self, reason: DropReason, count: u32, stats: &mut LinkStats) {
        self.dropped[reason as usize] += count;
        stats.dropped[reason as usize] += u64::from(count);
    }

    /// How old its knowledge of its peers is whenever it beacons.
    fn count_ages(&self, senses: &Senses<'_>, desk: &mut Desk, stats: &mut LinkStats) {
        if desk.said.iter().any(|message| matches!(message, Message::Pose(_))) {
            self.pilot.pose_ages_s(senses.now, &mut desk.ages);
            let ticks = |age_s: &f64| (age_s / self.dt_s).round().max(0.0) as u64;
            desk.ages.iter().map(ticks).for_each(|age| stats.age(age));
        }
    }
}

impl Desk {
    fn clear(&mut self) {
        self.arrived.clear();
        self.heard.clear();
        self.folded.clear();
        self.said.clear();
        self.frames.clear();
    }
}
