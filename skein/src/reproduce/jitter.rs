//! Means over jittered starts.

use super::flight::Flight;
use super::flights::{DEFAULT, PAPER, SHORTEST, jittered, seeds, title};
use super::results::Results;
use super::rows::{Row, pass_s};
use crate::sweep::statistics::{Estimate, mean};
use serde_json::{Value, json};
use skein_report::Summary;

/// One start of a scenario, flown by every strategy.
struct Start<'a> {
    results: &'a Results,
    scenario: &'a str,
    seed: u64,
}

impl Start<'_> {
    fn flight(&self, strategy: &str) -> Flight {
        Flight::new(self.scenario, strategy).jittered(self.seed)
    }

    fn reached(&self, strategy: &str) -> Option<&Summary> {
        self.results.reached(&self.flight(strategy))
    }

    fn energy(&self, strategy: &str) -> Option<f64> {
        Some(self.reached(strategy)?.energy_j.total)
    }
}

/// What is averaged.
struct Quantity {
    id: &'static str,
    words: &'static str,
    unit: &'static str,
    published: Value,
    /// The strategies that have to be flown for it.
    strategies: &'static [&'static str],
    of: fn(&Start<'_>) -> Option<f64>,
}

/// The rows of all scenarios that are flown from jittered starts.
pub fn rows(results: &Results, quick: bool) -> Vec<Row> {
    let mut rows = Vec::new();
    for scenario in jittered(quick) {
        let prefix = |id: &str| match scenario.split_once('-') {
            Some((geometry, _)) => id.replace("{}", &title(geometry)),
            None => id.to_owned(),
        };
        for quantity in if *scenario == "forest" { forest() } else { one_obstacle() } {
            let Some(found) = over_seeds(results, scenario, quick, &quantity) else { continue };
            let first = Start { results, scenario, seed: 1 };
            let commands: Vec<String> =
                quantity.strategies.iter().map(|strategy| first.flight(strategy).command()).collect();
            let words = format!(
                "{}, {}, mean of {} jittered starts (command: the first)",
                quantity.words,
                title(scenario),
                found.n
            );
            let ours = json!(thousandths(found.mean));
            rows.push(Row {
                interval: Some([found.low, found.high].map(thousandths)),
                ..Row::new(prefix(quantity.id), words, quantity.unit, (quantity.published, ours), commands.join("; "))
            });
        }
    }
    rows
}

fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// The mean over those seeds whose flights reached their goal.
fn over_seeds(results: &Results, scenario: &str, quick: bool, quantity: &Quantity) -> Option<Estimate> {
    let values = seeds(quick).filter_map(|seed| (quantity.of)(&Start { results, scenario, seed }));
    mean(&values.collect::<Vec<f64>>())
}

fn one_obstacle() -> Vec<Quantity> {
    vec![
        Quantity {
            id: "R3.{}.time.jitter",
            words: "time to pass",
            unit: "s",
            published: json!(32.0),
            strategies: &[PAPER],
            of: |start| start.reached(PAPER).and_then(pass_s),
        },
        Quantity {
            id: "R4.{}.energy.jitter",
            words: "energy, congestion-aware-paper",
            unit: "kJ",
            published: json!(54.111),
            strategies: &[PAPER],
            of: |start| Some(start.energy(PAPER)? / 1e3),
        },
        Quantity {
            id: "R4.{}.energy.default.jitter",
            words: "energy, congestion-aware",
            unit: "kJ",
            published: Value::Null,
            strategies: &[DEFAULT],
            of: |start| Some(start.energy(DEFAULT)? / 1e3),
        },
        Quantity {
            id: "R4.{}.energy.shortest.jitter",
            words: "energy, shortest-path",
            unit: "kJ",
            published: json!(62.084),
            strategies: &[SHORTEST],
            of: |start| Some(start.energy(SHORTEST)? / 1e3),
        },
        Quantity {
            id: "R4.{}.ratio.jitter",
            words: "energy, shortest path / congestion aware",
            unit: "",
            published: json!(1.147),
            strategies: &[PAPER, SHORTEST],
            of: |start| Some(start.energy(SHORTEST)? / start.energy(PAPER)?),
        },
    ]
}

fn forest() -> Vec<Quantity> {
    vec![
        Quantity {
            id: "R5.passed.2.jitter",
            words: "second set passed",
            unit: "s",
            published: Value::Null,
            strategies: &[PAPER],
            of: |start| start.reached(PAPER)?.stages.last()?.passed_s,
        },
        Quantity {
            id: "R5.energy.jitter",
            words: "energy, congestion-aware-paper",
            unit: "kJ",
            published: Value::Null,
            strategies: &[PAPER],
            of: |start| Some(start.energy(PAPER)? / 1e3),
        },
        Quantity {
            id: "R5.ratio.jitter",
            words: "energy, shortest path / congestion aware",
            unit: "",
            published: Value::Null,
            strategies: &[PAPER, SHORTEST],
            of: |start| Some(start.energy(SHORTEST)? / start.energy(PAPER)?),
        },
        Quantity {
            id: "R6.jitter",
            words: "error in the mean inter-drone distance",
            unit: "m",
            published: json!(0.8),
            strategies: &[PAPER],
            of: |start| start.reached(PAPER)?.mean_distance_error_m,
        },
    ]
}
