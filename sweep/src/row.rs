//! The result of one run: a line of rows.jsonl, and of runs.csv.

use crate::grid::Grid;
use crate::metrics::{METRICS, OWN_PREFIX};
use crate::own_statistic::{OwnColumn, own_columns};
use serde::{Deserialize, Serialize};
use skein_report::table::quoted;
use skein_report::text::split;
use skein_report::{OwnMetric, Summary, Violation};
use skein_scenario::Scenario;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

/// The result of one run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Job number of the run in the grid.
    pub job: usize,
    /// `reached`, `timeout`, `unsafe` or `aborted` if the run was flown; `invalid` if its scenario is not valid;
    /// `failed` if it could not be flown.
    pub outcome: String,
    /// Why it did not reach its goal, in words.
    pub reason: Option<String>,
    /// Strategy as flown; empty if the run was not flown.
    pub strategy: String,
    /// Time to pass each obstacle set, s.
    pub pass_times_s: Vec<Option<f64>>,
    /// Drones on each route of each obstacle set, rightmost route first.
    pub splits: Vec<Option<Vec<u32>>>,
    /// One value for each of [`METRICS`]; empty if the run was not flown.
    pub metrics: Vec<Option<f64>>,
    /// The figures that pilots reported, by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub metrics_own: BTreeMap<String, OwnMetric>,
    /// Digest of the run, hex.
    pub digest: Option<String>,
    /// The kinds of the invariants that were broken, each once, in the order in which they were broken first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failures: Vec<String>,
}

impl Row {
    /// The row of a run that was flown.
    #[must_use]
    pub fn flown(job: usize, summary: &Summary, scenario: &Scenario) -> Self {
        let outcome = serde_json::to_value(summary.outcome).ok().and_then(|word| word.as_str().map(str::to_owned));
        let count = summary.violations.len();
        let broken = summary.violations.first().map(|first| violation_text(first, count));
        Self {
            job,
            outcome: outcome.unwrap_or_default(),
            reason: broken.or_else(|| summary.reason.clone()),
            strategy: summary.strategy.clone(),
            pass_times_s: summary.stages.iter().map(|stage| stage.pass_time_s).collect(),
            splits: summary.stages.iter().map(|stage| stage.split.clone()).collect(),
            metrics: METRICS.iter().map(|metric| (metric.value)(summary, scenario)).collect(),
            metrics_own: summary.metrics_own.clone(),
            digest: summary.digest.clone(),
            failures: kinds(&summary.violations),
        }
    }

    /// The row of a run that was not flown. Its outcome is `invalid` or `failed`.
    #[must_use]
    pub fn unflown(job: usize, outcome: &str, reason: &str) -> Self {
        Self {
            job,
            outcome: outcome.to_owned(),
            reason: Some(reason.to_owned()),
            strategy: String::new(),
            pass_times_s: Vec::new(),
            splits: Vec::new(),
            metrics: Vec::new(),
            metrics_own: BTreeMap::new(),
            digest: None,
            failures: Vec::new(),
        }
    }

    /// Whether the run did not come to its own end: a process of it was killed from outside, or it could not be flown. A sweep that is
    /// resumed flies it again.
    #[must_use]
    pub fn is_cut_short(&self) -> bool {
        self.outcome == "aborted" || self.outcome == "failed"
    }

    /// A statistic of a figure that pilots reported; `None` if they did not.
    pub(crate) fn own(&self, column: OwnColumn<'_>) -> Option<f64> {
        self.metrics_own.get(column.figure).map(|figure| column.statistic.of(figure))
    }

    /// Whether the run reached its goal and kept every invariant.
    #[must_use]
    pub fn reached(&self) -> bool {
        self.outcome == "reached"
    }
}

/// The kinds of the violations, each once.
fn kinds(violations: &[Violation]) -> Vec<String> {
    let mut kinds = Vec::new();
    for violation in violations {
        let kind = kind_name(violation);
        if !kinds.contains(&kind) {
            kinds.push(kind);
        }
    }
    kinds
}

/// The violation's kind, as in summary.json.
fn kind_name(violation: &Violation) -> String {
    serde_json::to_value(violation.kind).ok().and_then(|kind| kind.as_str().map(str::to_owned)).unwrap_or_default()
}

fn violation_text(first: &Violation, count: usize) -> String {
    let kind = kind_name(first);
    let value = if first.kind.is_distance() { format!(": {:.3} m", first.value_m) } else { String::new() };
    format!("{kind} of {:?}{value} at {} s, {count} in all", first.drones, first.t_s)
}

/// The names of all figures that pilots reported in these runs.
pub(crate) fn own_names(rows: &[Row]) -> BTreeSet<&str> {
    rows.iter().flat_map(|row| row.metrics_own.keys().map(String::as_str)).collect()
}

/// Writes runs.csv: one line for each row. Rows are in the order of their jobs.
pub(crate) fn write_csv(out: &mut impl Write, grid: &Grid<'_>, rows: &[Row]) -> std::io::Result<()> {
    let own = own_columns(&own_names(rows));
    let mut head: Vec<String> = ["scenario", "strategy", "seed"].map(str::to_owned).to_vec();
    head.extend(grid.keys().into_iter().map(str::to_owned));
    head.extend(["outcome", "pass_times_s", "splits_left_to_right"].map(str::to_owned));
    head.extend(METRICS.iter().map(|metric| metric.name.to_owned()));
    head.extend(own.keys().map(|name| format!("{OWN_PREFIX}{name}")));
    head.extend(["digest", "reason", "command", "failures"].map(str::to_owned));
    line(out, head.into_iter())?;
    for row in rows {
        line(out, fields(grid, row, own.values().copied()).into_iter())?;
    }
    Ok(())
}

fn fields<'a>(grid: &Grid<'_>, row: &Row, own: impl Iterator<Item = OwnColumn<'a>>) -> Vec<String> {
    let (combination, seed) = grid.job(row.job);
    let number = |value: &Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let strategy =
        if row.strategy.is_empty() { combination.strategy.clone().unwrap_or_default() } else { row.strategy.clone() };
    let mut fields = vec![grid.scenario_name(combination), strategy, seed.to_string()];
    fields.extend(combination.values.iter().map(|value| value.trim_matches('"').to_owned()));
    fields.push(row.outcome.clone());
    fields.push(row.pass_times_s.iter().map(number).collect::<Vec<_>>().join(" "));
    fields.push(
        row.splits.iter().map(|drones| drones.as_deref().map(split).unwrap_or_default()).collect::<Vec<_>>().join(" "),
    );
    fields.extend((0..METRICS.len()).map(|i| row.metrics.get(i).map(number).unwrap_or_default()));
    fields.extend(own.map(|column| number(&row.own(column))));
    fields.extend([row.digest.clone(), row.reason.clone()].map(Option::unwrap_or_default));
    fields.push(grid.command(row.job));
    fields.push(row.failures.join(";"));
    fields
}

fn line(out: &mut impl Write, fields: impl Iterator<Item = String>) -> std::io::Result<()> {
    writeln!(out, "{}", fields.map(|field| quoted(&field).into_owned()).collect::<Vec<_>>().join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_violation_is_named_once() {
        use skein_protocol::record::ViolationKind::{BallotWentBack, Separation};
        let violation = |kind| Violation { t_s: 1.0, kind, drones: vec![0, 1], value_m: 2.0 };
        let kinds = kinds(&[Separation, BallotWentBack, Separation].map(violation));
        assert_eq!(kinds.join(";"), "separation;ballot-went-back");
    }

    #[test]
    fn fields_with_commas_and_quotes_are_quoted() {
        let mut out = Vec::new();
        line(&mut out, ["a", "b,c", "say \"d\"", ""].into_iter().map(str::to_owned)).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "a,\"b,c\",\"say \"\"d\"\"\",\n");
    }
}
