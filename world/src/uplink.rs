//! The frames that drones send in a tick, on their way to the next tick's downlink.

use crate::burst::give_back;
use skein_protocol::SimTime;
use skein_protocol::frame::AirFrame;
use skein_protocol::radio::{ChannelQueue, SharedChannel};

/// Memory for four times this many frames is kept in any case. By hand: a swarm of 16 drones needs no more.
const LEAST_KEPT: usize = 64;

/// The frames of the current tick, and the queue of the shared channel if its bit rate is limited.
#[derive(Clone)]
pub(crate) struct Uplink {
    frames: Vec<AirFrame>,
    queue: Option<ChannelQueue>,
}

impl Uplink {
    /// An empty uplink. Without a channel, bandwidth is no limit.
    pub(crate) fn new(channel: Option<SharedChannel>) -> Self {
        Self { frames: Vec::new(), queue: channel.map(ChannelQueue::new) }
    }

    /// Adds a frame that a drone sent in the current tick.
    pub(crate) fn push(&mut self, frame: AirFrame) {
        self.frames.push(frame);
    }

    /// Whether frames keep the order in which they were sent. A queue changes their order.
    pub(crate) fn keeps_order(&self) -> bool {
        self.queue.is_none()
    }

    /// Closes the tick that opened at `opening`: sorts the frames by source and sequence number, and lets them queue for
    /// the channel.
    pub(crate) fn close(&mut self, opening: SimTime) {
        self.frames.sort_unstable_by_key(|frame| (frame.source, frame.sequence));
        if let Some(queue) = &mut self.queue {
            queue.schedule(opening, &mut self.frames);
        }
    }

    /// The frames of the current tick. After [`Uplink::close`]: those that got through the channel.
    pub(crate) fn frames(&self) -> &[AirFrame] {
        &self.frames
    }

    /// Hands the frames over to the downlink and begins an empty tick. Reuses the downlink's memory; what a tick with many frames needed is
    /// given back.
    pub(crate) fn hand_over(&mut self, downlink: &mut Vec<AirFrame>) {
        std::mem::swap(downlink, &mut self.frames);
        self.frames.clear();
        give_back(&mut self.frames, downlink.len(), LEAST_KEPT);
    }
}
