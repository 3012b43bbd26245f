//! Why a frame could not be decoded.

use crate::frame::FRAME_PAYLOAD;
use crate::payload;
use crate::short_text::TEXT_FIELD;
use thiserror::Error;

/// Maximum absolute value of a coordinate (m), speed (m/s) or time (s) in a message. [`crate::Message::decode`] refuses greater
/// values, except in fields that may be infinite or NaN.
pub const MAX_ABS: f64 = 1e9;

/// Why a frame could not be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum DecodeError {
    /// No topic has this number.
    #[error("frame of unknown kind {0}")]
    Kind(u16),
    /// The frame has this version of the payload layouts instead of [`payload::VERSION`].
    #[error("frame of version {0}, expected {expected}", expected = payload::VERSION)]
    Version(u16),
    /// The length of the payload (first number, bytes) is not the length that its kind requires (second number, bytes).
    #[error("frame of {0} bytes, expected {1}")]
    Length(u32, usize),
    /// The length of the payload of a pilot's own message, bytes, is too short for the topic's name, or longer than a frame.
    #[error("frame of {0} bytes, expected {min} to {FRAME_PAYLOAD}", min = TEXT_FIELD)]
    OwnLength(u32),
    /// The named field is invalid: a number that is not finite or is greater than [`MAX_ABS`], a count out of range, a group that
    /// is not a lineage, an invalid shape, or an unknown kind or phase.
    #[error("frame with an invalid {0}")]
    Field(&'static str),
}
