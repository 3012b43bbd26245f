//! The name of a topic that pilots define.

use crate::short_text::ShortText;
use crate::topic::Topic;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;
use xxhash_rust::xxh3::xxh3_64;

/// Bit of [`crate::frame::Frame::kind`] that is set in all frames of topics that pilots define, and in no other frame.
pub const OWN_TOPIC: u16 = 0x8000;

/// The name of a topic that pilots define: 1 to 31 characters from `a-z 0-9 _ - . /`, and not the name of a built-in topic.
#[repr(transparent)]
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Pod, Zeroable, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct TopicName(ShortText);

/// A text that cannot name a topic of a pilot.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum TopicNameError {
    /// The text is empty, too long, or has other characters.
    #[error("the topic name {0:?} is not 1 to 31 characters from a-z 0-9 _ - . /")]
    Text(String),
    /// The text names a built-in topic.
    #[error("the topic name {0:?} is that of a built-in topic")]
    BuiltIn(String),
}

impl TopicName {
    /// The topic of this name.
    ///
    /// # Errors
    /// [`TopicNameError`] if the text cannot name a topic.
    pub fn new(name: &str) -> Result<Self, TopicNameError> {
        let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || b"_-./".contains(&byte);
        let text = ShortText::new(name).filter(|_| !name.is_empty() && name.bytes().all(allowed));
        let text = text.ok_or_else(|| TopicNameError::Text(name.to_owned()))?;
        match Topic::from_name(name) {
            Some(_) => Err(TopicNameError::BuiltIn(name.to_owned())),
            None => Ok(Self(text)),
        }
    }

    /// Whether the bytes, which another process may have written, are a name that [`TopicName::new`] accepts.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        Self::new(self.as_str()).as_ref() == Ok(self)
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.0.as_str()
    }

    /// Number of the topic in [`crate::frame::Frame::kind`]: [`OWN_TOPIC`] and 15 bits of the name's hash. Two names may have the
    /// same number; a scenario that declares both is refused.
    #[must_use]
    pub fn kind(&self) -> u16 {
        OWN_TOPIC | (xxh3_64(self.as_str().as_bytes()) & 0x7fff) as u16
    }
}

impl fmt::Display for TopicName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl fmt::Debug for TopicName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for TopicName {
    type Err = TopicNameError;

    fn from_str(name: &str) -> Result<Self, TopicNameError> {
        Self::new(name)
    }
}

impl TryFrom<String> for TopicName {
    type Error = TopicNameError;

    fn try_from(name: String) -> Result<Self, TopicNameError> {
        Self::new(&name)
    }
}

impl From<TopicName> for String {
    fn from(name: TopicName) -> Self {
        name.as_str().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::short_text::TEXT_FIELD;
    use proptest::prelude::*;

    #[test]
    fn a_name_is_refused_for_its_length_its_letters_or_its_meaning() {
        assert_eq!(TopicName::new("swarm/gossip-2.a_b").unwrap().as_str(), "swarm/gossip-2.a_b");
        for wrong in ["", "Gossip", "a b", "ä", "a\0", &"a".repeat(32)] {
            assert_eq!(TopicName::new(wrong), Err(TopicNameError::Text(wrong.to_owned())));
        }
        assert_eq!(TopicName::new("pose"), Err(TopicNameError::BuiltIn("pose".to_owned())));
    }

    #[test]
    fn the_number_of_a_topic_is_fixed_by_its_name() {
        let kind = |name| TopicName::new(name).unwrap().kind();
        assert_eq!(kind("gossip"), OWN_TOPIC | (xxh3_64(b"gossip") & 0x7fff) as u16);
        assert_ne!(kind("gossip"), kind("gossiq"));
    }

    proptest! {
        #[test]
        fn no_bytes_cause_a_panic(bytes in any::<[u8; TEXT_FIELD]>()) {
            let name: TopicName = bytemuck::cast(bytes);
            prop_assert!(name.kind() & OWN_TOPIC != 0);
            prop_assert_eq!(name.is_valid(), TopicName::new(name.as_str()) == Ok(name));
        }
    }
}
