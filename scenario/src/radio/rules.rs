//! Rules between the keys of `[radio]`.

use super::resolve::with_rule;
use crate::broken_rule::{BrokenRule, quantity};
use crate::keys::Scenario;
use crate::radio_keys::{DelayModel, RadioKeys, RuleKeys};
use crate::suggestion::did_you_mean;
use skein_protocol::TopicName;
use skein_protocol::message::Topic;

/// The rules that the scenario's `[radio]` breaks.
pub(crate) fn broken(scenario: &Scenario) -> Vec<BrokenRule> {
    let keys = &scenario.radio;
    let declared = scenario.declared_topics();
    let mut broken = declared_topics(&declared);
    let names: Vec<&str> = declared.iter().map(|(_, name)| *name).collect();
    let base = delays(keys, "radio");
    // Values that a rule inherits from `[radio]` are blamed there.
    let base_holds = base.is_empty();
    broken.extend(base);
    for (number, rule) in keys.rules.iter().enumerate() {
        let path = format!("radio.rule.{number}");
        broken.extend(drones(rule, &path, scenario.formation.drones));
        broken.extend(unknown_topics(rule, &path, &names));
        let RuleKeys { topics, from, to, .. } = rule.clone();
        if *rule == (RuleKeys { topics, from, to, ..RuleKeys::default() }) {
            let message = "sets nothing: expected delay_s, jitter_s, delay_model, loss, range_m, shadowing_db, duplicate \
                           or burst";
            broken.push(BrokenRule { keys: vec![path], message: message.to_owned() });
        } else if base_holds {
            broken.extend(delays(&with_rule(keys, rule), &path));
        }
    }
    broken
}

/// Rules between the mean delay, its deviation, its model, and the range.
fn delays(keys: &RadioKeys, path: &str) -> Vec<BrokenRule> {
    let RadioKeys { delay_s, jitter_s, delay_model, .. } = *keys;
    let (jitter, most_s) = (quantity(jitter_s, "s"), delay_s / 3f64.sqrt());
    let mut broken = Vec::new();
    let mut expect = |holds: bool, names: [&str; 3], message: String| {
        if !holds {
            let keys = names.iter().map(|name| format!("{path}.{name}")).chain(["radio.preset".to_owned()]);
            broken.push(BrokenRule { keys: keys.collect(), message });
        }
    };
    let names = ["jitter_s", "delay_model", "delay_s"];
    match delay_model {
        DelayModel::Fixed => expect(
            jitter_s == 0.0,
            names,
            format!(
                "found {jitter}, expected 0 s with {path}.delay_model = \"fixed\", or \"uniform\", \"normal\" or \"gamma\" as delay_model"
            ),
        ),
        DelayModel::Uniform => expect(
            jitter_s <= most_s,
            names,
            format!(
                "found {jitter}, expected at most {path}.delay_s / √3 = {} with delay_model = \"uniform\"",
                quantity(most_s, "s")
            ),
        ),
        DelayModel::Gamma => expect(
            jitter_s == 0.0 || delay_s > 0.0,
            ["delay_s", "jitter_s", "delay_model"],
            format!("found 0 s, expected more than 0 s with delay_model = \"gamma\" and {path}.jitter_s = {jitter}"),
        ),
        DelayModel::Normal => {}
    }
    let ranged = keys.shadowing_db == 0.0 || keys.range_m.is_some();
    expect(
        ranged,
        ["range_m", "shadowing_db", "shadowing_db"],
        format!(
            "is missing: {path}.shadowing_db = {} needs the distance at which half of all frames are heard",
            quantity(keys.shadowing_db, "dB")
        ),
    );
    broken
}

/// The names of pilots' topics, each with its key: they must be names, and differ in their numbers on the wire.
fn declared_topics(declared: &[(String, &str)]) -> Vec<BrokenRule> {
    let mut known: Vec<TopicName> = Vec::new();
    let mut broken = Vec::new();
    for (key, text) in declared {
        let twin = |name: &TopicName| known.iter().find(|other| *other != name && other.kind() == name.kind());
        let message = match text.parse::<TopicName>() {
            Err(error) => error.to_string(),
            Ok(name) => match twin(&name) {
                Some(twin) => format!("the topics {name:?} and {twin:?} have the same number on the wire: rename one"),
                None => {
                    known.push(name);
                    continue;
                }
            },
        };
        broken.push(BrokenRule { keys: vec![key.clone()], message });
    }
    broken
}

/// Topics that a rule names and that neither are built in nor declared by a pilot.
fn unknown_topics(rule: &RuleKeys, path: &str, declared: &[&str]) -> Vec<BrokenRule> {
    let names = rule.topics.iter().flatten().enumerate();
    let unknown = names.filter(|(_, name)| Topic::from_name(name).is_none() && !declared.contains(&name.as_str()));
    let broken = unknown.map(|(i, name)| {
        let mut known: Vec<&str> = Topic::ALL.map(Topic::name).to_vec();
        known.extend(declared);
        let list = known.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
        let hint = did_you_mean(name, known.iter().copied());
        BrokenRule {
            keys: vec![format!("{path}.topics.{i}")],
            message: format!("found {name:?}, expected one of {list}, or a topic that a [[pilot]] declares{hint}"),
        }
    });
    broken.collect()
}

/// Drones that a rule names and that do not exist.
fn drones(rule: &RuleKeys, path: &str, drones: u32) -> Vec<BrokenRule> {
    let lists = [("from", &rule.from), ("to", &rule.to)];
    let ids =
        lists.into_iter().flat_map(|(name, ids)| ids.iter().flatten().enumerate().map(move |(i, &id)| (name, i, id)));
    let unknown = ids.filter(|&(_, _, id)| id >= drones);
    let broken = unknown.map(|(name, i, id)| BrokenRule {
        keys: vec![format!("{path}.{name}.{i}"), "formation.drones".to_owned()],
        message: format!("found drone {id}, expected one below formation.drones = {drones}"),
    });
    broken.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(names: &[&str]) -> RuleKeys {
        RuleKeys { topics: Some(names.iter().map(|&name| name.to_owned()).collect()), ..RuleKeys::default() }
    }

    #[test]
    fn a_rule_names_built_in_and_declared_topics_only() {
        assert!(unknown_topics(&topics(&["pose", "gossip"]), "radio.rule.0", &["gossip"]).is_empty());
        let broken = unknown_topics(&topics(&["pose", "gosip"]), "radio.rule.0", &["gossip"]);
        assert_eq!(broken[0].keys, ["radio.rule.0.topics.1"]);
        let message = &broken[0].message;
        assert!(message.starts_with("found \"gosip\", expected one of \"pose\""), "{message}");
        assert!(message.ends_with("; did you mean `gossip`?"), "{message}");
    }

    #[test]
    fn a_declared_topic_has_a_valid_name_and_a_number_of_its_own() {
        let declared = |names: &[&'static str]| {
            let keyed: Vec<_> = names.iter().zip(0..).map(|(&name, i)| (format!("pilot.0.topics.{i}"), name)).collect();
            declared_topics(&keyed).into_iter().map(|broken| broken.message).collect::<Vec<_>>()
        };
        assert!(declared(&["gossip", "gossip", "state"]).is_empty(), "two pilots may share a topic");
        assert!(declared(&["Gossip"])[0].contains("a-z"));
        assert!(declared(&["pose"])[0].contains("built-in"));
    }

    #[test]
    fn two_topics_with_the_same_number_are_refused() {
        let kind = |name: &String| name.parse::<TopicName>().unwrap().kind();
        let names: Vec<String> = (0..2000).map(|i| format!("topic-{i}")).collect();
        let twin = |name: &&String| names.iter().find(|other| other != name && kind(other) == kind(name));
        let first = names.iter().find(|name| twin(name).is_some()).unwrap();
        let pair = [first, twin(&first).unwrap()].map(|name| ("pilot.0.topics.0".to_owned(), name.as_str()));
        assert!(declared_topics(&pair)[0].message.contains("same number"));
    }
}
