//! Why a radio did not hear a frame.

use serde::{Deserialize, Serialize};

/// Number of [`DropReason`]s.
pub const DROP_REASONS: usize = 7;

/// Why a frame was not heard.
#[repr(usize)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DropReason {
    /// Lost independently of other frames.
    Loss = 0,
    /// Lost in a burst.
    Burst = 1,
    /// Out of range.
    Range = 2,
    /// Source and receiver are on different sides of a partition.
    Partition = 3,
    /// The receiver is deaf, or the sender mute.
    Deaf = 4,
    /// It could not be decoded.
    Malformed = 5,
    /// It would have waited too long for the channel.
    Queue = 6,
}

impl DropReason {
    /// All reasons, in the order of their counters.
    pub const ALL: [Self; DROP_REASONS] =
        [Self::Loss, Self::Burst, Self::Range, Self::Partition, Self::Deaf, Self::Malformed, Self::Queue];
}
