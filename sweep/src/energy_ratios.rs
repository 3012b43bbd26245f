//! Energy ratios: the energy of each run over that of `shortest-path` on the same mission with the same seed.

use crate::cells::are_equal;
use crate::cells::grid_json;
use crate::error::SweepError;
use crate::grid::Grid;
use crate::metrics::METRICS;
use crate::row::Row;
use crate::statistics::{self, Estimate, rate};
use serde_json::{Value, json};
use skein_report::plot::sweep::{Lines, Point, Series};
use skein_report::table::quoted;
use std::fmt::Write as _;

/// The strategy that the others are compared with.
const REFERENCE: &str = "shortest-path";
/// The metric that is compared.
const METRIC: &str = "energy_j";
/// Greatest ratio that counts as "at most 1 % worse".
const ONE_PERCENT_WORSE: f64 = 1.01;
/// Number of worst seeds that are listed.
const LISTED: usize = 10;

/// The energy ratio of one seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeedRatio {
    /// The seed.
    pub seed: u64,
    /// Energy of the strategy over that of `shortest-path`.
    pub ratio: f64,
}

/// One strategy against `shortest-path`, for one scenario and one value of each grid key.
#[derive(Clone, Debug, PartialEq)]
pub struct EnergyRatios {
    /// Name of the scenario.
    pub scenario: String,
    /// One value, as TOML, for each key of the grid.
    pub values: Vec<String>,
    /// The strategy.
    pub strategy: String,
    /// Ascending by ratio. Seeds with which not both strategies reached the goal are left out.
    pub by_ratio: Vec<SeedRatio>,
    /// Whether neither strategy's runs differ by seed: then no estimate has an interval.
    pub equal: bool,
}

/// The ratios of each strategy except the reference. Empty if the reference or any other strategy was not flown.
pub(crate) fn energy_ratios(grid: &Grid<'_>, rows: &[Row]) -> Vec<EnergyRatios> {
    let combination = |row: &Row| std::ptr::from_ref(grid.job(row.job).0);
    let groups: Vec<&[Row]> = rows.chunk_by(|a, b| combination(a) == combination(b)).collect();
    let strategy = |group: &[Row]| grid.job(group[0].job).0.strategy.clone().unwrap_or_default();
    let same = |a: &[Row], b: &[Row]| {
        let (a, b) = (grid.job(a[0].job).0, grid.job(b[0].job).0);
        (a.scenario, &a.values) == (b.scenario, &b.values)
    };
    let against = |group: &&[Row]| {
        let reference = groups.iter().find(|other| same(other, group) && strategy(other) == REFERENCE)?;
        let by_ratio = seed_ratios(grid, group, reference);
        let combination = grid.job(group[0].job).0;
        let (scenario, values) = (grid.scenario_name(combination), combination.values.clone());
        let equal = are_equal(group) && are_equal(reference);
        (!by_ratio.is_empty()).then(|| EnergyRatios { scenario, values, strategy: strategy(group), by_ratio, equal })
    };
    groups.iter().filter(|group| strategy(group) != REFERENCE).filter_map(against).collect()
}

fn seed_ratios(grid: &Grid<'_>, rows: &[Row], reference: &[Row]) -> Vec<SeedRatio> {
    let metric = METRICS.iter().position(|metric| metric.name == METRIC);
    let value = |row: &Row| row.metrics.get(metric?).copied().flatten().filter(|_| row.reached());
    let pair = |row: &Row| {
        let seed = grid.job(row.job).1;
        let other = reference.iter().find(|other| grid.job(other.job).1 == seed)?;
        Some(SeedRatio { seed, ratio: value(row)? / value(other)? })
    };
    let mut by_ratio: Vec<SeedRatio> = rows.iter().filter_map(pair).collect();
    by_ratio.sort_by(|a, b| a.ratio.total_cmp(&b.ratio).then(a.seed.cmp(&b.seed)));
    by_ratio
}

impl EnergyRatios {
    /// Mean of the ratios, with its interval; `None` if there are no ratios.
    #[must_use]
    pub fn mean(&self) -> Option<Estimate> {
        let ratios: Vec<f64> = self.by_ratio.iter().map(|pair| pair.ratio).collect();
        statistics::mean(&ratios).map(|found| self.valid(found))
    }

    /// Share of the runs that took at most 1 % more energy than the reference, with its interval; `None` if there are none.
    #[must_use]
    pub fn within_one_percent(&self) -> Option<Estimate> {
        let within = self.by_ratio.iter().filter(|pair| pair.ratio <= ONE_PERCENT_WORSE).count();
        rate(within, self.by_ratio.len()).map(|found| self.valid(found))
    }

    fn valid(&self, found: Estimate) -> Estimate {
        if self.equal { found.without_interval() } else { found }
    }

    /// The ten worst seeds, worst first.
    pub fn worst(&self) -> impl Iterator<Item = &SeedRatio> {
        self.by_ratio.iter().rev().take(LISTED)
    }

    /// The ratios as they stand in summary.json.
    pub(crate) fn json(&self, keys: &[&str]) -> Value {
        let (mean, within) = (self.mean(), self.within_one_percent());
        let worst: Vec<Value> = self.worst().map(|pair| json!({ "seed": pair.seed, "ratio": pair.ratio })).collect();
        json!({
            "scenario": self.scenario, "grid": grid_json(keys, &self.values), "strategy": self.strategy, "metric": METRIC,
            "reference": REFERENCE, "n": self.by_ratio.len(), "mean": mean.map(|found| found.mean),
            "interval": mean.and_then(|found| found.interval()),
            "at_most_1_percent_worse": within.map(|found| found.mean),
            "at_most_1_percent_worse_interval": within.and_then(|found| found.interval()), "worst": worst,
        })
    }
}

/// The ratios as text, one line for each strategy, with its worst seeds.
pub(crate) fn text(all: &[EnergyRatios]) -> String {
    let mut text = String::new();
    for ratios in all {
        let at = std::iter::once(&ratios.scenario).chain(&ratios.values).map(String::as_str).collect::<Vec<_>>();
        let worst: Vec<String> = ratios.worst().map(|pair| format!("{} ({:.3})", pair.seed, pair.ratio)).collect();
        let (Some(mean), Some(within)) = (ratios.mean(), ratios.within_one_percent()) else { continue };
        let ends = |found: Estimate, scale: f64, digits: usize| {
            let ends = found.interval().map(|ends| ends.map(|end| format!("{:.digits$}", end * scale)));
            ends.map_or_else(String::new, |[low, high]| format!(" [{low}, {high}]"))
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{}, {}: energy / {REFERENCE} {:.4}{} on average over {} seeds, at most 1 % worse in {:.1} %{}, worst seeds {}",
            at.join(" "),
            ratios.strategy,
            mean.mean,
            ends(mean, 1.0, 4),
            ratios.by_ratio.len(),
            100.0 * within.mean,
            ends(within, 100.0, 1),
            worst.join(" ")
        );
    }
    text
}

/// ratios.csv: one line for each strategy and seed, ascending by seed.
pub(crate) fn csv(all: &[EnergyRatios], keys: &[&str]) -> String {
    let head: Vec<&str> = ["scenario"].into_iter().chain(keys.iter().copied()).chain(["strategy", "seed"]).collect();
    let mut text = format!("{},energy_ratio\n", head.join(","));
    for ratios in all {
        let mut by_seed = ratios.by_ratio.clone();
        by_seed.sort_by_key(|pair| pair.seed);
        let values: String =
            ratios.values.iter().map(|value| format!("{},", quoted(value.trim_matches('"')))).collect();
        for SeedRatio { seed, ratio } in by_seed {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{},{values}{},{seed},{ratio}", ratios.scenario, ratios.strategy);
        }
    }
    text
}

/// The distribution of the ratios: which share of the runs has at most a given ratio. One figure for all strategies;
/// `None` if there are no ratios.
pub(crate) fn figure(name: &str, all: &[EnergyRatios]) -> Result<Option<String>, SweepError> {
    if all.is_empty() {
        return Ok(None);
    }
    let series = |ratios: &EnergyRatios| {
        let last = ratios.by_ratio.len() - 1;
        let point = |percent: usize| {
            let y = ratios.by_ratio[(last * percent + 50) / 100].ratio;
            Point { x: percent as f64, mean: y, low: y, high: y }
        };
        let label = std::iter::once(&ratios.strategy).chain(&ratios.values).map(String::as_str).collect::<Vec<_>>();
        Series { label: label.join(" "), points: (0..=100).map(point).collect() }
    };
    let lines = Lines {
        title: format!("{name}: energy against that of {REFERENCE} with the same seed"),
        x_label: "share of the runs, best first (%)".to_owned(),
        y_label: format!("energy / energy of {REFERENCE}"),
        series: all.iter().map(series).collect(),
    };
    let drawn = lines.draw().map(Some);
    drawn.map_err(|source| SweepError::Plot { name: "ratios.svg".to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Experiment, Mission};
    use crate::random_scene::SceneBounds;

    fn experiment(strategies: &[&str]) -> Experiment {
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::Random],
            strategies: strategies.iter().map(|&word| word.to_owned()).collect(),
            strategy_places: vec![],
            seeds: vec![7, 8, 9],
            grid: vec![],
            processes: false,
            metrics: None,
            bounds: SceneBounds::default(),
        }
    }

    fn row(job: usize, outcome: &str, energy_j: f64) -> Row {
        let metrics = METRICS.iter().map(|metric| (metric.name == METRIC).then_some(energy_j)).collect();
        Row { metrics, ..Row::unflown(job, outcome, "") }
    }

    #[test]
    fn each_seed_is_compared_with_itself_and_failures_are_left_out() {
        let experiment = experiment(&["congestion-aware", "shortest-path"]);
        let grid = Grid::new(&experiment, &[]);
        let energies = [90.0, 220.0, 5.0, 100.0, 200.0, 100.0];
        let mut rows: Vec<Row> = (0..6).map(|job| row(job, "reached", energies[job])).collect();
        rows[2].outcome = "timeout".to_owned();
        let all = energy_ratios(&grid, &rows);
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].by_ratio, [SeedRatio { seed: 7, ratio: 0.9 }, SeedRatio { seed: 8, ratio: 1.1 }]);
        let (mean, within) = (all[0].mean().unwrap(), all[0].within_one_percent().unwrap());
        assert!((mean.mean - 1.0).abs() < 1e-12 && (within.mean - 0.5).abs() < 1e-12);
        // 0.9, 1.1: standard deviation 0.1414, 12.7062 · 0.1414 / √2 = 1.2706.
        assert!((mean.interval().unwrap()[1] - 2.2706).abs() < 1e-3 && within.interval().is_some(), "{mean:?}");
        assert_eq!(all[0].json(&[])["worst"][0]["seed"], 8);
        assert_eq!(csv(&all, &[]).lines().nth(1), Some("random,congestion-aware,7,0.9"));
        assert!(text(&all).contains("worst seeds 8 (1.100) 7 (0.900)"));
        assert!(figure("e", &all).is_ok_and(|svg| svg.is_some_and(|svg| svg.contains("congestion-aware"))));
    }

    #[test]
    fn without_shortest_path_there_are_no_ratios() {
        let experiment = experiment(&["congestion-aware"]);
        let rows: Vec<Row> = (0..3).map(|job| row(job, "reached", 1.0)).collect();
        let all = energy_ratios(&Grid::new(&experiment, &[]), &rows);
        assert!(all.is_empty() && figure("e", &all).is_ok_and(|svg| svg.is_none()));
    }
}
