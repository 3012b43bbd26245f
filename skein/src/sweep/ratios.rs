//! Strategies on the same missions: each run's energy over that of the shortest paths with the same seed.

use super::grid::Grid;
use super::metrics::METRICS;
use super::row::Row;
use serde_json::{Value, json};
use skein_report::plot::sweep::{Lines, Point, Series};
use std::fmt::Write as _;

/// What the others are compared with.
const REFERENCE: &str = "shortest-path";
/// What is compared.
const METRIC: &str = "energy_j";
/// A run that costs more than this is worse; less may be chance.
const WORSE: f64 = 1.01;
/// So many of the worst seeds are listed.
const LISTED: usize = 10;

/// One strategy against the shortest paths, under one combination of everything else.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratios {
    /// The scenario's name.
    pub scenario: String,
    /// A value for each key of the grid, as TOML.
    pub values: Vec<String>,
    /// Which.
    pub strategy: String,
    /// Seed and ratio, the worst last. Seeds with which not both reached the goal are left out.
    pub by_ratio: Vec<(u64, f64)>,
}

/// The ratios of each strategy but the reference; none if it was not flown, or nothing beside it.
pub fn ratios(grid: &Grid<'_>, rows: &[Row]) -> Vec<Ratios> {
    let metric = METRICS.iter().position(|metric| metric.name == METRIC);
    let value = |row: &Row| row.metrics.get(metric?).copied().flatten().filter(|_| row.reached());
    let of = |row: &Row| std::ptr::from_ref(grid.job(row.job).0);
    let groups: Vec<&[Row]> = rows.chunk_by(|a, b| of(a) == of(b)).collect();
    let strategy = |group: &[Row]| grid.job(group[0].job).0.strategy.clone().unwrap_or_default();
    let same = |a: &[Row], b: &[Row]| {
        let (a, b) = (grid.job(a[0].job).0, grid.job(b[0].job).0);
        (a.scenario, &a.values) == (b.scenario, &b.values)
    };
    let against = |group: &&[Row]| {
        let reference = groups.iter().find(|other| same(other, group) && strategy(other) == REFERENCE)?;
        let pair = |row: &Row| {
            let seed = grid.job(row.job).1;
            let other = reference.iter().find(|other| grid.job(other.job).1 == seed)?;
            Some((seed, value(row)? / value(other)?))
        };
        let mut by_ratio: Vec<(u64, f64)> = group.iter().filter_map(pair).collect();
        by_ratio.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        let combination = grid.job(group[0].job).0;
        let (scenario, values) = (grid.scenario_name(combination), combination.values.clone());
        (!by_ratio.is_empty()).then(|| Ratios { scenario, values, strategy: strategy(group), by_ratio })
    };
    groups.iter().filter(|group| strategy(group) != REFERENCE).filter_map(against).collect()
}

impl Ratios {
    /// Mean of the ratios.
    pub fn mean(&self) -> f64 {
        self.by_ratio.iter().map(|(_, ratio)| ratio).sum::<f64>() / self.by_ratio.len() as f64
    }

    /// Share of the runs that cost at most one percent more than the reference.
    pub fn held(&self) -> f64 {
        let held = self.by_ratio.iter().filter(|(_, ratio)| *ratio <= WORSE).count();
        held as f64 / self.by_ratio.len() as f64
    }

    /// The worst seeds, the worst first.
    pub fn worst(&self) -> impl Iterator<Item = &(u64, f64)> {
        self.by_ratio.iter().rev().take(LISTED)
    }

    /// As in summary.json.
    pub fn json(&self) -> Value {
        let worst: Vec<Value> = self.worst().map(|(seed, ratio)| json!({ "seed": seed, "ratio": ratio })).collect();
        json!({
            "scenario": self.scenario, "grid": self.values, "strategy": self.strategy, "metric": METRIC,
            "reference": REFERENCE, "n": self.by_ratio.len(), "mean": self.mean(),
            "at_most_1_percent_worse": self.held(), "worst": worst,
        })
    }
}

/// For a person: a line a strategy, and its worst seeds.
pub fn text(all: &[Ratios]) -> String {
    let mut text = String::new();
    for ratios in all {
        let at = std::iter::once(&ratios.scenario).chain(&ratios.values).map(String::as_str).collect::<Vec<_>>();
        let worst: Vec<String> = ratios.worst().map(|(seed, ratio)| format!("{seed} ({ratio:.3})")).collect();
        let _ = writeln!(
            text,
            "{}, {}: energy / {REFERENCE} {:.4} on average over {}, at most 1 % worse in {:.1} %, worst seeds {}",
            at.join(" "),
            ratios.strategy,
            ratios.mean(),
            ratios.by_ratio.len(),
            100.0 * ratios.held(),
            worst.join(" ")
        );
    }
    text
}

/// ratios.csv: a line a seed and strategy, seeds in order.
pub fn csv(all: &[Ratios], keys: &[&str]) -> String {
    let head: Vec<&str> = ["scenario"].into_iter().chain(keys.iter().copied()).chain(["strategy", "seed"]).collect();
    let mut text = format!("{},energy_ratio\n", head.join(","));
    for ratios in all {
        let mut by_seed = ratios.by_ratio.clone();
        by_seed.sort_by_key(|(seed, _)| *seed);
        let values: String = ratios.values.iter().map(|value| format!("{},", value.trim_matches('"'))).collect();
        for (seed, ratio) in by_seed {
            let _ = writeln!(text, "{},{values}{},{seed},{ratio}", ratios.scenario, ratios.strategy);
        }
    }
    text
}

/// The distribution: which share of the runs costs no more than that; one figure for all strategies.
///
/// # Errors
/// What cannot be drawn.
pub fn figure(name: &str, all: &[Ratios]) -> Result<Option<String>, String> {
    if all.is_empty() {
        return Ok(None);
    }
    let series = |ratios: &Ratios| {
        let last = ratios.by_ratio.len() - 1;
        let point = |percent: usize| {
            let y = ratios.by_ratio[(last * percent + 50) / 100].1;
            Point { x: percent as f64, mean: y, low: y, high: y }
        };
        let label = std::iter::once(&ratios.strategy).chain(&ratios.values).map(String::as_str).collect::<Vec<_>>();
        Series { label: label.join(" "), points: (0..=100).map(point).collect() }
    };
    let lines = Lines {
        title: format!("{name}: energy against that of {REFERENCE} with the same seed"),
        x_label: "share of the runs, the best first (%)".to_owned(),
        y_label: format!("energy / energy of {REFERENCE}"),
        series: all.iter().map(series).collect(),
    };
    lines.draw().map(Some).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::super::experiment::{Experiment, Mission};
    use super::super::random::Bounds;
    use super::*;

    fn experiment(strategies: &[&str]) -> Experiment {
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::Random],
            strategies: strategies.iter().map(|&word| word.to_owned()).collect(),
            seeds: vec![7, 8, 9],
            grid: vec![],
            processes: false,
            metrics: vec![],
            bounds: Bounds::default(),
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
        let all = ratios(&grid, &rows);
        assert_eq!(all.len(), 1);
        assert_eq!(all[0].by_ratio, [(7, 0.9), (8, 1.1)]);
        assert!((all[0].mean() - 1.0).abs() < 1e-12 && (all[0].held() - 0.5).abs() < 1e-12);
        assert_eq!(all[0].json()["worst"][0]["seed"], 8);
        assert_eq!(csv(&all, &[]).lines().nth(1), Some("random,congestion-aware,7,0.9"));
        assert!(text(&all).contains("worst seeds 8 (1.100) 7 (0.900)"));
        assert!(figure("e", &all).is_ok_and(|svg| svg.is_some_and(|svg| svg.contains("congestion-aware"))));
    }

    #[test]
    fn without_the_shortest_paths_there_is_nothing_to_compare_with() {
        let experiment = experiment(&["congestion-aware"]);
        let rows: Vec<Row> = (0..3).map(|job| row(job, "reached", 1.0)).collect();
        let all = ratios(&Grid::new(&experiment, &[]), &rows);
        assert!(all.is_empty() && figure("e", &all) == Ok(None));
    }
}
