//! From the keys of `[radio]` to the radio that the drones have.

use super::{BurstKeys, BurstScope, DelayModel, RadioKeys, RuleKeys, TopicKey};
use crate::keys::Scenario;
use serde_json::{Map, Value as Json};
use skein_protocol::DroneId;
use skein_protocol::message::Topic;
use skein_protocol::radio::{self, ChannelModel, Delay, Radio, Range, Rule, SharedChannel};

/// What the presets set: tables of keys.
const PRESETS: &str = include_str!("presets.toml");

/// Writes what a scenario's preset sets into its `[radio]`, where that does not say otherwise.
pub(crate) fn fill_preset(scenario: &mut Json) {
    let Some(Json::Object(keys)) = scenario.get_mut("radio") else { return };
    let Some(name) = keys.get("preset").and_then(Json::as_str) else { return };
    if let Some(Json::Object(preset)) = presets().remove(name) {
        fill(keys, preset);
    }
}

/// The presets' tables, by name. That the file can be read is a test's to show.
fn presets() -> Map<String, Json> {
    toml::from_str(PRESETS).unwrap_or_default()
}

fn fill(keys: &mut Map<String, Json>, preset: Map<String, Json>) {
    for (key, value) in preset {
        match (keys.get_mut(&key), value) {
            (None, value) => drop(keys.insert(key, value)),
            (Some(Json::Object(inner)), Json::Object(value)) => fill(inner, value),
            _ => {}
        }
    }
}

impl Scenario {
    /// What the air does to frames, keyed by the scenario's seed.
    #[must_use]
    pub fn radio(&self) -> Radio {
        let keys = &self.radio;
        let rules = keys.rules.iter().map(|rule| keys.rule(rule)).collect();
        Radio { seed: self.seed, channel: keys.air(), asymmetry: keys.asymmetry, rules }
    }

    /// The channel that all drones share; `None` if its bandwidth is no limit.
    #[must_use]
    pub fn channel(&self) -> Option<SharedChannel> {
        let limit_s = self.radio.queue_limit_s;
        self.radio.rate_bps.map(|rate_bps| SharedChannel { seed: self.seed, rate_bps, limit_s })
    }
}

impl RadioKeys {
    fn air(&self) -> ChannelModel {
        ChannelModel {
            delay: Delay { model: self.delay_model.into(), mean_s: self.delay_s, jitter_s: self.jitter_s },
            loss: self.loss,
            burst: self.burst.as_ref().map(radio::Burst::from),
            range: self.range_m.map(|half_m| Range {
                half_m,
                shadowing_db: self.shadowing_db,
                exponent: self.path_loss_exponent,
            }),
            duplicate: self.duplicate,
        }
    }

    /// These keys with what a rule says in their place.
    pub(super) fn under(&self, rule: &RuleKeys) -> Self {
        Self {
            delay_s: rule.delay_s.unwrap_or(self.delay_s),
            jitter_s: rule.jitter_s.unwrap_or(self.jitter_s),
            delay_model: rule.delay_model.unwrap_or(self.delay_model),
            loss: rule.loss.unwrap_or(self.loss),
            range_m: rule.range_m.or(self.range_m),
            shadowing_db: rule.shadowing_db.unwrap_or(self.shadowing_db),
            duplicate: rule.duplicate.unwrap_or(self.duplicate),
            burst: rule.burst.clone().or_else(|| self.burst.clone()),
            rules: Vec::new(),
            ..*self
        }
    }

    fn rule(&self, rule: &RuleKeys) -> Rule {
        let drones = |ids: &Option<Vec<u32>>| ids.as_ref().map(|ids| ids.iter().copied().map(DroneId).collect());
        Rule {
            topics: rule.topics.as_ref().map(|topics| topics.iter().copied().map(Topic::from).collect()),
            from: drones(&rule.from),
            to: drones(&rule.to),
            channel: self.under(rule).air(),
        }
    }
}

impl From<DelayModel> for radio::DelayModel {
    fn from(key: DelayModel) -> Self {
        match key {
            DelayModel::Fixed => Self::Fixed,
            DelayModel::Uniform => Self::Uniform,
            DelayModel::Normal => Self::Normal,
            DelayModel::Gamma => Self::Gamma,
        }
    }
}

impl From<&BurstKeys> for radio::Burst {
    fn from(keys: &BurstKeys) -> Self {
        let scope = match keys.scope {
            BurstScope::Direction => radio::BurstScope::Direction,
            BurstScope::Link => radio::BurstScope::Link,
            BurstScope::Swarm => radio::BurstScope::Swarm,
        };
        Self { share: keys.share, length_s: keys.length_s, loss: keys.loss, scope }
    }
}

impl From<TopicKey> for Topic {
    fn from(key: TopicKey) -> Self {
        match key {
            TopicKey::Pose => Self::Pose,
            TopicKey::Obstacle => Self::Obstacle,
            TopicKey::Leadership => Self::Leadership,
            TopicKey::Plan => Self::Plan,
            TopicKey::Assignment => Self::Assignment,
            TopicKey::Arrivals => Self::Arrivals,
            TopicKey::Passed => Self::Passed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_has_a_table_and_every_topic_a_key() {
        let schema = crate::schema();
        let words = |pointer| {
            let options = crate::check::present(schema.pointer(pointer).unwrap());
            let mut words: Vec<_> = crate::check::words(options).unwrap().into_iter().map(str::to_owned).collect();
            words.sort();
            words
        };
        let mut tables: Vec<_> = presets().into_iter().map(|(name, _)| name).collect();
        tables.sort();
        assert_eq!(words("/properties/radio/properties/preset"), tables);
        let mut topics = Topic::ALL.map(|topic| serde_json::to_value(topic).unwrap().as_str().unwrap().to_owned());
        topics.sort();
        let path = "/properties/radio/properties/rule/items/properties/topics";
        let items = crate::check::present(schema.pointer(path).unwrap())["items"].clone();
        let mut keys: Vec<_> = crate::check::words(&items).unwrap();
        keys.sort_unstable();
        assert_eq!(keys, topics);
    }
}
