//! The frame on the wire: a plain struct, never an enum read straight from memory that another process wrote.

use crate::Vec2;
use crate::ids::DroneId;
use crate::link_faults::LinkFaults;
use crate::time::Tick;
use bytemuck::{Pod, Zeroable};

/// Bytes of payload in a frame; the largest is an obstacle of 16 vertices.
pub const FRAME_PAYLOAD: usize = 304;

/// [`AirFrame::queue_ns`] of a frame that was never transmitted: it would have waited longer than the limit.
pub const NEVER_TRANSMITTED: u64 = u64::MAX;

/// What a drone hands to its radio. Decode with [`crate::Message::decode`].
#[repr(C, align(8))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Frame {
    /// A [`crate::message::Topic`], if it is one.
    pub kind: u16,
    /// [`crate::payload::VERSION`].
    pub version: u16,
    /// Bytes of payload in use.
    pub len: u32,
    /// The payload; zero past `len`.
    pub payload: [u8; FRAME_PAYLOAD],
}

/// A frame on the air, as the world stamps it. The stamp is for the receivers' radios alone: no pilot sees it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AirFrame {
    /// Tick in which it was sent.
    pub tick: Tick,
    /// Who sent it.
    pub source: DroneId,
    /// Running number of the source's frames in this mission, from 0.
    pub sequence: u32,
    /// True position of the sender when it sent, m.
    pub position_m: [f64; 2],
    /// How long it waited for the channel and took it, ns; [`NEVER_TRANSMITTED`] if it was not sent at all.
    pub queue_ns: u64,
    /// The sender's radio when it sent.
    pub link_faults: LinkFaults,
    /// What was sent.
    pub frame: Frame,
}

impl AirFrame {
    /// True position of the sender, m.
    #[must_use]
    pub fn position(&self) -> Vec2 {
        Vec2::new(self.position_m[0], self.position_m[1])
    }
}
