//! What a drone heard in a tick.

use crate::heard::Heard;

/// The messages that a drone received since its step before, in the order of their arrival. They are read in place and live
/// as long as the step.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inbox<'a> {
    heard: &'a [Heard<'a>],
}

impl<'a> Inbox<'a> {
    /// An inbox with these messages.
    #[must_use]
    pub fn new(heard: &'a [Heard<'a>]) -> Self {
        Self { heard }
    }

    /// All messages, the built-in ones of the paper's pilot included.
    #[must_use]
    pub fn heard(&self) -> &'a [Heard<'a>] {
        self.heard
    }
}
