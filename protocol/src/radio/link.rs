//! One frame and one of its receivers.

use crate::frame::AirFrame;
use crate::ids::DroneId;

/// Identifies one frame at one of its receivers. It is part of the key of every random number about that reception.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// The drone that sent the frame.
    pub source: DroneId,
    /// The drone that receives the frame.
    pub destination: DroneId,
    /// The frame's kind on the wire.
    pub topic: u16,
    /// Running number of the frame among the source's frames.
    pub sequence: u32,
}

impl Link {
    /// The link of a frame to the receiver `destination`.
    #[must_use]
    pub fn of(frame: &AirFrame, destination: DroneId) -> Self {
        Self { source: frame.source, destination, topic: frame.frame.kind, sequence: frame.sequence }
    }
}
