//! Which plots a sweep has: lines over one key that varies, a heat map over two.

use super::cells::Cell;
use super::experiment::Experiment;
use super::metrics::{METRICS, SUCCESS, label, metric};
use super::statistics::Estimate;
use skein_report::plot::sweep::{HeatMap, Lines, Point, Series};

/// A plot's file name and its SVG.
pub type Plot = (String, String);

/// All plots, by metric; none if no key varies, or more than two.
///
/// # Errors
/// What cannot be drawn.
pub fn plots(experiment: &Experiment, cells: &[Cell]) -> Result<Vec<Plot>, String> {
    let varying: Vec<usize> = (0..experiment.grid.len()).filter(|&i| experiment.grid[i].values.len() > 1).collect();
    let metrics = || [SUCCESS].into_iter().chain(METRICS.iter().map(|metric| metric.name));
    let wanted: Vec<&str> = metrics().filter(|name| experiment.metrics.contains(name)).collect();
    let scenarios = || cells.chunk_by(|a, b| a.scenario == b.scenario);
    match varying[..] {
        [x] => {
            let plots = scenarios().flat_map(|of| wanted.iter().filter_map(move |name| lines(experiment, of, x, name)));
            plots.collect()
        }
        [y, x] => Ok(wanted.iter().flat_map(|name| maps(experiment, cells, (x, y), name)).collect()),
        _ => Ok(Vec::new()),
    }
}

/// The lines of one scenario, one a strategy.
fn lines(experiment: &Experiment, cells: &[Cell], axis: usize, metric: &str) -> Option<Result<Plot, String>> {
    let values = &experiment.grid[axis].values;
    // What is no number stands at its place in the list.
    let place = |value: &String| values.iter().position(|v| v == value).unwrap_or(0) as f64;
    let numbers = values.iter().all(|value| value.parse::<f64>().is_ok());
    let x = |value: &String| if numbers { value.parse().unwrap_or(0.0) } else { place(value) };
    let series = |of: &[Cell]| {
        let point = |cell: &Cell| {
            let Estimate { mean, low, high, .. } = cell.estimate(metric)?;
            Some(Point { x: x(&cell.values[axis]), mean, low, high })
        };
        let mut points: Vec<Point> = of.iter().filter_map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        Series { label: of[0].strategy.clone(), points }
    };
    let series: Vec<Series> = curves(cells).map(series).filter(|series| !series.points.is_empty()).collect();
    if series.is_empty() {
        return None;
    }
    let x_label = match numbers {
        true => experiment.grid[axis].key.clone(),
        false => format!("{} (0 = {})", experiment.grid[axis].key, values.join(", ")),
    };
    let title = title(experiment, &cells[0].scenario, metric);
    let lines = Lines { title, x_label, y_label: label(metric).to_owned(), series };
    Some(lines.draw().map(|svg| (file(experiment, metric, &cells[0].scenario, None), svg)))
}

fn maps(experiment: &Experiment, cells: &[Cell], (x, y): (usize, usize), metric: &str) -> Vec<Plot> {
    let map = |of: &[Cell]| {
        let at = |column: &String, row: &String| {
            let cell = of.iter().find(|cell| cell.values[x] == *column && cell.values[y] == *row)?;
            let Estimate { mean, low, high, .. } = cell.estimate(metric)?;
            Some((mean, low, high))
        };
        let (columns, rows) = (&experiment.grid[x], &experiment.grid[y]);
        let values = rows.values.iter().flat_map(|row| columns.values.iter().map(move |column| at(column, row)));
        let (scenario, strategy) = (&of[0].scenario, &of[0].strategy);
        let map = HeatMap {
            title: format!("{}, {strategy}", title(experiment, scenario, metric)),
            x: (columns.key.clone(), columns.values.clone()),
            y: (rows.key.clone(), rows.values.clone()),
            cells: values.collect(),
        };
        (file(experiment, metric, scenario, Some(strategy)), map.draw())
    };
    curves(cells).map(map).collect()
}

/// Cells of one scenario and strategy each: the grid's order keeps them together.
fn curves(cells: &[Cell]) -> impl Iterator<Item = &[Cell]> {
    cells.chunk_by(|a, b| (&a.scenario, &a.strategy) == (&b.scenario, &b.strategy))
}

/// A plot's name; the scenario is left out if there is one alone.
fn file(experiment: &Experiment, metric: &str, scenario: &str, strategy: Option<&str>) -> String {
    let scenario = (experiment.scenarios.len() > 1).then_some(scenario);
    let parts: Vec<&str> = std::iter::once(metric).chain(scenario).chain(strategy).collect();
    format!("{}.svg", parts.join("-").replace([':', '/'], "-"))
}

fn title(experiment: &Experiment, scenario: &str, metric_name: &str) -> String {
    let interval = if metric_name == SUCCESS { "Wilson's 95 % interval" } else { "mean and its 95 % interval" };
    let of = if metric(metric_name).is_some_and(|metric| metric.reached_only) {
        " of runs that reached the goal"
    } else {
        ""
    };
    format!("{}, {scenario}: {}, {interval}{of}, {} seeds", experiment.name, label(metric_name), experiment.seeds.len())
}

#[cfg(test)]
mod tests {
    use super::super::experiment::{Axis, Mission};
    use super::super::random::Bounds;
    use super::super::statistics::{mean, rate};
    use super::*;
    use std::collections::BTreeMap;

    fn experiment(axes: &[(&str, &[&str])]) -> Experiment {
        let axis = |&(key, values): &(&str, &[&str])| Axis {
            key: key.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
        };
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::Random],
            strategies: vec![],
            seeds: vec![1],
            grid: axes.iter().map(axis).collect(),
            processes: false,
            metrics: vec!["mission_s", SUCCESS],
            bounds: Bounds::default(),
        }
    }

    fn cell(strategy: &str, values: &[&str]) -> Cell {
        Cell {
            scenario: "random".to_owned(),
            strategy: strategy.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
            outcomes: BTreeMap::new(),
            success: rate(1, 2),
            metrics: METRICS.iter().map(|_| mean(&[1.0, 2.0])).collect(),
        }
    }

    fn names(experiment: &Experiment, cells: &[Cell]) -> Vec<String> {
        plots(experiment, cells).unwrap().into_iter().map(|(name, _)| name).collect()
    }

    #[test]
    fn one_key_makes_lines_two_make_maps() {
        let one = experiment(&[("radio.loss", &["0", "0.5"]), ("radio.delay_s", &["1"])]);
        let cells =
            [cell("a", &["0", "1"]), cell("a", &["0.5", "1"]), cell("b", &["0", "1"]), cell("b", &["0.5", "1"])];
        assert_eq!(names(&one, &cells), ["success.svg", "mission_s.svg"]);
        let svg = &plots(&one, &cells).unwrap()[1].1;
        assert!(svg.contains("radio.loss") && svg.contains("mission time (s)") && svg.matches("<circle").count() == 4);
        let two = experiment(&[("radio.loss", &["0", "0.5"]), ("radio.delay_s", &["0", "1"])]);
        let cells = [cell("fixed:1/2", &["0", "0"]), cell("fixed:1/2", &["0.5", "1"])];
        assert_eq!(names(&two, &cells), ["success-fixed-1-2.svg", "mission_s-fixed-1-2.svg"]);
        let svg = &plots(&two, &cells).unwrap()[0].1;
        assert_eq!((svg.matches(">0.5</text>").count(), svg.matches(">–</text>").count()), (3, 2), "{svg}");
        assert_eq!(names(&experiment(&[]), &cells), Vec::<String>::new());
    }
}
