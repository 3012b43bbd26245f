//! The bandwidth that all drones share. Frames queue for the channel before they are transmitted.

use crate::frame::{AirFrame, FRAME_PAYLOAD, NEVER_TRANSMITTED};
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
}

impl SharedChannel {
    /// Time for which a frame occupies the channel, ns.
    #[must_use]
    pub fn airtime_ns(&self, frame: &AirFrame) -> u64 {
        let bytes = HEAD_BYTES + u64::from(frame.frame.len).min(FRAME_PAYLOAD as u64);
        (bytes as f64 * 8e9 / self.rate_bps).round() as u64
    }
}

/// A channel and the time until which earlier frames occupy it.
#[derive(Clone, Debug)]
pub struct ChannelQueue {
    channel: SharedChannel,
    /// Time at which the channel is free again.
    free: SimTime,
    order: Vec<usize>,
}

impl ChannelQueue {
    /// An empty queue.
    #[must_use]
    pub fn new(channel: SharedChannel) -> Self {
        Self { channel, free: SimTime::ZERO, order: Vec::new() }
    }

    /// Queues all frames of one tick, sent at `sent`, behind the frames of earlier ticks. Sets [`AirFrame::queue_ns`] of each
    /// frame. The order of the drones within a tick is random; the frames of one drone keep their order.
    pub fn schedule(&mut self, sent: SimTime, frames: &mut [AirFrame]) {
        let seed = self.channel.seed;
        self.order.clear();
        self.order.extend(0..frames.len());
        self.order.sort_by_cached_key(|&index| {
            let AirFrame { tick, source, sequence, .. } = frames[index];
            let key =
                (u128::from(tick) << 64) | (u128::from(source.0) << 32) | u128::from(u32::from_le_bytes(*b"queu"));
            (xxh3_64_with_seed(&key.to_le_bytes(), seed), source, sequence)
        });
        let limit_ns = SimTime::ZERO.after(self.channel.limit_s).0;
        for &index in &self.order {
            let frame = &mut frames[index];
            let start = self.free.max(sent);
            let airtime_ns = self.channel.airtime_ns(frame);
            if start - sent > limit_ns {
                frame.queue_ns = NEVER_TRANSMITTED;
                continue;
            }
            self.free = start + i64::try_from(airtime_ns).unwrap_or(i64::MAX);
            frame.queue_ns = (self.free - sent).unsigned_abs();
        }
    }
}
