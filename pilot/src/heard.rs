//! A message received by radio.

use skein_protocol::{DroneId, MessageRef};

/// A message received by radio. It is read in place, without a copy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard<'a> {
    /// The drone that sent it.
    pub source: DroneId,
    /// The message.
    pub message: MessageRef<'a>,
}
