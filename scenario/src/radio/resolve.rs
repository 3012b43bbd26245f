//! From the keys of `[radio]` to the radio model that the drones use.

use crate::radio_keys::{BurstKeys, BurstScope, DelayModel, RadioKeys, RuleKeys};
use serde_json::{Map, Value as Json};
use skein_protocol::DroneId;
use skein_protocol::radio::{self, ChannelModel, Delay, Radio, Range, Rule, SharedChannel, TopicSet};

/// The presets: one table of keys per preset.
const PRESETS: &str = include_str!("presets.toml");

/// Writes the keys of the chosen preset into `[radio]`, except those that the scenario sets itself.
pub(crate) fn fill_preset(scenario: &mut Json) {
    let Some(Json::Object(keys)) = scenario.get_mut("radio") else { return };
    let Some(name) = keys.get("preset").and_then(Json::as_str) else { return };
    if let Some(Json::Object(preset)) = presets().remove(name) {
        fill(keys, preset);
    }
}

/// The presets' tables, by name. A test shows that the file can be read.
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

/// The radio of these keys. `seed` keys its random numbers.
pub(crate) fn radio(seed: u64, keys: &RadioKeys) -> Radio {
    let rules = keys.rules.iter().map(|rule| channel_rule(keys, rule)).collect();
    Radio { seed, channel: channel_model(keys), asymmetry: keys.asymmetry, keyed_by_time: keys.keyed_by_time, rules }
}

/// The channel that drones share; `None` if bandwidth is no limit. `seed` keys its random numbers.
pub(crate) fn channel(seed: u64, keys: &RadioKeys) -> Option<SharedChannel> {
    let carrier_sense_m = keys.carrier_sense_m.unwrap_or(f64::INFINITY);
    keys.rate_bps.map(|rate_bps| SharedChannel { seed, rate_bps, limit_s: keys.queue_limit_s, carrier_sense_m })
}

/// The keys for frames that match a rule: those of `[radio]`, overridden by those of the rule.
pub(super) fn with_rule(keys: &RadioKeys, rule: &RuleKeys) -> RadioKeys {
    RadioKeys {
        delay_s: rule.delay_s.unwrap_or(keys.delay_s),
        jitter_s: rule.jitter_s.unwrap_or(keys.jitter_s),
        delay_model: rule.delay_model.unwrap_or(keys.delay_model),
        loss: rule.loss.unwrap_or(keys.loss),
        range_m: rule.range_m.or(keys.range_m),
        shadowing_db: rule.shadowing_db.unwrap_or(keys.shadowing_db),
        duplicate: rule.duplicate.unwrap_or(keys.duplicate),
        burst: rule.burst.clone().or_else(|| keys.burst.clone()),
        rules: Vec::new(),
        ..*keys
    }
}

fn channel_model(keys: &RadioKeys) -> ChannelModel {
    ChannelModel {
        delay: Delay { model: keys.delay_model.into(), mean_s: keys.delay_s, jitter_s: keys.jitter_s },
        loss: keys.loss,
        burst: keys.burst.as_ref().map(radio::Burst::from),
        range: keys.range_m.map(|half_m| Range {
            half_m,
            shadowing_db: keys.shadowing_db,
            exponent: keys.path_loss_exponent,
        }),
        duplicate: keys.duplicate,
    }
}

fn channel_rule(keys: &RadioKeys, rule: &RuleKeys) -> Rule {
    let drones = |ids: &Option<Vec<u32>>| ids.as_ref().map(|ids| ids.iter().copied().map(DroneId).collect());
    Rule {
        // A checked scenario has no other names.
        topics: rule.topics.as_ref().map(|names| TopicSet::try_from(names.clone()).unwrap_or_default()),
        from: drones(&rule.from),
        to: drones(&rule.to),
        channel: channel_model(&with_rule(keys, rule)),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_has_a_table() {
        let schema = crate::schema();
        let words = |pointer| {
            let options = crate::schema_tree::present(schema.pointer(pointer).unwrap());
            let mut words: Vec<_> =
                crate::schema_tree::words(options).unwrap().into_iter().map(str::to_owned).collect();
            words.sort();
            words
        };
        let mut tables: Vec<_> = presets().into_iter().map(|(name, _)| name).collect();
        tables.sort();
        assert_eq!(words("/properties/radio/properties/preset"), tables);
    }
}
