//! Topics that a rule is about.

use crate::message::Topic;
use crate::topic_name::{OWN_TOPIC, TopicName, TopicNameError};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Some topics, built-in ones and those that pilots define. In JSON it is the list of their names.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "Vec<String>", try_from = "Vec<String>")]
pub struct TopicSet {
    built_in: BTreeSet<Topic>,
    /// By their numbers on the wire.
    own: BTreeMap<u16, TopicName>,
}

impl TopicSet {
    /// Adds a topic that pilots define.
    pub fn insert_own(&mut self, name: TopicName) {
        self.own.insert(name.kind(), name);
    }

    /// Whether the set has the topic of this number on the wire.
    #[must_use]
    pub fn contains(&self, kind: u16) -> bool {
        if kind & OWN_TOPIC != 0 {
            return self.own.contains_key(&kind);
        }
        Topic::from_wire(kind).is_some_and(|topic| self.built_in.contains(&topic))
    }

    /// The numbers of its topics that pilots define.
    pub(super) fn own_kinds(&self) -> impl Iterator<Item = u16> {
        self.own.keys().copied()
    }
}

impl FromIterator<Topic> for TopicSet {
    fn from_iter<I: IntoIterator<Item = Topic>>(topics: I) -> Self {
        Self { built_in: topics.into_iter().collect(), own: BTreeMap::new() }
    }
}

impl<const N: usize> From<[Topic; N]> for TopicSet {
    fn from(topics: [Topic; N]) -> Self {
        topics.into_iter().collect()
    }
}

impl FromIterator<TopicName> for TopicSet {
    fn from_iter<I: IntoIterator<Item = TopicName>>(names: I) -> Self {
        let own = names.into_iter().map(|name| (name.kind(), name)).collect();
        Self { built_in: BTreeSet::new(), own }
    }
}

impl From<TopicSet> for Vec<String> {
    fn from(set: TopicSet) -> Self {
        let built_in = set.built_in.iter().map(|topic| topic.name().to_owned());
        built_in.chain(set.own.values().map(|name| name.as_str().to_owned())).collect()
    }
}

impl TryFrom<Vec<String>> for TopicSet {
    type Error = TopicNameError;

    fn try_from(names: Vec<String>) -> Result<Self, TopicNameError> {
        let mut set = Self::default();
        for name in names {
            match Topic::from_name(&name) {
                Some(topic) => drop(set.built_in.insert(topic)),
                None => set.insert_own(TopicName::new(&name)?),
            }
        }
        Ok(set)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_made_of_names_and_gives_them_back() {
        let names = ["pose", "gossip"].map(str::to_owned).to_vec();
        let set = TopicSet::try_from(names.clone()).unwrap();
        let gossip = TopicName::new("gossip").unwrap().kind();
        assert!(set.contains(Topic::Pose as u16) && set.contains(gossip));
        assert!(!set.contains(Topic::Plan as u16) && !set.contains(gossip ^ 1) && !set.contains(99));
        assert_eq!(Vec::<String>::from(set), names);
        assert!(TopicSet::try_from(vec!["Gossip".to_owned()]).is_err());
    }
}
