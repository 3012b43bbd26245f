//! Which plots a sweep has: lines over one key that varies, heat maps over more.

use super::cells::{Cell, toml_value};
use super::experiment::Experiment;
use super::metrics::{METRICS, SUCCESS, label, metric};
use super::statistics::Estimate;
use skein_report::plot::sweep::{HeatMap, Lines, Point, Series};
use std::collections::BTreeSet;

/// A plot's file name and its SVG.
pub type Plot = (String, String);

/// All plots, by metric; none if no key varies.
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
        [] => Ok(Vec::new()),
        _ => {
            let (columns, rows) = sides(experiment, varying);
            Ok(wanted.iter().flat_map(|name| maps(experiment, cells, &columns, &rows, name)).collect())
        }
    }
}

/// A side of a heat map: keys, by their places in the grid, and all their values with each other.
struct Side {
    keys: Vec<usize>,
    name: String,
    /// Of the keys, and what they are called.
    values: Vec<(Vec<String>, String)>,
}

/// Columns and rows: one key, that with the most values, against all others.
fn sides(experiment: &Experiment, varying: Vec<usize>) -> (Side, Side) {
    let values = |&key: &usize| experiment.grid[key].values.len();
    let widest = varying.iter().copied().max_by_key(values).unwrap_or(0);
    let (columns, rows) = varying.into_iter().partition(|&key| key == widest);
    (side(experiment, columns), side(experiment, rows))
}

fn side(experiment: &Experiment, keys: Vec<usize>) -> Side {
    let mut values = vec![(Vec::new(), String::new())];
    for &key in &keys {
        let of_key = &experiment.grid[key].values;
        let longer = |(before, called): &(Vec<String>, String)| {
            let (before, called) = (before.clone(), called.clone());
            let joined = move |(value, short): (&String, String)| {
                let comma = if called.is_empty() { "" } else { ", " };
                (before.iter().chain([value]).cloned().collect(), format!("{called}{comma}{short}"))
            };
            of_key.iter().zip(brief(of_key)).map(joined).collect::<Vec<_>>()
        };
        values = values.iter().flat_map(longer).collect();
    }
    let name: Vec<&str> = keys.iter().map(|&key| experiment.grid[key].key.as_str()).collect();
    Side { name: name.join(", "), keys, values }
}

/// TOML values as they are called in a plot: texts without quotes, and tables by their first key that tells them apart.
fn brief(values: &[String]) -> Vec<String> {
    let parsed: Vec<Option<toml::Value>> = values.iter().map(|value| toml_value(value)).collect();
    let plain = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let by = |key: &str| -> Option<Vec<String>> {
        let found = parsed.iter().map(|value| Some(plain(value.as_ref()?.get(key)?)));
        let found: Vec<String> = found.collect::<Option<_>>()?;
        let distinct = found.iter().collect::<BTreeSet<_>>().len() == found.len();
        distinct.then_some(found)
    };
    let first = parsed.first().and_then(|value| value.as_ref()?.as_table());
    let told_apart = first.and_then(|table| table.keys().find_map(|key| by(key)));
    let text = |(value, parsed): (&String, &Option<toml::Value>)| {
        parsed.as_ref().and_then(toml::Value::as_str).unwrap_or(value).to_owned()
    };
    told_apart.unwrap_or_else(|| values.iter().zip(&parsed).map(text).collect())
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
    let drawn = lines.draw().map_err(|error| error.to_string());
    Some(drawn.map(|svg| (file(experiment, metric, &cells[0].scenario, None), svg)))
}

fn maps(experiment: &Experiment, cells: &[Cell], columns: &Side, rows: &Side, metric: &str) -> Vec<Plot> {
    let map = |of: &[Cell]| {
        let has = |cell: &Cell, side: &Side, wanted: &[String]| {
            side.keys.iter().zip(wanted).all(|(&key, value)| cell.values[key] == *value)
        };
        let at = |column: &[String], row: &[String]| {
            let cell = of.iter().find(|cell| has(cell, columns, column) && has(cell, rows, row))?;
            let Estimate { mean, low, high, .. } = cell.estimate(metric)?;
            Some(skein_report::plot::sweep::Cell { mean, low, high })
        };
        let values = rows.values.iter().flat_map(|row| columns.values.iter().map(|column| at(&column.0, &row.0)));
        let (scenario, strategy) = (&of[0].scenario, &of[0].strategy);
        let axis = |side: &Side| (side.name.clone(), side.values.iter().map(|(_, called)| called.clone()).collect());
        let map = HeatMap {
            title: format!("{}, {strategy}", title(experiment, scenario, metric)),
            x: axis(columns),
            y: axis(rows),
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

    #[test]
    fn more_keys_make_a_map_of_the_longest_against_all_others() {
        let kinds = ["{ kind = \"kill\", for_s = 5 }", "{ kind = \"deaf\", for_s = 5 }", "{ kind = \"mute\" }"];
        let three =
            experiment(&[("fault.0", &kinds), ("on", &["\"gate\"", "\"queued\""]), ("radio.loss", &["0", "0.5"])]);
        let cells = [cell("a", &[kinds[1], "\"queued\"", "0.5"])];
        assert_eq!(names(&three, &cells), ["success-a.svg", "mission_s-a.svg"]);
        let svg = &plots(&three, &cells).unwrap()[0].1;
        for text in
            [">kill<", ">deaf<", ">gate, 0<", ">gate, 0.5<", ">queued, 0.5<", ">on, radio.loss ↑<", ">fault.0 →<"]
        {
            assert!(svg.contains(text), "{text} is not in {svg}");
        }
        assert_eq!(svg.matches(">–</text>").count(), 3 * 4 - 1);
    }
}
