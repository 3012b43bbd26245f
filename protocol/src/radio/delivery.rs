//! The outcome of a frame at one receiver.

use crate::drop_reason::DropReason;
use crate::time::SimTime;

/// Whether and when a receiver hears a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// The receiver does not hear the frame, for this reason.
    Drop(DropReason),
    /// The receiver hears the frame.
    Deliver {
        /// The receiver hears the frame in the first tick at or after this time.
        due: SimTime,
        /// If set, the receiver hears the frame a second time, in the first tick at or after this time. It is not before
        /// `due`.
        again: Option<SimTime>,
    },
}
