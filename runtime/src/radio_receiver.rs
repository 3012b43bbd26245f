//! A drone's radio receiver: which frames it receives, and when.

use skein_pilot::Heard;
use skein_protocol::digest::Digest;
use skein_protocol::downlink::{DownlinkView, Senses, SensesHeader};
use skein_protocol::frame::AirFrame;
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::message::Topic;
use skein_protocol::nearby::Locality;
use skein_protocol::radio::{DROP_REASONS, Delivery, DropReason, Radio, ReceiverChannels};
use skein_protocol::slot::LinkStats;
use skein_protocol::{DroneId, MessageRef, SimTime, Tick, horizontal};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// A frame on its way to this drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Pending {
    due: SimTime,
    source: DroneId,
    sequence: u32,
    /// Whether it is the second copy of a duplicated frame.
    duplicate: bool,
    place: Place,
}

impl Pending {
    /// By time, then by source and sequence number; a second copy after the first.
    fn order(&self) -> (SimTime, u64, bool) {
        (self.due, u64::from(self.source.0) << 32 | u64::from(self.sequence), self.duplicate)
    }
}

/// Where a frame on its way is stored. Most frames are due in the tick in which they come in, and are read in the downlink.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// At this index of the current downlink.
    Downlink(u32),
    /// At this index of [`RadioReceiver::kept`].
    Kept(u32),
}

/// Memory for the work of one tick, which receivers share.
#[derive(Debug, Default)]
pub(crate) struct Arrived {
    /// Frames that are due in this tick.
    pending: Vec<Pending>,
    checked: CheckedFrames,
}

impl Arrived {
    /// Begins the tick of the next receiver.
    pub(crate) fn begin(&mut self) {
        self.pending.clear();
    }
}

/// What is known of the frames of a tick. The receivers that share it check each frame once.
#[derive(Debug, Default)]
struct CheckedFrames {
    tick: Tick,
    /// For each frame, whether it contains a valid message; `None` before it was checked.
    valid: Vec<Option<bool>>,
}

/// A copy of a frame on its way.
struct KeptFrame {
    air: AirFrame,
    /// Whether it contains a valid message.
    valid: bool,
}

impl CheckedFrames {
    /// Turns to the frames of a downlink: another one, or the same for another drone.
    fn turn_to(&mut self, tick: Tick, frames: usize) {
        if (self.tick, self.valid.len()) != (tick, frames) {
            self.tick = tick;
            self.valid.clear();
            self.valid.resize(frames, None);
        }
    }

    /// Whether the frame at an index of the downlink contains a valid message.
    fn is_valid(&mut self, index: usize, air: &AirFrame) -> bool {
        *self.valid[index].get_or_insert_with(|| MessageRef::read(&air.frame).is_ok())
    }
}

/// A drone's radio receiver, and the frames on their way to it.
pub(crate) struct RadioReceiver {
    me: DroneId,
    dt_ns: i64,
    radio: Arc<Radio>,
    channels: ReceiverChannels,
    /// Greatest distance from which it receives each topic, m.
    reach_m: [f64; Topic::ALL.len()],
    /// Greatest distance from which it receives any topic that pilots define, m.
    own_reach_m: f64,
    /// Frames that are due in a later tick than they came in, the earliest first.
    pending: BinaryHeap<Reverse<Pending>>,
    /// Copies of the pending frames.
    kept: Vec<KeptFrame>,
    /// Indices of `kept` that are free.
    free: Vec<u32>,
    /// Counts since the last [`RadioReceiver::deliver`].
    tally: Tally,
}

/// What a receiver counted in a tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Frames delivered to the pilot.
    pub(crate) heard: u32,
    /// Second copies delivered to the pilot.
    pub(crate) duplicates: u32,
    /// Frames that were not received, by [`DropReason`].
    pub(crate) dropped: [u32; DROP_REASONS],
    /// Hash of source and sequence number of each delivered frame, in order. The world knows the contents.
    pub(crate) hash: u64,
}

impl RadioReceiver {
    pub(crate) fn new(me: DroneId, dt_ns: i64, radio: Arc<Radio>) -> Self {
        Self {
            me,
            dt_ns,
            reach_m: Topic::ALL.map(|topic| radio.reach_m(topic as u16, me)),
            own_reach_m: radio.own_reach_m(me),
            channels: radio.channels_at(me),
            radio,
            pending: BinaryHeap::new(),
            kept: Vec::new(),
            free: Vec::new(),
            tally: Tally::default(),
        }
    }

    /// Decides for each frame of a downlink whether and when this drone receives it. Frames that are due by `now` go to
    /// `arrived`; the others are kept.
    pub(crate) fn receive(
        &mut self,
        down: &DownlinkView<'_>,
        now: SimTime,
        arrived: &mut Arrived,
        stats: &mut LinkStats,
    ) {
        arrived.checked.turn_to(down.head.tick, down.frames.len());
        let Some(own) = down.drones.get(self.me.index()) else { return };
        let air = Arriving { own, frames: down.frames, now };
        if own.link_faults != LinkFaults::default() || !self.hears_nearby(&down.nearby.locality) {
            for index in 0..down.frames.len() {
                self.receive_frame(&air, index, arrived, stats);
            }
            return;
        }
        let mut examined = 0;
        let is_near = |frame: &AirFrame| !down.nearby.locality.is_beyond(frame, own.position_m);
        down.nearby.each(horizontal(own.position_m), |index| {
            let near = down.frames.get(index).is_some_and(is_near);
            examined += usize::from(near && self.receive_frame(&air, index, arrived, stats));
        });
        let from = |id| down.frames.partition_point(|frame| frame.source.0 < id);
        let others = down.frames.len() - (from(self.me.0 + 1) - from(self.me.0));
        self.drop_frames(DropReason::Range, (others - examined) as u32, stats);
    }

    /// Whether this drone receives the topics that are sorted by place from nearby cells only.
    fn hears_nearby(&self, locality: &Locality) -> bool {
        let within = |(topic, reach_m): (Topic, f64)| !locality.holds(topic as u16) || reach_m <= locality.cell_m;
        let own = !locality.holds_own() || self.own_reach_m <= locality.cell_m;
        locality.topics != 0 && own && Topic::ALL.into_iter().zip(self.reach_m).all(within)
    }

    /// Decides about one frame. Returns whether there is such a frame and another drone has sent it.
    fn receive_frame(
        &mut self,
        air: &Arriving<'_>,
        index: usize,
        arrived: &mut Arrived,
        stats: &mut LinkStats,
    ) -> bool {
        let Some(frame) = air.frames.get(index).filter(|frame| frame.source != self.me) else { return false };
        if let Some(reason) = air.own.drop_reason(frame) {
            self.drop_frames(reason, 1, stats);
            return true;
        }
        match self.radio.delivery_at(&self.channels, frame, air.own.position_m.into(), self.dt_ns) {
            Delivery::Drop(reason) => self.drop_frames(reason, 1, stats),
            Delivery::Deliver { due, again } => {
                let (source, sequence) = (frame.source, frame.sequence);
                let place = Place::Downlink(index as u32);
                let first = Pending { due, source, sequence, duplicate: false, place };
                self.expect(first, frame, index, air.now, arrived);
                if let Some(due) = again {
                    self.expect(Pending { due, duplicate: true, ..first }, frame, index, air.now, arrived);
                }
            }
        }
        true
    }

    /// Puts a frame of the current downlink, at this index, where it belongs: to `arrived` if it is due, otherwise to those that
    /// are kept.
    fn expect(&mut self, pending: Pending, frame: &AirFrame, index: usize, now: SimTime, arrived: &mut Arrived) {
        if pending.due <= now {
            arrived.pending.push(pending);
        } else {
            let valid = arrived.checked.is_valid(index, frame);
            let place = Place::Kept(self.keep(KeptFrame { air: *frame, valid }));
            self.pending.push(Reverse(Pending { place, ..pending }));
        }
    }

    fn keep(&mut self, frame: KeptFrame) -> u32 {
        if let Some(index) = self.free.pop() {
            self.kept[index as usize] = frame;
            return index;
        }
        self.kept.push(frame);
        self.kept.len() as u32 - 1
    }

    /// Delivers what is due at the time of the downlink to `heard`, in the order (due, source, sequence), a second copy after
    /// the first. The given [`Arrived`] holds what the downlink itself brought. Returns what was counted since the call before.
    pub(crate) fn deliver<'a>(
        &'a mut self,
        senses: &Senses<'_>,
        frames: &'a [AirFrame],
        Arrived { pending, checked }: &mut Arrived,
        heard: &mut Vec<Heard<'a>>,
        stats: &mut LinkStats,
    ) -> Tally {
        while self.pending.peek().is_some_and(|Reverse(next)| next.due <= senses.now) {
            pending.extend(self.pending.pop().map(|Reverse(pending)| pending));
        }
        pending.sort_unstable_by_key(Pending::order);
        let Self { kept, free, tally, .. } = self;
        for &Pending { source, sequence, duplicate, place, .. } in pending.iter() {
            let (air, valid): (&'a AirFrame, bool) = match place {
                Place::Downlink(index) => {
                    let air = &frames[index as usize];
                    (air, checked.is_valid(index as usize, air))
                }
                Place::Kept(index) => {
                    free.push(index);
                    let KeptFrame { air, valid } = &kept[index as usize];
                    (air, *valid)
                }
            };
            match MessageRef::borrow(&air.frame).ok().filter(|_| valid) {
                Some(message) => {
                    tally.hash = Digest::chain(tally.hash, u64::from(source.0) << 32 | u64::from(sequence));
                    if duplicate {
                        tally.duplicates += 1;
                        stats.duplicates += 1;
                    } else {
                        tally.heard += 1;
                        stats.delay(senses.tick.saturating_sub(air.tick));
                    }
                    heard.push(Heard { source, message });
                }
                None if duplicate => {}
                None => {
                    stats.malformed += 1;
                    tally.dropped[DropReason::Malformed as usize] += 1;
                    stats.dropped[DropReason::Malformed as usize] += 1;
                }
            }
        }
        std::mem::take(tally)
    }

    fn drop_frames(&mut self, reason: DropReason, count: u32, stats: &mut LinkStats) {
        self.tally.dropped[reason as usize] += count;
        stats.dropped[reason as usize] += u64::from(count);
    }
}

/// The frames of a downlink, as they arrive at one drone.
struct Arriving<'a> {
    own: &'a SensesHeader,
    frames: &'a [AirFrame],
    now: SimTime,
}
