//! Another air for some topics, some senders, some receivers.

use super::channel_model::ChannelModel;
use super::link::Link;
use crate::ids::DroneId;
use crate::message::Topic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Another air for the frames that it is about: those that meet all of its conditions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rule {
    /// Of these topics; `None`: of all.
    pub topics: Option<BTreeSet<Topic>>,
    /// Sent by these drones; `None`: by all.
    pub from: Option<BTreeSet<DroneId>>,
    /// At these receivers; `None`: at all.
    pub to: Option<BTreeSet<DroneId>>,
    /// What the air does to them.
    #[serde(rename = "air")]
    pub channel: ChannelModel,
}

impl Rule {
    /// Whether it is about this topic, whoever sends and hears it.
    #[must_use]
    pub fn is_about(&self, topic: Topic) -> bool {
        self.topics.as_ref().is_none_or(|set| set.contains(&topic))
    }

    /// Whether it is about this frame. A frame of an unknown kind has no topic.
    #[must_use]
    pub fn covers(&self, link: Link) -> bool {
        let among = |set: &Option<BTreeSet<DroneId>>, id| set.as_ref().is_none_or(|set| set.contains(&id));
        among(&self.from, link.source)
            && among(&self.to, link.destination)
            && self.topics.as_ref().is_none_or(|set| link.topic().is_some_and(|topic| set.contains(&topic)))
    }
}
