//! What the paper's rule gains over shortest path, as a surface over the obstacle's shift and the safe distance.

use super::content::Block;
use super::figures::Figure;
use super::flight::Flight;
use super::flights::{DEFAULT, PAPER, SHORTEST};
use super::results::{Results, field};
use super::rows::{Row, pass_s, rounded};
use serde_json::Value;
use skein_report::Summary;
use skein_report::plot::surface::Surface;
use std::fmt::Write as _;

/// The rules whose gain is shown.
const RULES: [&str; 2] = [PAPER, DEFAULT];
/// Gains smaller than this count as none, %.
const NONE: f64 = 0.1;

/// A quantity of a mission, the less the better.
type Cost = fn(&Summary) -> Option<f64>;
/// Key, words and value of those that are compared.
const COSTS: [(&str, &str, Cost); 2] =
    [("energy", "energy, start to end", |summary| Some(summary.energy_j.total)), ("time", "time to pass", pass_s)];

/// Places of the surface: shift of the obstacle to the right, m, and safe distance, m.
struct Axes {
    shifts_m: Vec<u32>,
    distances_m: Vec<u32>,
}

impl Axes {
    fn new(quick: bool) -> Self {
        match quick {
            true => Self { shifts_m: vec![0, 50, 100, 150], distances_m: vec![25, 35, 45, 55] },
            false => Self { shifts_m: (0..=160).step_by(10).collect(), distances_m: (25..=60).step_by(5).collect() },
        }
    }

    /// Row by row from the least safe distance.
    fn cells(&self) -> impl Iterator<Item = (u32, u32)> {
        self.distances_m.iter().flat_map(|distance| self.shifts_m.iter().map(move |shift| (*shift, *distance)))
    }
}

fn flight((shift_m, distance_m): (u32, u32), strategy: &str) -> Flight {
    let y_m = -i64::from(shift_m);
    Flight::new("s2-right", strategy).with("obstacle.0.centre_m.1", y_m).with("drone.safe_distance_m", distance_m)
}

/// Everything that is flown for it.
pub fn flights(quick: bool) -> Vec<Flight> {
    let strategies = [PAPER, DEFAULT, SHORTEST];
    Axes::new(quick).cells().flat_map(|cell| strategies.map(|strategy| flight(cell, strategy))).collect()
}

/// What part of shortest path's cost a rule saves, %.
fn gain(results: &Results, cell: (u32, u32), rule: &str, cost: Cost) -> Option<f64> {
    let of = |strategy| results.reached(&flight(cell, strategy)).and_then(cost);
    Some((1.0 - of(rule)? / of(SHORTEST)?) * 100.0)
}

/// A gain and where it is: shift and safe distance, m.
type Found = (f64, (u32, u32));

/// All gains of a rule, the least first.
fn gains(results: &Results, quick: bool, rule: &str, cost: Cost) -> Vec<Found> {
    let gain = |cell| Some((gain(results, cell, rule, cost)?, cell));
    let mut gains: Vec<Found> = Axes::new(quick).cells().filter_map(gain).collect();
    gains.sort_by(|a, b| a.0.total_cmp(&b.0));
    gains
}

/// The section of the report.
pub fn blocks(results: &Results, quick: bool) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading("The gain over shift and safe distance".to_owned()),
        Block::Text(
            "S2 with its obstacle centred to 160 m off to the right, and safe distances from 25 m: the part of shortest \
             path's energy and time that a rule saves, in per cent. Blue is a loss, orange a gain; the black line \
             divides them. All values are in `gain.csv`."
                .to_owned(),
        ),
    ];
    for rule in RULES {
        let sentences: Vec<String> = COSTS.iter().map(|cost| says(results, quick, rule, cost)).collect();
        blocks.push(Block::Text(format!("`{rule}`: {}", sentences.join(" "))));
    }
    blocks.extend(figures(results, quick).into_iter().map(Block::Figure));
    blocks
}

fn says(results: &Results, quick: bool, rule: &str, (_, words, cost): &(&str, &str, Cost)) -> String {
    let gains = gains(results, quick, rule, *cost);
    let Some((least, most)) = gains.first().zip(gains.last()) else { return format!("{words}: nothing to compare.") };
    let lost: Vec<&Found> = gains.iter().filter(|gain| gain.0 < -NONE).collect();
    let won = gains.iter().filter(|gain| gain.0 > NONE).count();
    let at = |(_, (shift, distance)): &Found| format!("shift {shift} m, safe distance {distance} m");
    let shown: Vec<String> = lost.iter().take(5).map(|gain| format!("{:+.1} % at {}", gain.0, at(gain))).collect();
    let lost = match (lost.len(), shown.is_empty()) {
        (_, true) => format!("nowhere negative, least {:+.1} % at {}", least.0, at(least)),
        (count, _) => format!("negative in {count}, worst first: {}", shown.join("; ")),
    };
    format!("{words}: positive in {won} of {} places, most {:+.1} % at {}; {lost}.", gains.len(), most.0, at(most))
}

fn figures(results: &Results, quick: bool) -> Vec<Figure> {
    let axes = Axes::new(quick);
    let labels = |values: &[u32]| values.iter().map(u32::to_string).collect::<Vec<String>>();
    let mut figures = Vec::new();
    for (rule, (key, words, cost)) in RULES.iter().flat_map(|rule| COSTS.map(|cost| (*rule, cost))) {
        let surface = Surface {
            title: format!("Saved by {rule} against {SHORTEST}: {words} (%)"),
            x: ("shift of the obstacle (m)".to_owned(), labels(&axes.shifts_m)),
            y: ("safe distance (m)".to_owned(), labels(&axes.distances_m)),
            cells: axes.cells().map(|cell| gain(results, cell, rule, cost)).collect(),
        };
        figures.push(Figure {
            file: format!("gain-{key}-{rule}.svg"),
            caption: format!("Gain of `{rule}` over `{SHORTEST}` in S2: {words}, %; – where a flight failed."),
            svg: surface.draw(),
        });
    }
    figures
}

/// Least and greatest gain, and the number of places with a loss.
pub fn rows(results: &Results, quick: bool) -> Vec<Row> {
    let mut rows = Vec::new();
    for (rule, (key, words, cost)) in RULES.iter().flat_map(|rule| COSTS.map(|cost| (*rule, cost))) {
        let gains = gains(results, quick, rule, cost);
        let Some((least, most)) = gains.first().zip(gains.last()) else { continue };
        for (end, words_of_end, found) in [("least", "least", least), ("most", "greatest", most)] {
            let commands = [rule, SHORTEST].map(|strategy| flight(found.1, strategy).command());
            let quantity = format!("{words_of_end} gain over shift and safe distance, {words}, {rule}, S2");
            let (id, command) = (format!("gain.{key}.{rule}.{end}"), commands.join("; "));
            rows.push(Row::new(id, quantity, "%", (Value::Null, rounded(found.0)), command));
        }
        let losses = gains.iter().filter(|gain| gain.0 < -NONE).count();
        let quantity = format!("places of {} where the gain is negative, {words}, {rule}, S2", gains.len());
        let command = if quick { "skein reproduce --quick" } else { "skein reproduce" };
        let values = (Value::Null, losses.into());
        rows.push(Row::new(format!("gain.{key}.{rule}.losses"), quantity, "", values, command.to_owned()));
    }
    rows
}

/// A line a place and rule.
pub fn csv(results: &Results, quick: bool) -> String {
    let mut csv = "shift_m,safe_distance_m,strategy,energy_gain_percent,time_gain_percent\n".to_owned();
    for (cell, rule) in Axes::new(quick).cells().flat_map(|cell| RULES.map(|rule| (cell, rule))) {
        let [energy, time] = COSTS.map(|(_, _, cost)| field(gain(results, cell, rule, cost)));
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{},{},{rule},{energy},{time}", cell.0, cell.1);
    }
    csv
}
