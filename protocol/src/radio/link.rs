//! A frame on its way to one receiver.

use crate::frame::AirFrame;
use crate::ids::DroneId;
use crate::message::Topic;

/// A frame and one of its receivers: the key of all random numbers about their link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Link {
    /// The drone that sent the frame.
    pub source: DroneId,
    /// The drone that receives it.
    pub destination: DroneId,
    /// The frame's kind on the wire.
    pub topic: u16,
    /// Running number of the source's frames.
    pub sequence: u32,
}

impl Link {
    /// A frame and one of its receivers.
    #[must_use]
    pub fn of(frame: &AirFrame, destination: DroneId) -> Self {
        Self { source: frame.source, destination, topic: frame.frame.kind, sequence: frame.sequence }
    }

    /// The topic, if the kind is known.
    #[must_use]
    pub fn topic(&self) -> Option<Topic> {
        Topic::from_wire(self.topic)
    }
}
