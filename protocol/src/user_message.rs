//! A message of a pilot's own: bytes under a topic.

use crate::decode_error::DecodeError;
use crate::frame::{FRAME_PAYLOAD, Frame};
use crate::short_text::TEXT_FIELD;
use crate::topic_name::{OWN_TOPIC, TopicName};
use bytemuck::{Pod, Zeroable};
use std::fmt;
use std::mem::offset_of;
use thiserror::Error;

/// The most bytes that a message of a pilot's own can carry.
pub const USER_BYTES: usize = FRAME_PAYLOAD - TEXT_FIELD;

/// A message of a pilot's own. Its layout is that of a [`Frame`] from its length on, so that a receiver reads it in the frame.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct UserMessage {
    /// Length of name and bytes.
    len: u32,
    topic: TopicName,
    bytes: [u8; USER_BYTES],
}

/// The bytes do not fit a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the message has {bytes} bytes; a frame carries at most {USER_BYTES}")]
pub struct TooLong {
    /// Length of the message, bytes.
    pub bytes: usize,
}

impl UserMessage {
    /// A message of these bytes under a topic.
    ///
    /// # Errors
    /// [`TooLong`] if there are more than [`USER_BYTES`] of them.
    pub fn new(topic: TopicName, bytes: &[u8]) -> Result<Self, TooLong> {
        let mut message = Self { len: (TEXT_FIELD + bytes.len()) as u32, topic, bytes: [0; USER_BYTES] };
        let field = message.bytes.get_mut(..bytes.len()).ok_or(TooLong { bytes: bytes.len() })?;
        field.copy_from_slice(bytes);
        Ok(message)
    }

    /// Checks and borrows the message in a frame that another process wrote.
    ///
    /// # Errors
    /// [`DecodeError`] if the frame's kind is not that of the topic it names, or its length is impossible.
    #[inline]
    pub fn read(frame: &Frame) -> Result<&Self, DecodeError> {
        const {
            assert!(offset_of!(Frame, len) + size_of::<Self>() == size_of::<Frame>());
            assert!(offset_of!(Self, topic) == offset_of!(Frame, payload) - offset_of!(Frame, len));
        }
        if frame.kind & OWN_TOPIC == 0 {
            return Err(DecodeError::Kind(frame.kind));
        }
        if !(TEXT_FIELD..=FRAME_PAYLOAD).contains(&(frame.len as usize)) {
            return Err(DecodeError::OwnLength(frame.len));
        }
        let message: &Self = bytemuck::from_bytes(&bytemuck::bytes_of(frame)[offset_of!(Frame, len)..]);
        if message.topic.kind() != frame.kind || !message.topic.is_valid() {
            return Err(DecodeError::Field("topic name"));
        }
        Ok(message)
    }

    /// The message's topic.
    #[must_use]
    pub fn topic(&self) -> &TopicName {
        &self.topic
    }

    /// What the pilot said.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        let len = (self.len as usize).saturating_sub(TEXT_FIELD);
        &self.bytes[..len.min(USER_BYTES)]
    }

    /// The payload of the message's frame: the name and the bytes.
    pub(crate) fn payload(&self) -> &[u8] {
        let (start, len) = (offset_of!(Self, topic), TEXT_FIELD + self.bytes().len());
        &bytemuck::bytes_of(self)[start..start + len]
    }
}

impl PartialEq for UserMessage {
    fn eq(&self, other: &Self) -> bool {
        self.payload() == other.payload()
    }
}

impl fmt::Debug for UserMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UserMessage").field("topic", &self.topic).field("bytes", &self.bytes()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Message, MessageRef};
    use proptest::prelude::*;

    fn gossip(bytes: &[u8]) -> UserMessage {
        UserMessage::new(TopicName::new("gossip").unwrap(), bytes).unwrap()
    }

    #[test]
    fn a_message_is_read_in_its_frame() {
        let frame = Message::User(gossip(b"hello")).encode();
        assert_eq!((frame.kind, frame.len), (gossip(b"").topic().kind(), 37));
        let Ok(MessageRef::User(heard)) = MessageRef::read(&frame) else { panic!("a valid frame is read") };
        assert_eq!((heard.topic().as_str(), heard.bytes()), ("gossip", &b"hello"[..]));
        assert_eq!(Message::decode(&frame), Ok(Message::User(gossip(b"hello"))));
    }

    #[test]
    fn a_message_is_as_long_as_a_frame_at_most() {
        let topic = TopicName::new("gossip").unwrap();
        assert_eq!(UserMessage::new(topic, &[7; USER_BYTES]).unwrap().bytes(), [7; USER_BYTES]);
        assert_eq!(UserMessage::new(topic, &[7; USER_BYTES + 1]), Err(TooLong { bytes: USER_BYTES + 1 }));
    }

    #[test]
    fn a_frame_of_another_topic_or_an_impossible_length_is_refused() {
        let good = Message::User(gossip(b"hello")).encode();
        let other = Frame { kind: good.kind ^ 1, ..good };
        assert_eq!(Message::decode(&other), Err(DecodeError::Field("topic name")));
        for len in [31, 305] {
            assert_eq!(Message::decode(&Frame { len, ..good }), Err(DecodeError::OwnLength(len)));
        }
        let mut upper = good;
        upper.payload[0] = b'G';
        upper.kind = OWN_TOPIC | (xxhash_rust::xxh3::xxh3_64(b"Gossip") & 0x7fff) as u16;
        assert_eq!(Message::decode(&upper), Err(DecodeError::Field("topic name")));
    }

    proptest! {
        #[test]
        fn every_message_comes_through_its_frame(name in "[a-z0-9_./-]{1,31}", bytes in prop::collection::vec(any::<u8>(), 0..=USER_BYTES)) {
            let Ok(topic) = TopicName::new(&name) else { return Ok(()) };
            let message = UserMessage::new(topic, &bytes).unwrap();
            let Ok(Message::User(heard)) = Message::decode(&Message::User(message).encode()) else { panic!("decodes") };
            prop_assert_eq!((heard.topic().as_str(), heard.bytes()), (name.as_str(), &bytes[..]));
        }

        #[test]
        fn no_bytes_cause_a_panic(head in any::<[u8; 8]>(), payload in prop::collection::vec(any::<u8>(), FRAME_PAYLOAD), known in any::<bool>()) {
            let mut frame = Message::User(gossip(b"hello")).encode();
            bytemuck::bytes_of_mut(&mut frame)[4..8].copy_from_slice(&head[4..]);
            if !known {
                frame.kind |= u16::from_le_bytes([head[0], head[1]]);
                frame.payload.copy_from_slice(&payload);
            }
            if let Ok(Message::User(message)) = Message::decode(&frame) {
                prop_assert!(message.bytes().len() <= USER_BYTES && message.topic().is_valid());
            }
        }
    }
}
