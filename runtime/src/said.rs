//! What a drone sends in a tick.

use skein_pilot::Out;
use skein_protocol::Message;
use skein_protocol::frame::Frame;
use skein_protocol::telemetry::Telemetry;

/// What a drone sends to the world in a tick: its messages, and what it reports about itself. Each is one frame.
#[derive(Clone, Copy, Debug)]
pub struct Said<'a> {
    messages: &'a [Message],
    telemetry: &'a [Telemetry],
}

impl<'a> Said<'a> {
    /// What the pilot has put out.
    pub(crate) fn of(out: &'a Out) -> Self {
        Self { messages: out.messages(), telemetry: out.telemetry() }
    }

    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.messages.len() + self.telemetry.len()
    }

    /// Whether there is no frame.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The frames, messages first.
    pub fn frames(&self) -> impl Iterator<Item = Frame> + use<'a> {
        self.messages.iter().map(Message::encode).chain(self.telemetry.iter().map(Telemetry::encode))
    }
}
