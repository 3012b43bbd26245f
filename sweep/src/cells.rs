//! Cells: the runs of one combination, averaged over the seeds, with 95 % intervals.

use crate::grid::Grid;
use crate::metrics::{METRICS, SUCCESS, own_name};
use crate::own_statistic::{OwnColumn, own_columns};
use crate::row::{Row, own_names};
use crate::statistics::{Estimate, failures_at_most, mean, rate};
use serde_json::{Map, Value, json};
use skein_report::number_text::tidy;
use std::collections::BTreeMap;

/// The results of one combination of scenario, strategy and grid values.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Name of the scenario.
    pub scenario: String,
    /// Strategy as flown.
    pub strategy: String,
    /// One value, as TOML, for each key of the grid.
    pub values: Vec<String>,
    /// Number of runs by outcome.
    pub outcomes: BTreeMap<String, usize>,
    /// Number of runs if all of them are one flight, with equal digests: the seed changes nothing. They give no interval. 0
    /// otherwise.
    pub equal: usize,
    /// Share of runs that reached their goal and kept every invariant.
    pub success: Option<Estimate>,
    /// One mean for each of [`METRICS`]; `None` if no run has a value.
    pub metrics: Vec<Option<Estimate>>,
    /// The mean, over all runs that have it, of each figure that pilots reported: by its name for the figure's mean, and by
    /// `NAME.last`, `NAME.min` and `NAME.max`.
    pub metrics_own: BTreeMap<String, Estimate>,
}

impl Cell {
    /// The estimate of the metric with this name; `None` if there is none. Figures that pilots report are called
    /// `metric.NAME`, `metric.NAME.last`, `.min` and `.max`.
    #[must_use]
    pub fn estimate(&self, name: &str) -> Option<Estimate> {
        match METRICS.iter().position(|metric| metric.name == name) {
            Some(i) => self.metrics[i],
            None if name == SUCCESS => self.success,
            None => self.metrics_own.get(own_name(name)?).copied(),
        }
    }

    /// If no run failed: at most this share of runs fails, with 95 % confidence. `None` if one failed, or if all runs are one
    /// flight.
    #[must_use]
    pub fn failures_at_most(&self) -> Option<f64> {
        let success = self.success.filter(|success| self.equal == 0 && success.mean == 1.0)?;
        failures_at_most(success.n)
    }

    /// The cell as it stands in summary.json.
    pub(crate) fn json(&self, keys: &[&str]) -> Value {
        let metrics: Map<String, Value> =
            METRICS.iter().zip(&self.metrics).map(|(metric, found)| (metric.name.to_owned(), json!(found))).collect();
        json!({
            "scenario": self.scenario, "strategy": self.strategy, "grid": grid_json(keys, &self.values),
            "n": self.outcomes.values().sum::<usize>(), "outcomes": self.outcomes,
            "equal_digests": self.equal > 0, "success": self.success,
            "failures_at_most": self.failures_at_most(), "metrics": metrics, "metrics_own": self.metrics_own,
        })
    }
}

/// A JSON object with the value of each key of a grid. The values are TOML.
pub(crate) fn grid_json(keys: &[&str], values: &[String]) -> Map<String, Value> {
    keys.iter().zip(values).map(|(key, value)| ((*key).to_owned(), toml_json(value))).collect()
}

/// A TOML value as JSON. What is not TOML stays text.
fn toml_json(value: &str) -> Value {
    toml_value(value).and_then(|value| serde_json::to_value(value).ok()).unwrap_or_else(|| json!(value))
}

/// Parses one TOML value; `None` if the text is not one.
pub(crate) fn toml_value(text: &str) -> Option<toml::Value> {
    toml::from_str::<toml::Table>(&format!("value = {text}")).ok()?.remove("value")
}

/// One cell for each combination that has rows, in the grid's order. Rows are in the order of their jobs.
pub(crate) fn cells(grid: &Grid<'_>, rows: &[Row]) -> Vec<Cell> {
    let combination = |row: &Row| std::ptr::from_ref(grid.job(row.job).0);
    rows.chunk_by(|a, b| combination(a) == combination(b)).map(|rows| cell(grid, rows)).collect()
}

/// Whether these are at least two runs, all flown, with equal digests.
pub(crate) fn are_equal(rows: &[Row]) -> bool {
    let first = rows[0].digest.as_ref();
    rows.len() > 1 && first.is_some() && rows.iter().all(|row| row.digest.as_ref() == first)
}

fn cell(grid: &Grid<'_>, rows: &[Row]) -> Cell {
    let combination = grid.job(rows[0].job).0;
    let mut outcomes = BTreeMap::new();
    for row in rows {
        *outcomes.entry(row.outcome.clone()).or_insert(0) += 1;
    }
    let equal = if are_equal(rows) { rows.len() } else { 0 };
    let valid = |estimate: Estimate| if equal > 0 { estimate.without_interval() } else { estimate };
    let reached = rows.iter().filter(|row| row.reached()).count();
    let flown = rows.iter().map(|row| &row.strategy).find(|strategy| !strategy.is_empty());
    let estimate = |i: usize| {
        let counts = |row: &&Row| row.reached() || !METRICS[i].reached_only;
        let values = rows.iter().filter(counts).filter_map(|row| row.metrics.get(i).copied().flatten());
        mean(&values.collect::<Vec<f64>>()).map(valid)
    };
    let own = |(name, column): (String, OwnColumn<'_>)| {
        let values: Vec<f64> = rows.iter().filter_map(|row| row.own(column)).collect();
        Some((name, tidied(valid(mean(&values)?))))
    };
    Cell {
        metrics_own: own_columns(&own_names(rows)).into_iter().filter_map(own).collect(),
        scenario: grid.scenario_name(combination),
        strategy: flown.or(combination.strategy.as_ref()).cloned().unwrap_or_default(),
        values: combination.values.clone(),
        outcomes,
        equal,
        success: rate(reached, rows.len()).map(valid),
        metrics: (0..METRICS.len()).map(estimate).collect(),
    }
}

/// The estimate without the residue of arithmetic: people read it in summary.json.
fn tidied(of: Estimate) -> Estimate {
    let (low, high) = (of.low.map(tidy), of.high.map(tidy));
    Estimate { mean: tidy(of.mean), low, high, min: tidy(of.min), max: tidy(of.max), ..of }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Axis, Experiment, Mission};
    use crate::random_scene::SceneBounds;
    use skein_report::OwnMetric;

    /// Two values of one key, three seeds each.
    fn experiment() -> Experiment {
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::Random],
            strategies: vec![],
            strategy_places: vec![],
            seeds: vec![1, 2, 3],
            grid: vec![Axis {
                key: "radio.loss".to_owned(),
                values: vec!["0".to_owned(), "0.5".to_owned()],
                places: vec![],
            }],
            processes: false,
            metrics: None,
            bounds: SceneBounds::default(),
        }
    }

    #[test]
    fn times_are_averaged_over_reached_runs_and_distances_over_all() {
        let experiment = experiment();
        let grid = Grid::new(&experiment, &[]);
        let row = |job: usize, outcome: &str, time_s: f64, separation_m: f64| Row {
            metrics: METRICS
                .iter()
                .map(|metric| match metric.name {
                    "mission_s" => Some(time_s),
                    "min_separation_m" => Some(separation_m),
                    _ => None,
                })
                .collect(),
            strategy: "shortest-path".to_owned(),
            ..Row::unflown(job, outcome, "")
        };
        let rows = [
            row(0, "reached", 50.0, 40.0),
            row(1, "timeout", 600.0, 30.0),
            row(2, "reached", 60.0, 35.0),
            Row::unflown(3, "failed", "no"),
        ];
        let cells = cells(&grid, &rows);
        assert_eq!(cells.len(), 2);
        let time = cells[0].estimate("mission_s").unwrap();
        assert_eq!((time.n, time.mean), (2, 55.0));
        assert_eq!(cells[0].estimate("min_separation_m").unwrap().min, 30.0);
        let success = cells[0].estimate(SUCCESS).unwrap();
        assert_eq!((success.n, success.mean), (3, 2.0 / 3.0));
        let json = cells[1].json(&["radio.loss"]);
        assert_eq!((&json["grid"]["radio.loss"], &json["outcomes"]["failed"]), (&json!(0.5), &json!(1)));
        assert_eq!(json["metrics"]["mission_s"], Value::Null);
    }

    #[test]
    fn runs_with_equal_digests_give_no_interval() {
        let experiment = experiment();
        let grid = Grid::new(&experiment, &[]);
        let row = |job: usize, digest: &str| Row {
            metrics: METRICS.iter().map(|_| Some(50.0)).collect(),
            digest: Some(digest.to_owned()),
            ..Row::unflown(job, "reached", "")
        };
        let digests = ["a", "a", "a", "b", "b", "c"];
        let rows: Vec<Row> = (0..).zip(digests).map(|(job, digest)| row(job, digest)).collect();
        let cells = cells(&grid, &rows);
        assert_eq!((cells[0].equal, cells[1].equal), (3, 0));
        for name in [SUCCESS, "mission_s"] {
            let interval = |cell: &Cell| cell.estimate(name).unwrap().interval();
            assert!(interval(&cells[0]).is_none() && interval(&cells[1]).is_some(), "{name}");
        }
        let json = cells[0].json(&["radio.loss"]);
        assert_eq!((&json["equal_digests"], &json["metrics"]["mission_s"]["low"]), (&json!(true), &Value::Null));
        let text = crate::table::table(&cells, &["radio.loss"], &["mission_s".to_owned()]);
        assert!(text.contains("3, all equal") && text.contains("\n3 runs of random with 0 are one flight"), "{text}");
        assert!(text.contains("50 ± 0"), "{text}");
    }

    #[test]
    fn figures_of_pilots_are_columns_and_have_intervals() {
        let experiment = Experiment { grid: vec![], ..experiment() };
        let grid = Grid::new(&experiment, &[]);
        let figure = |mean: f64| OwnMetric { mean, last: mean + 1.0, min: mean - 2.0, max: mean + 3.0 };
        let row = |job: usize, own: &[(&str, f64)]| Row {
            metrics_own: own.iter().map(|&(name, value)| (name.to_owned(), figure(value))).collect(),
            ..Row::unflown(job, "reached", "")
        };
        let rows = [row(0, &[("order", 0.5)]), row(1, &[("order", 1.0), ("gap", 3.0)]), row(2, &[])];
        let cells = cells(&grid, &rows);
        let order = cells[0].metrics_own["order"];
        assert!(order.mean == 0.75 && order.interval().is_some());
        assert_eq!(cells[0].estimate("metric.gap").map(|gap| gap.n), Some(1));
        assert!(cells[0].estimate("gap").is_none() && cells[0].estimate("metric.lag").is_none());
        let json = cells[0].json(&[]);
        let means = ["gap", "gap.last", "gap.min", "gap.max"].map(|name| json["metrics_own"][name]["mean"].as_f64());
        assert_eq!(means, [3.0, 4.0, 1.0, 6.0].map(Some));
        assert_eq!(cells[0].estimate("metric.order.last").map(|last| (last.n, last.mean)), Some((2, 1.75)));
        let mut csv = Vec::new();
        crate::row::write_csv(&mut csv, &grid, &rows).unwrap();
        let csv = String::from_utf8(csv).unwrap();
        let lines: Vec<&str> = csv.lines().collect();
        let columns = ["gap", "gap.last", "gap.max", "gap.min", "order", "order.last", "order.max", "order.min"];
        let columns = columns.map(|name| format!("metric.{name}")).join(",");
        assert!(lines[0].contains(&format!(",{columns},digest,")), "{csv}");
        assert!(lines[1].contains(",,,,,0.5,1.5,3.5,-1.5,,") && lines[2].contains(",3,4,6,1,1,2,4,-1,"), "{csv}");
    }
}
