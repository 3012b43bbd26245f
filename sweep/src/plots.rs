//! The plots of a sweep: lines if one key of the grid varies, heat maps if several do.

use crate::cells::{Cell, toml_value};
use crate::error::SweepError;
use crate::experiment::Experiment;
use crate::metrics::{SUCCESS, label, metric};
use skein_report::plot::sweep::{HeatMap, Lines, Point, Series};
use std::collections::BTreeSet;

/// A drawn plot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plot {
    /// Name of its file.
    pub file: String,
    /// The drawing.
    pub svg: String,
}

/// The plots of these metrics. None if no key varies.
pub(crate) fn plots(experiment: &Experiment, cells: &[Cell], metrics: &[String]) -> Result<Vec<Plot>, SweepError> {
    let varying: Vec<usize> = (0..experiment.grid.len()).filter(|&i| experiment.grid[i].values.len() > 1).collect();
    let scenarios = || cells.chunk_by(|a, b| a.scenario == b.scenario);
    match varying[..] {
        [x] => {
            let plots =
                scenarios().flat_map(|of| metrics.iter().filter_map(move |name| lines(experiment, of, x, name)));
            plots.collect()
        }
        [] => Ok(Vec::new()),
        _ => {
            let axes = axes(experiment, varying);
            Ok(metrics.iter().flat_map(|name| maps(experiment, cells, &axes, name)).collect())
        }
    }
}

/// The two axes of a heat map.
struct MapAxes {
    columns: Axis,
    rows: Axis,
}

/// One axis of a heat map: one or more keys of the grid, and all combinations of their values.
struct Axis {
    /// Indices of the keys in the grid.
    keys: Vec<usize>,
    name: String,
    ticks: Vec<Tick>,
}

/// A combination of values and its label.
struct Tick {
    values: Vec<String>,
    label: String,
}

/// The key with the most values makes the columns; all other keys make the rows.
fn axes(experiment: &Experiment, varying: Vec<usize>) -> MapAxes {
    let values = |&key: &usize| experiment.grid[key].values.len();
    let widest = varying.iter().copied().max_by_key(values).unwrap_or(0);
    let (columns, rows) = varying.into_iter().partition(|&key| key == widest);
    MapAxes { columns: axis(experiment, columns), rows: axis(experiment, rows) }
}

fn axis(experiment: &Experiment, keys: Vec<usize>) -> Axis {
    let mut ticks = vec![Tick { values: Vec::new(), label: String::new() }];
    for &key in &keys {
        let values = &experiment.grid[key].values;
        let labels = brief(values);
        let longer = |tick: &Tick| {
            let join = |(value, label): (&String, &String)| {
                let comma = if tick.label.is_empty() { "" } else { ", " };
                let values = tick.values.iter().chain([value]).cloned().collect();
                Tick { values, label: format!("{}{comma}{label}", tick.label) }
            };
            values.iter().zip(&labels).map(join).collect::<Vec<_>>()
        };
        ticks = ticks.iter().flat_map(longer).collect();
    }
    let name: Vec<&str> = keys.iter().map(|&key| experiment.grid[key].key.as_str()).collect();
    Axis { name: name.join(", "), keys, ticks }
}

/// Short labels of TOML values: texts without quotes, and tables by the first key whose values are all different.
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
    let by_key = first.and_then(|table| table.keys().find_map(|key| by(key)));
    let text = |(value, parsed): (&String, &Option<toml::Value>)| {
        parsed.as_ref().and_then(toml::Value::as_str).unwrap_or(value).to_owned()
    };
    by_key.unwrap_or_else(|| values.iter().zip(&parsed).map(text).collect())
}

/// Label of a metric on a plot's axis, and the factor to its unit there: energies are in kJ.
pub(crate) fn unit(metric: &str) -> (String, f64) {
    let label = label(metric);
    match label.strip_suffix("(J)") {
        Some(energy) => (format!("{energy}(kJ)"), 1e-3),
        None => (label, 1.0),
    }
}

/// The plot of one scenario, with one line for each strategy.
fn lines(experiment: &Experiment, cells: &[Cell], axis: usize, metric: &str) -> Option<Result<Plot, SweepError>> {
    let values = &experiment.grid[axis].values;
    // If the values are not numbers, x is the index in the list.
    let place = |value: &String| values.iter().position(|v| v == value).unwrap_or(0) as f64;
    let numbers = values.iter().all(|value| value.parse::<f64>().is_ok());
    let x = |value: &String| if numbers { value.parse().unwrap_or(0.0) } else { place(value) };
    let (y_label, factor) = unit(metric);
    let series = |of: &[Cell]| {
        let point = |cell: &Cell| {
            let found = cell.estimate(metric)?;
            let [low, high] = found.interval().unwrap_or([found.mean; 2]).map(|end| end * factor);
            Some(Point { x: x(&cell.values[axis]), mean: found.mean * factor, low, high })
        };
        let mut points: Vec<Point> = of.iter().filter_map(point).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        Series { label: of[0].strategy.clone(), points }
    };
    let series: Vec<Series> = curves(cells).map(series).filter(|series| !series.points.is_empty()).collect();
    if series.is_empty() {
        return None;
    }
    let key = &experiment.grid[axis].key;
    let x_label = if numbers { key.clone() } else { format!("{key} (0 = {})", values.join(", ")) };
    let title = title(experiment, cells, metric);
    let lines = Lines { title, x_label, y_label, series };
    let file = file(experiment, metric, &cells[0].scenario, None);
    Some(match lines.draw() {
        Ok(svg) => Ok(Plot { file, svg }),
        Err(source) => Err(SweepError::Plot { name: file, source }),
    })
}

fn maps(experiment: &Experiment, cells: &[Cell], axes: &MapAxes, metric: &str) -> Vec<Plot> {
    let MapAxes { columns, rows } = axes;
    let factor = unit(metric).1;
    let map = |of: &[Cell]| {
        let has = |cell: &Cell, axis: &Axis, wanted: &[String]| {
            axis.keys.iter().zip(wanted).all(|(&key, value)| cell.values[key] == *value)
        };
        let at = |column: &[String], row: &[String]| {
            let cell = of.iter().find(|cell| has(cell, columns, column) && has(cell, rows, row))?;
            let found = cell.estimate(metric)?;
            let interval = found.interval().map(|ends| ends.map(|end| end * factor));
            Some(skein_report::plot::sweep::Cell { mean: found.mean * factor, interval })
        };
        let values =
            rows.ticks.iter().flat_map(|row| columns.ticks.iter().map(|column| at(&column.values, &row.values)));
        let (scenario, strategy) = (&of[0].scenario, &of[0].strategy);
        let axis = |axis: &Axis| (axis.name.clone(), axis.ticks.iter().map(|tick| tick.label.clone()).collect());
        let map = HeatMap {
            title: format!("{}, {strategy}", title(experiment, of, metric)),
            x: axis(columns),
            y: axis(rows),
            cells: values.collect(),
        };
        Plot { file: file(experiment, metric, scenario, Some(strategy)), svg: map.draw() }
    };
    curves(cells).map(map).collect()
}

/// The cells of each scenario and strategy, which stand together in the grid's order.
fn curves(cells: &[Cell]) -> impl Iterator<Item = &[Cell]> {
    cells.chunk_by(|a, b| (&a.scenario, &a.strategy) == (&b.scenario, &b.strategy))
}

/// Name of a plot's file. It names the scenario only if the experiment has several.
fn file(experiment: &Experiment, metric: &str, scenario: &str, strategy: Option<&str>) -> String {
    let scenario = (experiment.scenarios.len() > 1).then_some(scenario);
    let parts: Vec<&str> = std::iter::once(metric).chain(scenario).chain(strategy).collect();
    format!("{}.svg", parts.join("-").replace([':', '/'], "-"))
}

fn title(experiment: &Experiment, cells: &[Cell], metric_name: &str) -> String {
    let interval = if cells.iter().all(|cell| cell.equal > 0) {
        "no interval, as all runs of a cell are equal"
    } else if metric_name == SUCCESS {
        "Wilson's 95 % interval"
    } else {
        "mean and its 95 % interval"
    };
    let scenario = &cells[0].scenario;
    let of = if metric(metric_name).is_some_and(|metric| metric.reached_only) {
        " of runs that reached the goal"
    } else {
        ""
    };
    let (name, seeds) = (&experiment.name, experiment.seeds.len());
    format!("{name}, {scenario}: {}, {interval}{of}, {seeds} seeds", unit(metric_name).0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Axis, Mission};
    use crate::random_scene::SceneBounds;
    use crate::statistics::{mean, rate};
    use std::collections::BTreeMap;

    fn experiment(axes: &[(&str, &[&str])]) -> Experiment {
        let axis = |&(key, values): &(&str, &[&str])| Axis {
            key: key.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
            places: Vec::new(),
        };
        Experiment {
            name: "e".to_owned(),
            scenarios: vec![Mission::Random],
            strategies: vec![],
            strategy_places: vec![],
            seeds: vec![1],
            grid: axes.iter().map(axis).collect(),
            processes: false,
            metrics: None,
            bounds: SceneBounds::default(),
        }
    }

    fn cell(strategy: &str, values: &[&str]) -> Cell {
        Cell {
            scenario: "random".to_owned(),
            strategy: strategy.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
            outcomes: BTreeMap::new(),
            equal: 0,
            success: rate(1, 2),
            metrics: crate::metrics::METRICS.iter().map(|_| mean(&[1.0, 2.0])).collect(),
            metrics_own: mean(&[3.0, 4.0]).map(|found| ("gap_m".to_owned(), found)).into_iter().collect(),
        }
    }

    fn drawn(experiment: &Experiment, cells: &[Cell]) -> Vec<Plot> {
        plots(experiment, cells, &[SUCCESS, "mission_s", "metric.gap_m"].map(str::to_owned)).unwrap()
    }

    fn names(experiment: &Experiment, cells: &[Cell]) -> Vec<String> {
        drawn(experiment, cells).into_iter().map(|plot| plot.file).collect()
    }

    #[test]
    fn one_varying_key_makes_lines_and_two_make_maps() {
        let one = experiment(&[("radio.loss", &["0", "0.5"]), ("radio.delay_s", &["1"])]);
        let cells =
            [cell("a", &["0", "1"]), cell("a", &["0.5", "1"]), cell("b", &["0", "1"]), cell("b", &["0.5", "1"])];
        assert_eq!(names(&one, &cells), ["success.svg", "mission_s.svg", "metric.gap_m.svg"]);
        let plots = drawn(&one, &cells);
        let svg = &plots[1].svg;
        assert!(svg.contains("radio.loss") && svg.contains("mission time (s)") && svg.matches("<circle").count() == 4);
        let energy = super::plots(&one, &cells, &["energy_j".to_owned()]).unwrap();
        assert!(energy[0].svg.contains("energy (kJ)") && energy[0].svg.contains("\n0.00"), "{}", energy[0].svg);
        assert!(plots[2].svg.contains("gap_m, mean over drones and time"), "{}", plots[2].svg);
        let two = experiment(&[("radio.loss", &["0", "0.5"]), ("radio.delay_s", &["0", "1"])]);
        let cells = [cell("fixed:1/2", &["0", "0"]), cell("fixed:1/2", &["0.5", "1"])];
        assert_eq!(
            names(&two, &cells),
            ["success-fixed-1-2.svg", "mission_s-fixed-1-2.svg", "metric.gap_m-fixed-1-2.svg"]
        );
        let svg = &drawn(&two, &cells)[0].svg;
        assert_eq!((svg.matches(">0.5</text>").count(), svg.matches(">–</text>").count()), (3, 2), "{svg}");
        assert_eq!(names(&experiment(&[]), &cells), Vec::<String>::new());
    }

    #[test]
    fn several_keys_make_a_map_of_the_longest_against_all_others() {
        let kinds = ["{ kind = \"kill\", for_s = 5 }", "{ kind = \"deaf\", for_s = 5 }", "{ kind = \"mute\" }"];
        let three =
            experiment(&[("fault.0", &kinds), ("on", &["\"gate\"", "\"queued\""]), ("radio.loss", &["0", "0.5"])]);
        let cells = [cell("a", &[kinds[1], "\"queued\"", "0.5"])];
        assert_eq!(names(&three, &cells), ["success-a.svg", "mission_s-a.svg", "metric.gap_m-a.svg"]);
        let svg = &drawn(&three, &cells)[0].svg;
        for text in
            [">kill<", ">deaf<", ">gate, 0<", ">gate, 0.5<", ">queued, 0.5<", ">on, radio.loss ↑<", ">fault.0 →<"]
        {
            assert!(svg.contains(text), "{text} is not in {svg}");
        }
        assert_eq!(svg.matches(">–</text>").count(), 3 * 4 - 1);
    }
}
