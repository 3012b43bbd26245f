//! Rules between the keys of `[radio]`.

use super::resolve::with_rule;
use crate::broken_rule::{BrokenRule, quantity};
use crate::keys::Scenario;
use crate::radio_keys::{DelayModel, RadioKeys, RuleKeys};

/// The rules that the scenario's `[radio]` breaks.
pub(crate) fn broken(scenario: &Scenario) -> Vec<BrokenRule> {
    let keys = &scenario.radio;
    let mut broken = delays(keys, "radio");
    // Values that a rule inherits from `[radio]` are blamed there.
    let base_holds = broken.is_empty();
    for (number, rule) in keys.rules.iter().enumerate() {
        let path = format!("radio.rule.{number}");
        broken.extend(drones(rule, &path, scenario.formation.drones));
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
