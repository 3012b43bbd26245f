//! What a pilot says in a tick.

use skein_protocol::Message;

/// Takes what a pilot says in a tick. The runtime empties it before each step.
#[derive(Debug, Default)]
pub struct Out {
    messages: Vec<Message>,
}

impl Out {
    /// Broadcasts one of the built-in messages, such as the beacon [`Message::Pose`].
    pub fn message(&mut self, message: Message) {
        self.messages.push(message);
    }

    /// The messages so far, in the order in which they will be sent. The machines of the paper's pilot add theirs here.
    pub fn messages_mut(&mut self) -> &mut Vec<Message> {
        &mut self.messages
    }

    /// The messages so far, in the order in which they will be sent.
    #[must_use]
    pub fn messages(&self) -> &[Message] {
        &self.messages
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.messages.clear();
    }
}
