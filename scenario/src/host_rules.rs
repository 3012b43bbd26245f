//! Rules between the tables of `[[host]]`.

use crate::broken_rule::BrokenRule;
use crate::keys::Scenario;
use crate::name::is_name_char;
use std::collections::BTreeSet;

/// The rules that the scenario's hosts break.
pub(crate) fn broken(scenario: &Scenario) -> Vec<BrokenRule> {
    let (mut broken, mut names, mut placed) = (Vec::new(), BTreeSet::new(), 0);
    for (number, host) in scenario.hosts.iter().enumerate() {
        let mut refuse = |key: &str, message: String| {
            let keys = vec![format!("host.{number}.{key}"), format!("host.{number}")];
            broken.push(BrokenRule { keys, message });
        };
        if !host.name.chars().all(is_name_char) {
            refuse("name", format!("found {:?}, expected letters, digits, `.`, `_` or `-`", host.name));
        }
        if !names.insert(&host.name) {
            refuse("name", format!("found {:?} twice, expected a name of its own for each host", host.name));
        }
        placed += u64::from(host.drones);
        let drones = u64::from(scenario.formation.drones);
        if placed > drones {
            refuse(
                "drones",
                format!("found {placed} drones up to this host, expected formation.drones = {drones} at most"),
            );
        }
    }
    broken
}
