//! The kinds of built-in messages.

use serde::{Deserialize, Serialize};

/// The kind of a built-in message. An observer sees each kind as a separate topic, and the rules of the radio apply to topics.
/// Pilots define further topics by their names ([`crate::TopicName`]).
#[repr(u16)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Topic {
    /// Carries a [`Pose`](crate::payload::Pose).
    Pose = 1,
    /// Carries an [`Obstacle`](crate::payload::Obstacle).
    Obstacle = 2,
    /// Carries a [`Leadership`](crate::payload::Leadership).
    Leadership = 3,
    /// Carries a [`Plan`](crate::payload::Plan).
    Plan = 4,
    /// Carries an [`Assignment`](crate::payload::Assignment), or several in an
    /// [`AssignmentList`](crate::payload::AssignmentList).
    Assignment = 5,
    /// Carries an [`Arrivals`](crate::payload::Arrivals).
    Arrivals = 6,
    /// Carries a [`Passed`](crate::payload::Passed).
    Passed = 7,
    /// Carries a [`Separation`](crate::payload::Separation).
    Separation = 8,
    /// Carries a [`Presence`](crate::payload::Presence).
    Presence = 9,
}

impl Topic {
    /// All topics, in the order of their numbers on the wire.
    pub const ALL: [Self; 9] = [
        Self::Pose,
        Self::Obstacle,
        Self::Leadership,
        Self::Plan,
        Self::Assignment,
        Self::Arrivals,
        Self::Passed,
        Self::Separation,
        Self::Presence,
    ];

    /// The topic with the highest number on the wire.
    pub const LAST: Self = Self::Presence;

    /// The topic with this number on the wire; `None` if no topic has it.
    #[must_use]
    pub fn from_wire(kind: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| *topic as u16 == kind)
    }

    /// The topic's name in scenarios, in JSON and on the screen.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pose => "pose",
            Self::Obstacle => "obstacle",
            Self::Leadership => "leadership",
            Self::Plan => "plan",
            Self::Assignment => "assignment",
            Self::Arrivals => "arrivals",
            Self::Passed => "passed",
            Self::Separation => "separation",
            Self::Presence => "presence",
        }
    }

    /// The topic of this name; `None` if no built-in topic has it.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_topic_has_one_name_everywhere() {
        for topic in Topic::ALL {
            assert_eq!(Topic::from_name(topic.name()), Some(topic));
        }
        assert_eq!(Topic::from_name("gossip"), None);
    }
}
