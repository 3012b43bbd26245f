//! Paired differences: each run against that of another strategy on the same mission with the same seed. What a seed changes for
//! both cancels, so a difference is known much better than the two means.

use crate::cells::are_equal;
use crate::cells::grid_json;
use crate::error::SweepError;
use crate::experiment::Experiment;
use crate::grid::Grid;
use crate::metrics::{METRICS, Metric, metric};
use crate::plots::{Plot, unit};
use crate::row::Row;
use crate::statistics::{Estimate, mean};
use crate::table::MAX_LINES;
use serde_json::{Value, json};
use skein_report::number_text::brief;
use skein_report::plot::sweep::{Lines, Point, Series};
use std::fmt::Write as _;

/// One strategy against another in one metric, for one scenario and one value of each grid key.
#[derive(Clone, Debug, PartialEq)]
pub struct PairedDifference {
    /// Name of the scenario.
    pub scenario: String,
    /// One value, as TOML, for each key of the grid.
    pub values: Vec<String>,
    /// The strategy.
    pub strategy: String,
    /// The strategy that it is compared with.
    pub against: String,
    /// Name of the metric.
    pub metric: &'static str,
    /// The value of `strategy` minus that of `against`, averaged over the seeds.
    pub difference: Estimate,
    /// The value of `strategy` over that of `against`, averaged over the seeds; `None` if one of the latter is not positive.
    pub ratio: Option<Estimate>,
    /// Number of seeds with which `strategy` has the lower value.
    pub lower: usize,
    /// Number of seeds with which it has the higher value.
    pub higher: usize,
}

/// Both values of one seed.
type Pair = (f64, f64);

/// The differences of all strategies in these metrics, each strategy against those that the experiment names before it.
pub(crate) fn paired(grid: &Grid<'_>, rows: &[Row], metrics: &[String]) -> Vec<PairedDifference> {
    let combination = |row: &Row| grid.job(row.job).0;
    let groups: Vec<&[Row]> = rows.chunk_by(|a, b| std::ptr::eq(combination(a), combination(b))).collect();
    let metrics: Vec<&Metric> = metrics.iter().filter_map(|name| metric(name)).collect();
    let mut all = Vec::new();
    for (i, group) in groups.iter().enumerate() {
        let of = combination(&group[0]);
        let same = |other: &&&[Row]| {
            let other = combination(&other[0]);
            (other.scenario, &other.values) == (of.scenario, &of.values)
        };
        for other in groups[..i].iter().filter(same) {
            all.extend(metrics.iter().filter_map(|metric| difference(grid, group, other, metric)));
        }
    }
    all
}

fn difference(grid: &Grid<'_>, rows: &[Row], others: &[Row], metric: &Metric) -> Option<PairedDifference> {
    let pairs = pairs(grid, rows, others, metric);
    let of = |value: fn(&Pair) -> f64| mean(&pairs.iter().map(value).collect::<Vec<f64>>());
    // Two flights that no seed changes are one pair, however often they are flown.
    let equal = are_equal(rows) && are_equal(others);
    let valid = |estimate: Estimate| if equal { estimate.without_interval() } else { estimate };
    let (combination, against) = (grid.job(rows[0].job).0, grid.job(others[0].job).0);
    Some(PairedDifference {
        scenario: grid.scenario_name(combination),
        values: combination.values.clone(),
        strategy: combination.strategy.clone().unwrap_or_default(),
        against: against.strategy.clone().unwrap_or_default(),
        metric: metric.name,
        difference: valid(of(|(own, other)| own - other)?),
        ratio: of(|(own, other)| own / other).filter(|_| pairs.iter().all(|(_, other)| *other > 0.0)).map(valid),
        lower: pairs.iter().filter(|(own, other)| own < other).count(),
        higher: pairs.iter().filter(|(own, other)| own > other).count(),
    })
}

/// The values of each seed with which both runs have one.
fn pairs(grid: &Grid<'_>, rows: &[Row], others: &[Row], metric: &Metric) -> Vec<Pair> {
    let column = METRICS.iter().position(|known| known.name == metric.name);
    let counts = |row: &Row| row.reached() || !metric.reached_only;
    let value = |row: &Row| row.metrics.get(column?).copied().flatten().filter(|_| counts(row));
    let pair = |row: &Row| {
        let seed = grid.job(row.job).1;
        let other = others.iter().find(|other| grid.job(other.job).1 == seed)?;
        Some((value(row)?, value(other)?))
    };
    rows.iter().filter_map(pair).collect()
}

impl PairedDifference {
    /// The difference as it stands in summary.json.
    pub(crate) fn json(&self, keys: &[&str]) -> Value {
        json!({
            "scenario": self.scenario, "grid": grid_json(keys, &self.values), "strategy": self.strategy, "against": self.against,
            "metric": self.metric, "difference": self.difference, "ratio": self.ratio,
            "lower": self.lower, "higher": self.higher,
        })
    }

    /// What is compared with what.
    fn key(&self) -> (&str, &[String], &str, &str) {
        (&self.scenario, &self.values, &self.strategy, &self.against)
    }

    /// `energy_j -1800 [-2500, -1100] (less 43, more 10)`
    fn text(&self) -> String {
        let Estimate { mean, min, max, .. } = self.difference;
        let signed = |value: f64| {
            let text = brief(value, min.abs().max(max.abs()));
            if value > 0.0 && text != "0" { format!("+{text}") } else { text }
        };
        let interval = self.difference.interval().map(|[low, high]| format!(" [{}, {}]", signed(low), signed(high)));
        let counts = format!("(less {}, more {})", self.lower, self.higher);
        format!("{} {}{} {counts}", self.metric, signed(mean), interval.unwrap_or_default())
    }
}

/// The differences as text: one line for two strategies, with all metrics.
pub(crate) fn text(all: &[PairedDifference]) -> String {
    let same = |a: &PairedDifference, b: &PairedDifference| a.key() == b.key();
    let mut text = String::new();
    for of in all.chunk_by(same).take(MAX_LINES) {
        let first = &of[0];
        let at =
            std::iter::once(&first.scenario).chain(&first.values).map(String::as_str).collect::<Vec<_>>().join(" ");
        let values = of.iter().map(PairedDifference::text).collect::<Vec<_>>().join("; ");
        let n = of.iter().map(|one| one.difference.n).max().unwrap_or(0);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{at}, {} minus {}, {n} pairs: {values}", first.strategy, first.against);
    }
    let hidden = all.chunk_by(same).count().saturating_sub(MAX_LINES);
    if hidden > 0 {
        text += &format!("… and {hidden} more pairs in summary.json\n");
    }
    text
}

/// One plot for each metric and scenario, with one line for each two strategies and its intervals. The abscissa is the key
/// that varies, if it is one and its values are numbers, or else the number of the combination, from 1.
pub(crate) fn plots(experiment: &Experiment, all: &[PairedDifference]) -> Result<Vec<Plot>, SweepError> {
    let mut metrics: Vec<&str> = all.iter().map(|one| one.metric).collect();
    metrics.sort_unstable();
    metrics.dedup();
    let mut plots = Vec::new();
    for of in all.chunk_by(|a, b| a.scenario == b.scenario) {
        for &metric in &metrics {
            let of: Vec<&PairedDifference> = of.iter().filter(|one| one.metric == metric).collect();
            plots.extend((!of.is_empty()).then(|| plot(experiment, metric, &of)).transpose()?);
        }
    }
    Ok(plots)
}

fn plot(experiment: &Experiment, metric: &str, of: &[&PairedDifference]) -> Result<Plot, SweepError> {
    let (x_label, places) = abscissae(experiment, of);
    let (label, factor) = unit(metric);
    let mut names: Vec<(&str, &str)> = Vec::new();
    for one in of {
        if !names.contains(&(&*one.strategy, &*one.against)) {
            names.push((&one.strategy, &one.against));
        }
    }
    let line = |(strategy, against): (&str, &str)| {
        let own = of.iter().zip(&places).filter(|(one, _)| (&*one.strategy, &*one.against) == (strategy, against));
        let point = |(one, &x): (&&PairedDifference, &f64)| {
            let found = one.difference;
            let [low, high] = found.interval().unwrap_or([found.mean; 2]).map(|end| end * factor);
            Point { x, mean: found.mean * factor, low, high }
        };
        let mut points: Vec<Point> = own.map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        Series { label: format!("{strategy} minus {against}"), points }
    };
    let mut series: Vec<Series> = names.into_iter().map(line).collect();
    let ends = [f64::min, f64::max].map(|end| places.iter().copied().reduce(end).unwrap_or(0.0));
    let zero = ends.map(|x| Point { x, mean: 0.0, low: 0.0, high: 0.0 });
    series.push(Series { label: "no difference".to_owned(), points: zero.to_vec() });
    let scenario = &of[0].scenario;
    let lines = Lines {
        title: format!("{}, {scenario}: paired difference, mean over seeds and its 95 % interval", experiment.name),
        x_label,
        y_label: format!("difference in {label}"),
        series,
    };
    let several = if experiment.scenarios.len() > 1 { format!("-{scenario}") } else { String::new() };
    let file = format!("paired-{metric}{several}.svg");
    match lines.draw() {
        Ok(svg) => Ok(Plot { file, svg }),
        Err(source) => Err(SweepError::Plot { name: file, source }),
    }
}

/// Label and values of the abscissa.
fn abscissae(experiment: &Experiment, of: &[&PairedDifference]) -> (String, Vec<f64>) {
    let varying: Vec<usize> = (0..experiment.grid.len()).filter(|&i| experiment.grid[i].values.len() > 1).collect();
    if let [key] = varying[..]
        && let Ok(values) = of.iter().map(|one| one.values[key].parse()).collect::<Result<Vec<f64>, _>>()
    {
        return (experiment.grid[key].key.clone(), values);
    }
    let mut combinations: Vec<&[String]> = of.iter().map(|one| &one.values[..]).collect();
    combinations.dedup();
    let mut distinct: Vec<&[String]> = Vec::new();
    for combination in combinations {
        if !distinct.contains(&combination) {
            distinct.push(combination);
        }
    }
    let place = |one: &&PairedDifference| distinct.iter().position(|&values| values == one.values).unwrap_or(0) + 1;
    (
        "combination of the keys, in the order of summary.json".to_owned(),
        of.iter().map(|one| place(one) as f64).collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Axis, Mission};
    use crate::random_scene::SceneBounds;

    fn experiment(losses: &[&str]) -> Experiment {
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::Random],
            strategies: ["shortest-path", "congestion-aware"].map(str::to_owned).to_vec(),
            strategy_places: vec![],
            seeds: vec![7, 8, 9],
            grid: vec![Axis {
                key: "radio.loss".to_owned(),
                values: losses.iter().map(|&value| value.to_owned()).collect(),
                places: vec![],
            }],
            processes: false,
            metrics: None,
            bounds: SceneBounds::default(),
        }
    }

    /// A run that took this energy. Its digest follows from it.
    fn row(job: usize, outcome: &str, energy_j: f64) -> Row {
        let metrics = METRICS.iter().map(|metric| (metric.name == "energy_j").then_some(energy_j)).collect();
        Row { metrics, digest: Some(format!("{energy_j}")), ..Row::unflown(job, outcome, "") }
    }

    fn flown(experiment: &Experiment, outcome: &str, energies: &[f64]) -> Vec<PairedDifference> {
        let grid = Grid::new(experiment, &[]);
        assert_eq!(grid.len(), energies.len());
        let energy_of = |job: usize| {
            let (combination, seed) = grid.job(job);
            let strategy = usize::from(combination.strategy.as_deref() == Some("congestion-aware"));
            let value = experiment.grid[0].values.iter().position(|value| *value == combination.values[0]).unwrap_or(0);
            energies[(value * 2 + strategy) * 3 + (seed - 7) as usize]
        };
        let mut rows: Vec<Row> = (0..grid.len()).map(|job| row(job, "reached", energy_of(job))).collect();
        outcome.clone_into(&mut rows[2].outcome);
        paired(&grid, &rows, &["success".to_owned(), "energy_j".to_owned()])
    }

    #[test]
    fn differences_are_paired_by_seed_and_runs_that_failed_are_left_out() {
        let one = experiment(&["0"]);
        let all = flown(&one, "reached", &[100.0, 200.0, 300.0, 90.0, 196.0, 302.0]);
        assert_eq!(all.len(), 1);
        let PairedDifference { strategy, against, difference, lower, higher, .. } = &all[0];
        assert_eq!((strategy.as_str(), against.as_str(), *lower, *higher), ("congestion-aware", "shortest-path", 2, 1));
        // -10, -4, 2: mean -4, standard deviation 6; 4.3027 · 6 / √3 = 14.905.
        let [low, high] = difference.interval().unwrap_or_default();
        assert!(
            difference.mean == -4.0 && (low + 18.905).abs() < 1e-2 && (high - 10.905).abs() < 1e-2,
            "{difference:?}"
        );
        let ratio = all[0].ratio.map(|ratio| ratio.mean).unwrap_or_default();
        assert!((ratio - (0.9 + 0.98 + 302.0 / 300.0) / 3.0).abs() < 1e-12);
        assert_eq!(flown(&one, "timeout", &[100.0, 200.0, 300.0, 90.0, 196.0, 302.0])[0].difference.n, 2);
        let text = text(&all);
        assert!(text.contains("congestion-aware minus shortest-path, 3 pairs: energy_j -4 [-18.9"), "{text}");
        assert!(text.contains("(less 2, more 1)"), "{text}");
        let json = all[0].json(&["radio.loss"]);
        assert_eq!((&json["metric"], &json["difference"]["mean"]), (&json!("energy_j"), &json!(-4.0)));
        assert_eq!(json["grid"], json!({ "radio.loss": 0 }));
    }

    #[test]
    fn flights_that_no_seed_changes_give_no_interval() {
        let all = flown(&experiment(&["0"]), "reached", &[100.0, 100.0, 100.0, 90.0, 90.0, 90.0]);
        assert_eq!((all[0].difference.mean, all[0].difference.interval()), (-10.0, None));
        let all = flown(&experiment(&["0"]), "reached", &[100.0, 100.0, 100.0, 90.0, 90.0, 91.0]);
        assert!(all[0].difference.interval().is_some());
    }

    #[test]
    fn each_value_of_the_grid_is_compared_with_itself_and_drawn_over_the_key() {
        let two = experiment(&["0", "0.5"]);
        let energies = [10.0, 11.0, 12.0, 9.0, 10.0, 11.5, 20.0, 21.0, 22.0, 25.0, 26.0, 27.5];
        let all = flown(&two, "reached", &energies);
        let means: Vec<f64> = all.iter().map(|one| (one.difference.mean * 6.0).round() / 6.0).collect();
        assert_eq!(means, [-5.0 / 6.0, 31.0 / 6.0].map(|mean| (mean * 6.0_f64).round() / 6.0));
        let plots = plots(&two, &all).unwrap_or_default();
        assert_eq!(plots.len(), 1);
        assert_eq!(plots[0].file, "paired-energy_j.svg");
        for word in ["congestion-aware minus shortest-path", "no difference", "radio.loss", "energy (kJ)"] {
            assert!(plots[0].svg.contains(word), "{word}");
        }
    }
}
