//! The results of a complete sweep, and the files and texts that show them.

use crate::cells::{Cell, cells};
use crate::energy_ratios::{self, EnergyRatios, energy_ratios};
use crate::error::SweepError;
use crate::experiment::Mission;
use crate::grid::Grid;
use crate::metrics::{DEFAULT, METRICS, OWN_PREFIX, SUCCESS};
use crate::paired::{self, PairedDifference, paired};
use crate::plots::{Plot, plots};
use crate::row::{Row, own_names, write_csv};
use crate::table::table;
use serde_json::{Value, json};
use skein_report::table::{ColumnKind, csv_to_parquet, inferred};

/// Columns of runs.csv that are texts, even if they look like numbers.
const TEXTS: [&str; 9] = [
    "scenario",
    "strategy",
    "outcome",
    "pass_times_s",
    "splits_left_to_right",
    "digest",
    "reason",
    "command",
    "failures",
];

/// The results of a complete sweep.
#[derive(Debug)]
pub struct SweepReport<'a> {
    grid: &'a Grid<'a>,
    rows: Vec<Row>,
    cells: Vec<Cell>,
    ratios: Vec<EnergyRatios>,
    paired: Vec<PairedDifference>,
}

impl<'a> SweepReport<'a> {
    /// Evaluates the rows of all runs, which may be in any order.
    pub(crate) fn new(grid: &'a Grid<'a>, mut rows: Vec<Row>) -> Self {
        rows.sort_by_key(|row| row.job);
        let (cells, ratios) = (cells(grid, &rows), energy_ratios(grid, &rows));
        let mut report = Self { grid, rows, cells, ratios, paired: Vec::new() };
        report.paired = paired(grid, &report.rows, &report.metrics());
        report
    }

    /// One row for each run, in the order of the jobs.
    #[must_use]
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// One cell for each combination, in the grid's order.
    #[must_use]
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The energy of each strategy against that of `shortest-path`.
    #[must_use]
    pub fn energy_ratios(&self) -> &[EnergyRatios] {
        &self.ratios
    }

    /// Each strategy against each other one, in the metrics of the table.
    #[must_use]
    pub fn paired(&self) -> &[PairedDifference] {
        &self.paired
    }

    /// The content of summary.json.
    #[must_use]
    pub fn summary(&self) -> Value {
        let (experiment, keys) = (self.grid.experiment(), self.grid.keys());
        json!({
            "schema": "skein-sweep/1", "experiment": experiment.name, "runs": self.rows.len(),
            "scenarios": experiment.scenarios.iter().map(scenario).collect::<Vec<Value>>(),
            "seeds": experiment.seeds, "keys": keys,
            "cells": self.cells.iter().map(|cell| cell.json(&keys)).collect::<Vec<Value>>(),
            "ratios": self.ratios.iter().map(|ratios| ratios.json(&keys)).collect::<Vec<Value>>(),
            "paired": self.paired.iter().map(|difference| difference.json(&keys)).collect::<Vec<Value>>(),
        })
    }

    /// The content of runs.csv: one line for each run.
    #[must_use]
    pub fn csv(&self) -> Vec<u8> {
        let mut csv = Vec::new();
        // Writing to memory cannot fail.
        let _ = write_csv(&mut csv, self.grid, &self.rows);
        csv
    }

    /// The content of runs.parquet: the columns of runs.csv. A column is of numbers if each of its fields that is not empty is
    /// one.
    ///
    /// # Errors
    /// [`SweepError::Table`].
    pub fn parquet(&self) -> Result<Vec<u8>, SweepError> {
        let csv = self.csv();
        let numbers = inferred(&csv);
        let kind = |name: &str| if TEXTS.contains(&name) { ColumnKind::Text } else { numbers(name) };
        Ok(csv_to_parquet(&csv[..], Vec::new(), kind)?)
    }

    /// The content of ratios.csv; `None` if there are no energy ratios.
    #[must_use]
    pub fn ratios_csv(&self) -> Option<String> {
        (!self.ratios.is_empty()).then(|| energy_ratios::csv(&self.ratios, &self.grid.keys()))
    }

    /// All plots.
    ///
    /// # Errors
    /// [`SweepError::Plot`].
    pub fn plots(&self) -> Result<Vec<Plot>, SweepError> {
        let experiment = self.grid.experiment();
        let mut all = plots(experiment, &self.cells, &self.in_order())?;
        let ratios = energy_ratios::figure(&experiment.name, &self.ratios)?;
        all.extend(ratios.map(|svg| Plot { file: "ratios.svg".to_owned(), svg }));
        all.extend(paired::plots(experiment, &self.paired)?);
        Ok(all)
    }

    /// Names of the metrics that are plotted and tabled, in the experiment's order.
    fn metrics(&self) -> Vec<String> {
        self.grid.experiment().metrics.clone().unwrap_or_else(|| {
            let own = own_names(&self.rows).into_iter().map(|name| format!("{OWN_PREFIX}{name}"));
            DEFAULT.iter().map(|&name| name.to_owned()).chain(own).collect()
        })
    }

    /// The same in the order in which they are plotted: that of the columns of runs.csv.
    fn in_order(&self) -> Vec<String> {
        let mut metrics = self.metrics();
        let built_in = |name: &str| {
            let mut all = std::iter::once(SUCCESS).chain(METRICS.iter().map(|metric| metric.name));
            all.position(|known| known == name).unwrap_or(usize::MAX)
        };
        metrics.sort_by(|a, b| (built_in(a), a).cmp(&(built_in(b), b)));
        metrics
    }

    /// The results as a text table, followed by the energy ratios and the paired differences of the strategies.
    #[must_use]
    pub fn table(&self) -> String {
        let table = table(&self.cells, &self.grid.keys(), &self.metrics());
        table + &energy_ratios::text(&self.ratios) + &paired::text(&self.paired)
    }
}

fn scenario(mission: &Mission) -> Value {
    match mission {
        Mission::Random => json!("random"),
        Mission::Wide => json!("wide"),
        Mission::File { path, .. } => json!(path),
    }
}
