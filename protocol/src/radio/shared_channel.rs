//! The bandwidth that drones near each other share. Frames queue for the channel before they are transmitted.

use crate::Vec3;
use crate::frame::{AirFrame, FRAME_PAYLOAD, NEVER_TRANSMITTED};
use crate::ids::DroneId;
use crate::time::SimTime;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// Size of a frame's kind, version and length, which precede its payload, bytes.
pub const HEAD_BYTES: u64 = 8;

/// A channel of finite bandwidth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedChannel {
    /// Key of the random order in which drones get the channel within a tick.
    pub seed: u64,
    /// Bit rate that is available for frames, bit/s; positive.
    pub rate_bps: f64,
    /// Longest time that a frame waits for the channel, s. A frame that would have to wait longer is not transmitted.
    pub limit_s: f64,
    /// A sender waits while another one within this distance transmits, m. Senders that are farther apart transmit at the same
    /// time. Infinite: all drones share one channel, wherever they are.
    pub carrier_sense_m: f64,
}

impl SharedChannel {
    /// Time for which a frame occupies the channel, ns.
    #[must_use]
    pub fn airtime_ns(&self, frame: &AirFrame) -> u64 {
        let bytes = HEAD_BYTES + u64::from(frame.frame.len).min(FRAME_PAYLOAD as u64);
        (bytes as f64 * 8e9 / self.rate_bps).round() as u64
    }
}

/// The last frame of one sender.
#[derive(Clone, Copy, Debug)]
struct Transmission {
    source: DroneId,
    /// Where the sender was, world frame, m.
    position: Vec3,
    /// When the frame ends.
    end: SimTime,
}

/// The frames that wait for a channel or occupy it.
#[derive(Clone, Debug)]
pub struct ChannelQueue {
    channel: SharedChannel,
    /// When the last frame of all ends.
    free: SimTime,
    /// The last frame of each sender whose frames have not ended. Not used if all drones share one channel.
    transmissions: Vec<Transmission>,
    order: Vec<usize>,
}

impl ChannelQueue {
    /// An empty queue.
    #[must_use]
    pub fn new(channel: SharedChannel) -> Self {
        Self { channel, free: SimTime::ZERO, transmissions: Vec::new(), order: Vec::new() }
    }

    /// Queues all frames of one tick, sent at `sent`, behind the frames of earlier ticks. Sets [`AirFrame::queue_ns`] of each
    /// frame. The order of the drones within a tick is random; the frames of one drone keep their order.
    pub fn schedule(&mut self, sent: SimTime, frames: &mut [AirFrame]) {
        self.transmissions.retain(|transmission| transmission.end > sent);
        self.draw_order(frames);
        let limit_ns = SimTime::ZERO.after(self.channel.limit_s).0;
        let order = std::mem::take(&mut self.order);
        for &index in &order {
            let frame = &mut frames[index];
            let airtime_ns = self.channel.airtime_ns(frame);
            let start = self.free_at(frame, sent);
            if start - sent > limit_ns {
                frame.queue_ns = NEVER_TRANSMITTED;
                continue;
            }
            let end = start + i64::try_from(airtime_ns).unwrap_or(i64::MAX);
            frame.queue_ns = (end - sent).unsigned_abs();
            self.occupy(Transmission { source: frame.source, position: frame.position(), end });
        }
        self.order = order;
    }

    /// Draws the order in which the frames of a tick get the channel.
    fn draw_order(&mut self, frames: &[AirFrame]) {
        let seed = self.channel.seed;
        self.order.clear();
        self.order.extend(0..frames.len());
        self.order.sort_by_cached_key(|&index| {
            let AirFrame { tick, source, sequence, .. } = frames[index];
            let key =
                (u128::from(tick) << 64) | (u128::from(source.0) << 32) | u128::from(u32::from_le_bytes(*b"queu"));
            (xxh3_64_with_seed(&key.to_le_bytes(), seed), source, sequence)
        });
    }

    /// When the sender of a frame finds the channel free, from `sent` on.
    fn free_at(&self, frame: &AirFrame, sent: SimTime) -> SimTime {
        let reach_m = self.channel.carrier_sense_m;
        if self.free <= sent || reach_m.is_infinite() {
            return self.free.max(sent);
        }
        let near = |one: &Transmission| (one.position - frame.position()).norm_squared() <= reach_m * reach_m;
        let sensed = self.transmissions.iter().filter(|one| one.source == frame.source || near(one));
        sensed.fold(sent, |free, one| free.max(one.end))
    }

    /// Notes a frame that will be transmitted.
    fn occupy(&mut self, new: Transmission) {
        self.free = self.free.max(new.end);
        if self.channel.carrier_sense_m.is_infinite() {
            return;
        }
        match self.transmissions.iter_mut().find(|one| one.source == new.source) {
            Some(one) => *one = new,
            None => self.transmissions.push(new),
        }
    }
}
