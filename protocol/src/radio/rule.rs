//! A different channel model for some topics, senders or receivers.

use super::channel_model::ChannelModel;
use super::link::Link;
use super::topic_set::TopicSet;
use crate::ids::DroneId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A different channel model for the frames that meet all of the rule's conditions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rule {
    /// Topics of the frames; `None`: all topics.
    pub topics: Option<TopicSet>,
    /// Drones that send the frames; `None`: all drones.
    pub from: Option<BTreeSet<DroneId>>,
    /// Drones that receive the frames; `None`: all drones.
    pub to: Option<BTreeSet<DroneId>>,
    /// The channel model for these frames.
    #[serde(rename = "air")]
    pub channel: ChannelModel,
}

impl Rule {
    /// Whether the rule's topics include that of this number on the wire, regardless of senders and receivers.
    #[must_use]
    pub fn is_about(&self, kind: u16) -> bool {
        self.topics.as_ref().is_none_or(|set| set.contains(kind))
    }

    /// Whether the rule covers this frame at this receiver. A frame of an unknown kind has no topic, so a rule with a list of
    /// topics does not cover it.
    #[must_use]
    pub fn covers(&self, link: Link) -> bool {
        let includes = |set: &Option<BTreeSet<DroneId>>, id| set.as_ref().is_none_or(|set| set.contains(&id));
        includes(&self.from, link.source) && includes(&self.to, link.destination) && self.is_about(link.topic)
    }
}
