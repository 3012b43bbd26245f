//! What a drone heard in a tick.

use crate::heard::Heard;
use crate::note::Note;
use skein_protocol::MessageRef;

/// The messages that a drone received since its step before, in the order of their arrival. They are read in place and live
/// as long as the step. A message that the radio duplicates is there twice.
///
/// ```
/// use skein_pilot::{Heard, Inbox};
/// use skein_protocol::{DroneId, MessageRef, TopicName, UserMessage};
///
/// let message = UserMessage::new(TopicName::new("gossip")?, b"hello")?;
/// let heard = [Heard { source: DroneId(3), message: MessageRef::User(&message) }];
/// for note in Inbox::new(&heard).of("gossip") {
///     assert_eq!((note.from, note.bytes), (3, &b"hello"[..]));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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

    /// The pilots' own messages under this topic, in the order of their arrival.
    pub fn of<'t>(&self, topic: &'t str) -> impl Iterator<Item = Note<'a>> + use<'a, 't> {
        self.all().filter(move |note| note.topic == topic)
    }

    /// The pilots' own messages under all topics, in the order of their arrival.
    pub fn all(&self) -> impl Iterator<Item = Note<'a>> + use<'a> {
        self.heard.iter().filter_map(|heard| match heard.message {
            MessageRef::User(message) => {
                Some(Note { from: heard.source.0, topic: message.topic().as_str(), bytes: message.bytes() })
            }
            _ => None,
        })
    }

    /// All messages, the built-in ones of the paper's pilot included.
    #[must_use]
    pub fn heard(&self) -> &'a [Heard<'a>] {
        self.heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::{DroneId, TopicName, UserMessage};

    #[test]
    fn messages_are_read_by_topic_in_the_order_of_their_arrival() {
        let said = |topic, bytes: &[u8]| UserMessage::new(TopicName::new(topic).unwrap(), bytes).unwrap();
        let messages = [said("gossip", b"a"), said("state", b"b"), said("gossip", b"c")];
        let heard: Vec<Heard<'_>> = (7..)
            .zip(&messages)
            .map(|(id, message)| Heard { source: DroneId(id), message: MessageRef::User(message) })
            .collect();
        let inbox = Inbox::new(&heard);
        let gossip: Vec<_> = inbox.of("gossip").map(|note| (note.from, note.bytes)).collect();
        assert_eq!(gossip, [(7, &b"a"[..]), (9, &b"c"[..])]);
        assert_eq!(inbox.all().map(|note| note.topic).collect::<Vec<_>>(), ["gossip", "state", "gossip"]);
        assert_eq!(inbox.of("nothing").count(), 0);
    }
}
