//! Rules between the tables of `[[pilot]]`.

use crate::broken_rule::BrokenRule;
use crate::keys::Scenario;
use crate::name::is_name_char;
use std::collections::BTreeMap;

/// The rules that the scenario's pilots break.
pub(crate) fn broken(scenario: &Scenario) -> Vec<BrokenRule> {
    let mut broken: Vec<BrokenRule> = Vec::new();
    let mut rest: Option<usize> = None;
    let mut taken: BTreeMap<u32, usize> = BTreeMap::new();
    for (number, pilot) in scenario.pilots.iter().enumerate() {
        let path = format!("pilot.{number}");
        if let Some(name) = pilot.name.as_ref().filter(|name| !name.chars().all(is_name_char)) {
            let message = format!("found {name:?}, expected letters, digits, `.`, `_` or `-`");
            broken.push(BrokenRule { keys: vec![format!("{path}.name")], message });
        }
        if let Some(place) = pilot.command.iter().flatten().position(String::is_empty) {
            let message = "found an empty word, expected a program and its arguments".to_owned();
            broken.push(BrokenRule { keys: vec![format!("{path}.command.{place}")], message });
        }
        let Some(drones) = &pilot.drones else {
            if let Some(first) = rest.replace(number) {
                let message = format!("is missing: pilot.{first} flies all drones that no other table names already");
                broken.push(BrokenRule { keys: vec![format!("{path}.drones"), path], message });
            }
            continue;
        };
        for (place, &drone) in drones.iter().enumerate() {
            let keys = vec![format!("{path}.drones.{place}"), "formation.drones".to_owned()];
            if drone >= scenario.formation.drones {
                let message =
                    format!("found drone {drone}, expected one below formation.drones = {}", scenario.formation.drones);
                broken.push(BrokenRule { keys, message });
            } else if let Some(other) = taken.insert(drone, number) {
                let message = format!("found drone {drone}, which pilot.{other} flies already");
                broken.push(BrokenRule { keys, message });
            }
        }
    }
    broken
}
