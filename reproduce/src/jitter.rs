//! Means over flights with jittered starts.

use crate::cases::{LOOK_AHEAD, PAPER, SHORTEST, jittered, seeds, title};
use crate::flight::Flight;
use crate::results::Results;
use crate::row::{Quantity, Row, pass_s};
use serde_json::{Value, json};
use skein_report::Summary;
use skein_sweep::statistics::{Estimate, mean};

/// One jittered start of a scenario, flown with every strategy.
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

/// A quantity that is averaged over the starts.
struct Mean {
    id: &'static str,
    words: &'static str,
    unit: &'static str,
    published: Value,
    /// The strategies whose flights it needs.
    strategies: &'static [&'static str],
    of: fn(&Start<'_>) -> Option<f64>,
}

/// The rows of all scenarios that are flown from jittered starts.
pub(crate) fn rows(results: &Results, quick: bool) -> Vec<Row> {
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
            let what = Quantity::new(prefix(quantity.id), words, quantity.unit, quantity.published);
            let row = what.row(json!(thousandths(found.mean)), commands.join("; "));
            rows.push(Row { interval: found.interval().map(|ends| ends.map(thousandths)), ..row });
        }
    }
    rows
}

fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// The mean over the seeds whose flights reached their goal.
fn over_seeds(results: &Results, scenario: &str, quick: bool, quantity: &Mean) -> Option<Estimate> {
    let values = seeds(quick).filter_map(|seed| (quantity.of)(&Start { results, scenario, seed }));
    mean(&values.collect::<Vec<f64>>())
}

fn one_obstacle() -> Vec<Mean> {
    vec![
        Mean {
            id: "R3.{}.time.jitter",
            words: "time to pass",
            unit: "s",
            published: json!(32.0),
            strategies: &[PAPER],
            of: |start| start.reached(PAPER).and_then(pass_s),
        },
        Mean {
            id: "R4.{}.energy.jitter",
            words: "energy, congestion-aware-paper",
            unit: "kJ",
            published: json!(54.111),
            strategies: &[PAPER],
            of: |start| Some(start.energy(PAPER)? / 1e3),
        },
        Mean {
            id: "R4.{}.energy.default.jitter",
            words: "energy, congestion-aware",
            unit: "kJ",
            published: Value::Null,
            strategies: &[LOOK_AHEAD],
            of: |start| Some(start.energy(LOOK_AHEAD)? / 1e3),
        },
        Mean {
            id: "R4.{}.energy.shortest.jitter",
            words: "energy, shortest-path",
            unit: "kJ",
            published: json!(62.084),
            strategies: &[SHORTEST],
            of: |start| Some(start.energy(SHORTEST)? / 1e3),
        },
        Mean {
            id: "R4.{}.ratio.jitter",
            words: "energy, shortest path / congestion aware",
            unit: "",
            published: json!(1.147),
            strategies: &[PAPER, SHORTEST],
            of: |start| Some(start.energy(SHORTEST)? / start.energy(PAPER)?),
        },
    ]
}

fn forest() -> Vec<Mean> {
    vec![
        Mean {
            id: "R5.passed.2.jitter",
            words: "second set passed",
            unit: "s",
            published: Value::Null,
            strategies: &[PAPER],
            of: |start| start.reached(PAPER)?.stages.last()?.passed_s,
        },
        Mean {
            id: "R5.energy.jitter",
            words: "energy, congestion-aware-paper",
            unit: "kJ",
            published: Value::Null,
            strategies: &[PAPER],
            of: |start| Some(start.energy(PAPER)? / 1e3),
        },
        Mean {
            id: "R5.ratio.jitter",
            words: "energy, shortest path / congestion aware",
            unit: "",
            published: Value::Null,
            strategies: &[PAPER, SHORTEST],
            of: |start| Some(start.energy(SHORTEST)? / start.energy(PAPER)?),
        },
        Mean {
            id: "R6.jitter",
            words: "error in the mean inter-drone distance",
            unit: "m",
            published: json!(0.8),
            strategies: &[PAPER],
            of: |start| start.reached(PAPER)?.mean_distance_error_m,
        },
    ]
}
