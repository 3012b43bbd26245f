//! A drone's radio: what of the air it hears, and when.

use skein_agent::Heard;
use skein_protocol::digest::Digest;
use skein_protocol::downlink::{DownlinkView, SensesHeader};
use skein_protocol::frame::AirFrame;
use skein_protocol::link_faults::LinkFaults;
use skein_protocol::message::Topic;
use skein_protocol::nearby::Locality;
use skein_protocol::radio::{DROP_REASONS, Delivery, DropReason, Radio, ReceiverChannels};
use skein_protocol::slot::LinkStats;
use skein_protocol::{DroneId, MessageRef, SimTime};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

/// A frame on its way to this drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Pending {
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
    /// In [`RadioReceiver::kept`].
    Kept(u32),
}

/// A drone's radio, and the frames on their way to it.
pub(crate) struct RadioReceiver {
    me: DroneId,
    dt_ns: i64,
    radio: Arc<Radio>,
    airs: ReceiverChannels,
    /// How far it hears each topic, m.
    reach_m: [f64; Topic::ALL.len()],
    /// Due in a later tick than they come in: the one due first is the first.
    pending: BinaryHeap<Reverse<Pending>>,
    /// Their frames, and the places among them that are free.
    kept: Vec<AirFrame>,
    free: Vec<u32>,
    /// Heard, heard for the second time, and refused since the last [`RadioReceiver::tally`].
    tally: Tally,
}

/// What a radio counted in a tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub heard: u32,
    pub duplicates: u32,
    pub dropped: [u32; DROP_REASONS],
    /// Over who said what was heard, and its number, in the order in which it was heard. What it says the world knows.
    pub hash: u64,
}

impl RadioReceiver {
    pub fn new(me: DroneId, dt_ns: i64, radio: Arc<Radio>) -> Self {
        Self {
            me,
            dt_ns,
            reach_m: Topic::ALL.map(|topic| radio.reach_m(topic, me)),
            airs: radio.channels_at(me),
            radio,
            pending: BinaryHeap::new(),
            kept: Vec::new(),
            free: Vec::new(),
            tally: Tally::default(),
        }
    }

    /// What was counted since the last call.
    pub fn tally(&mut self) -> Tally {
        std::mem::take(&mut self.tally)
    }

    /// Takes up what will be heard: what is due by `now` goes to `arrived`, the rest is kept.
    pub fn receive(
        &mut self,
        down: &DownlinkView<'_>,
        now: SimTime,
        arrived: &mut Vec<Pending>,
        stats: &mut LinkStats,
    ) {
        let Some(own) = down.drones.get(self.me.index()) else { return };
        if own.link_faults != LinkFaults::default() || !self.hears_nearby(&down.nearby.locality) {
            let frames = 0..down.frames.len();
            frames.for_each(|place| _ = self.take_up((own, now), down.frames, place, arrived, stats));
            return;
        }
        let mut looked = 0;
        let here = own.position_m.into();
        down.nearby.each(here, |place| looked += self.take_up((own, now), down.frames, place, arrived, stats));
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
        (own, now): (&SensesHeader, SimTime),
        frames: &[AirFrame],
        place: usize,
        arrived: &mut Vec<Pending>,
        stats: &mut LinkStats,
    ) -> usize {
        let Some(frame) = frames.get(place).filter(|frame| frame.source != self.me) else { return 0 };
        if let Some(reason) = own.drop_reason(frame) {
            self.drop_frames(reason, 1, stats);
            return 1;
        }
        match self.radio.delivery_at(&self.airs, frame, own.position_m.into(), self.dt_ns) {
            Delivery::Drop(reason) => self.drop_frames(reason, 1, stats),
            Delivery::Deliver { due, again } => {
                self.expect(frame, place as u32, (due, false), now, arrived);
                again.into_iter().for_each(|due| self.expect(frame, place as u32, (due, true), now, arrived));
            }
        }
        1
    }

    fn expect(
        &mut self,
        frame: &AirFrame,
        index: u32,
        (due, again): (SimTime, bool),
        now: SimTime,
        arrived: &mut Vec<Pending>,
    ) {
        let pending = |place| Pending { due, source: frame.source, sequence: frame.sequence, again, place };
        if due <= now {
            arrived.push(pending(Place::Here(index)));
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

    /// Takes what is due at `now`, in the order (due, source, sequence), a second copy after the first; `here`: the frames
    /// of the downlink at hand, tick `tick`'s.
    pub fn deliver<'a>(
        &'a mut self,
        (tick, now): (u64, SimTime),
        here: &'a [AirFrame],
        arrived: &mut Vec<Pending>,
        heard: &mut Vec<Heard<'a>>,
        stats: &mut LinkStats,
    ) {
        while self.pending.peek().is_some_and(|Reverse(next)| next.due <= now) {
            arrived.extend(self.pending.pop().map(|Reverse(pending)| pending));
        }
        arrived.sort_unstable();
        let Self { kept, free, tally, .. } = self;
        for &Pending { source, sequence, again, place, .. } in arrived.iter() {
            let air: &'a AirFrame = match place {
                Place::Here(index) => &here[index as usize],
                Place::Kept(index) => {
                    free.push(index);
                    &kept[index as usize]
                }
            };
            match MessageRef::read(&air.frame) {
                Ok(message) => {
                    tally.hash = Digest::chain(tally.hash, u64::from(source.0) << 32 | u64::from(sequence));
                    if again {
                        tally.duplicates += 1;
                        stats.duplicates += 1;
                    } else {
                        tally.heard += 1;
                        stats.delay(tick.saturating_sub(air.tick));
                    }
                    heard.push(Heard { source, message });
                }
                Err(_) if again => {}
                Err(_) => {
                    stats.malformed += 1;
                    tally.dropped[DropReason::Malformed as usize] += 1;
                    stats.dropped[DropReason::Malformed as usize] += 1;
                }
            }
        }
    }

    fn drop_frames(&mut self, reason: DropReason, count: u32, stats: &mut LinkStats) {
        self.tally.dropped[reason as usize] += count;
        stats.dropped[reason as usize] += u64::from(count);
    }
}
