//! A different channel model for some topics, senders or receivers.

use super::channel_model::ChannelModel;
use super::link::Link;
use crate::ids::DroneId;
use crate::message::Topic;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A different channel model for the frames that meet all of the rule's conditions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rule {
    /// Topics of the frames; `None`: all topics.
    pub topics: Option<BTreeSet<Topic>>,
    /// Drones that send the frames; `None`: all drones.
    pub from: Option<BTreeSet<DroneId>>,
    /// Drones that receive the frames; `None`: all drones.
    pub to: Option<BTreeSet<DroneId>>,
    /// The channel model for these frames.
    #[serde(rename = "air")]
    pub channel: ChannelModel,
}

impl Rule {
    /// Whether the rule's topics include this one, regardless of senders and receivers.
    #[must_use]
    pub fn is_about(&self, topic: Topic) -> bool {
        self.topics.as_ref().is_none_or(|set| set.contains(&topic))
    }

    /// Whether the rule covers this frame at this receiver. A frame of an unknown kind has no topic, so a rule with a list of
    /// topics does not cover it.
    #[must_use]
    pub fn covers(&self, link: Link) -> bool {
        let includes = |set: &Option<BTreeSet<DroneId>>, id| set.as_ref().is_none_or(|set| set.contains(&id));
        includes(&self.from, link.source)
            && includes(&self.to, link.destination)
            && self.topics.as_ref().is_none_or(|set| link.topic().is_some_and(|topic| set.contains(&topic)))
    }
}
