//! The layout of a frame. It contains no enum, because its bytes come from memory that another process wrote, and an arbitrary
//! number need not be a valid enum value.

use crate::Vec3;
use crate::ids::DroneId;
use crate::link_faults::LinkFaults;
use crate::time::Tick;
use bytemuck::{Pod, Zeroable};

/// Size of the payload field of a frame, bytes. It is determined by the largest payload, an obstacle with 16 vertices.
pub const FRAME_PAYLOAD: usize = 304;

/// Value of [`AirFrame::queue_ns`] for a frame that was never transmitted, because it would have waited longer than the
/// channel's limit.
pub const NEVER_TRANSMITTED: u64 = u64::MAX;

/// An encoded message, as a drone passes it to its radio. [`crate::Message::decode`] checks and decodes it.
#[repr(C, align(8))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Frame {
    /// Number of the message's [`crate::message::Topic`] or [`crate::TopicName`]; that of a [`crate::telemetry`] frame between a drone
    /// and the world. A frame from another process can contain any number.
    pub kind: u16,
    /// Version of the payload layout: [`crate::payload::VERSION`].
    pub version: u16,
    /// Number of payload bytes in use.
    pub len: u32,
    /// The payload. The bytes from `len` on are 0.
    pub payload: [u8; FRAME_PAYLOAD],
}

/// A frame that was sent, with the metadata that the world adds. Only the receivers' radios use the metadata; pilots never see
/// it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct AirFrame {
    /// Tick in which the frame was sent.
    pub tick: Tick,
    /// The drone that sent the frame.
    pub source: DroneId,
    /// Sequence number of the frame among all frames that its source has sent in this mission, from 0.
    pub sequence: u32,
    /// True position of the sender at the time of sending, world frame, m.
    pub position_m: [f64; 3],
    /// Time the frame waited for the shared channel plus its airtime, ns; [`NEVER_TRANSMITTED`] if it was not transmitted.
    pub queue_ns: u64,
    /// Faults of the sender's radio at the time of sending.
    pub link_faults: LinkFaults,
    /// The frame itself.
    pub frame: Frame,
}

impl AirFrame {
    /// True position of the sender at the time of sending, world frame, m.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        Vec3::from(self.position_m)
    }
}
