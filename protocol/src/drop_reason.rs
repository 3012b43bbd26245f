//! The reasons why a radio does not receive a frame.

use serde::{Deserialize, Serialize};

/// Number of [`DropReason`]s.
pub const DROP_REASONS: usize = 7;

/// Why a frame was not received.
#[repr(usize)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DropReason {
    /// The channel lost the frame, independently of other frames.
    Loss = 0,
    /// The frame was lost in a burst of losses.
    Burst = 1,
    /// The receiver was out of range.
    Range = 2,
    /// Sender and receiver are on different sides of a partition.
    Partition = 3,
    /// A fault has made the receiver deaf or the sender mute.
    Deaf = 4,
    /// The frame could not be decoded.
    Malformed = 5,
    /// The frame was never transmitted, because it would have waited too long for the shared channel.
    Queue = 6,
}

impl DropReason {
    /// All reasons, in the order of their counters.
    pub const ALL: [Self; DROP_REASONS] =
        [Self::Loss, Self::Burst, Self::Range, Self::Partition, Self::Deaf, Self::Malformed, Self::Queue];
}
