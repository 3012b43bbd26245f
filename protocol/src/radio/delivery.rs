//! What a receiver hears of a frame.

use crate::drop_reason::DropReason;
use crate::time::SimTime;

/// What becomes of a frame at one receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivery {
    /// Not heard.
    Drop(DropReason),
    /// Heard.
    Deliver {
        /// The receiver hears it in the first tick at or after this instant.
        due: SimTime,
        /// If set, the receiver hears it a second time, in the first tick at or after this instant, which is not before `due`.
        again: Option<SimTime>,
    },
}
