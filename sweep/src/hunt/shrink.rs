//! Makes a failing mission small: delta debugging (Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input",
//! 2002) over drones, obstacles, faults, tables and keys; then numbers with fewer digits. What remains still fails in the same
//! way.

use super::failure::Failure;
use crate::flight::{Interrupted, fly_inline};
use skein_runtime::PilotRegistry;
use skein_scenario::{Scenario, ScenarioSource};
use toml::{Table, Value};

/// Lists whose entries are removed.
const LISTS: [&str; 2] = ["obstacle", "fault"];
/// Numbers are tried with this many significant digits.
const DIGITS: [usize; 3] = [1, 2, 3];
/// The name of a shrunk mission.
const NAME: &str = "finding";

/// A mission that was made small.
pub(super) struct Shrunk {
    pub(super) failure: Failure,
    pub(super) toml: String,
    pub(super) flights: usize,
}

/// The search for a smaller mission.
struct Shrinker<'a> {
    /// The smallest mission so far that fails.
    table: Table,
    failure: Failure,
    flights: usize,
    most_flights: usize,
    pilots: &'a PilotRegistry,
    interrupted: &'a Interrupted<'a>,
}

/// Makes a mission small that fails in this way, with at most `most_flights` flights.
pub(super) fn shrink(
    scenario: &Scenario,
    failure: Failure,
    most_flights: usize,
    (pilots, interrupted): (&PilotRegistry, &Interrupted<'_>),
) -> Shrunk {
    // A checked scenario can be written as TOML, and its text can be read.
    let text = scenario.to_toml().unwrap_or_default();
    let mut table: Table = toml::from_str(&text).unwrap_or_default();
    table.insert("name".to_owned(), Value::from(NAME));
    let mut shrinker = Shrinker { table, failure, flights: 0, most_flights, pilots, interrupted };
    loop {
        let before = shrinker.table.clone();
        shrinker.drop_keys();
        shrinker.drop_entries();
        shrinker.reduce_drones();
        shrinker.round_numbers();
        if shrinker.table == before || shrinker.is_over() {
            break;
        }
    }
    Shrunk { failure: shrinker.failure, toml: shrinker.table.to_string(), flights: shrinker.flights }
}

impl Shrinker<'_> {
    fn is_over(&self) -> bool {
        self.flights >= self.most_flights || (self.interrupted)().is_some()
    }

    /// Takes a smaller mission if it is valid and fails in the same way. Returns whether it was taken.
    fn accept(&mut self, table: Table) -> bool {
        if self.is_over() || table == self.table {
            return false;
        }
        let source = ScenarioSource { name: NAME, stem: NAME };
        let Ok(scenario) = Scenario::parse(&table.to_string(), source, &[]) else { return false };
        self.flights += 1;
        let Ok(summary) = fly_inline(&scenario, self.pilots, self.interrupted) else { return false };
        let Some(failure) = Failure::of(&summary, &scenario).filter(|found| found.kind == self.failure.kind) else {
            return false;
        };
        (self.table, self.failure) = (table, failure);
        true
    }

    /// Removes whole tables, then single keys: their defaults may do.
    fn drop_keys(&mut self) {
        let tables: Vec<String> = self.table.iter().filter(|(_, v)| v.is_table()).map(|(key, _)| key.clone()).collect();
        for name in tables {
            let mut smaller = self.table.clone();
            smaller.remove(&name);
            if self.accept(smaller) {
                continue;
            }
            let keys: Vec<String> = self.table[&name].as_table().into_iter().flat_map(Table::keys).cloned().collect();
            for key in keys {
                let mut smaller = self.table.clone();
                if let Some(table) = smaller.get_mut(&name).and_then(Value::as_table_mut) {
                    table.remove(&key);
                }
                self.accept(smaller);
            }
        }
        for key in ["strategy", "seed"] {
            let mut smaller = self.table.clone();
            smaller.remove(key);
            self.accept(smaller);
        }
    }

    /// Removes entries of the lists: halves first, then smaller parts, at last single entries.
    fn drop_entries(&mut self) {
        for list in LISTS {
            let mut part = self.entries(list).div_ceil(2);
            while part > 0 {
                let mut first = 0;
                while first < self.entries(list) {
                    let mut smaller = self.table.clone();
                    if let Some(entries) = smaller.get_mut(list).and_then(Value::as_array_mut) {
                        let end = (first + part).min(entries.len());
                        entries.drain(first..end);
                    }
                    if !self.accept(smaller) {
                        first += part;
                    }
                }
                part /= 2;
            }
        }
    }

    fn entries(&self, list: &str) -> usize {
        self.table.get(list).and_then(Value::as_array).map_or(0, Vec::len)
    }

    /// Halves the number of drones as long as possible, then removes single drones.
    fn reduce_drones(&mut self) {
        loop {
            let Some(drones) = self.table.get("formation").and_then(|f| f.get("drones")?.as_integer()) else { return };
            let taken = [drones / 2, drones - 1].into_iter().filter(|fewer| *fewer >= 1).any(|fewer| {
                let mut smaller = self.table.clone();
                if let Some(formation) = smaller.get_mut("formation").and_then(Value::as_table_mut) {
                    formation.insert("drones".to_owned(), Value::from(fewer));
                }
                self.accept(smaller)
            });
            if !taken {
                return;
            }
        }
    }

    /// Writes numbers with as few digits as possible.
    fn round_numbers(&mut self) {
        for number in 0..count_floats(&Value::Table(self.table.clone())) {
            for digits in DIGITS {
                let mut smaller = Value::Table(self.table.clone());
                round_float(&mut smaller, &mut { number }, digits);
                let Value::Table(smaller) = smaller else { return };
                if smaller == self.table || self.accept(smaller) {
                    break;
                }
            }
        }
    }
}

fn count_floats(value: &Value) -> usize {
    match value {
        Value::Float(_) => 1,
        Value::Array(values) => values.iter().map(count_floats).sum(),
        Value::Table(table) => table.values().map(count_floats).sum(),
        _ => 0,
    }
}

/// Rounds the float with this number, in the order of the text, to significant digits. Counts `number` down on the way.
fn round_float(value: &mut Value, number: &mut usize, digits: usize) -> bool {
    match value {
        Value::Float(float) if *number == 0 => {
            *float = rounded(*float, digits);
            true
        }
        Value::Float(_) => {
            *number -= 1;
            false
        }
        Value::Array(values) => values.iter_mut().any(|value| round_float(value, number, digits)),
        Value::Table(table) => table.iter_mut().any(|(_, value)| round_float(value, number, digits)),
        _ => false,
    }
}

/// A number with this many significant digits.
fn rounded(value: f64, digits: usize) -> f64 {
    // The text of a number is a number.
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        assert_eq!((rounded(0.012_345, 2), rounded(-98_765.0, 1), rounded(0.0, 3)), (0.012, -1e5, 0.0));
    }

    #[test]
    fn each_float_is_found_once() {
        let mut value: Value = toml::from_str("a = 1.25\nb = [2.55, { c = 3.75 }]\nd = 4").unwrap();
        assert_eq!(count_floats(&value), 3);
        assert!(round_float(&mut value, &mut 2, 1) && !round_float(&mut value, &mut 3, 1));
        assert_eq!(value["b"][1]["c"].as_float(), Some(4.0));
    }
}
