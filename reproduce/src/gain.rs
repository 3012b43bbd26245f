//! The gain of the rules over shortest path, as a surface over the obstacle's shift and the safe distance.

use crate::block::Block;
use crate::cases::{LOOK_AHEAD, PAPER, SHORTEST};
use crate::figures::Figure;
use crate::flight::Flight;
use crate::results::{Results, field};
use crate::row::{Quantity, Row, pass_s, rounded};
use serde_json::Value;
use skein_report::Summary;
use skein_report::plot::surface::Surface;
use std::fmt::Write as _;

/// Strategies whose gain is shown.
const RULES: [&str; 2] = [PAPER, LOOK_AHEAD];
/// Gains and losses below this count as none, %.
const NONE: f64 = 0.1;

/// A cost of a mission that is compared.
#[derive(Clone, Copy)]
struct Cost {
    /// Key in row ids and file names.
    key: &'static str,
    /// In words.
    words: &'static str,
    /// The cost of a flight.
    of: fn(&Summary) -> Option<f64>,
}

/// The costs that are compared.
const COSTS: [Cost; 2] = [
    Cost { key: "energy", words: "energy, start to end", of: |summary| Some(summary.energy_j.total) },
    Cost { key: "time", words: "time to pass", of: pass_s },
];

/// A place of the surface.
#[derive(Clone, Copy)]
struct Place {
    /// Shift of the obstacle to the right, m.
    shift_m: u32,
    /// Safe distance, m.
    distance_m: u32,
}

/// The gain at a place.
struct Gain {
    percent: f64,
    at: Place,
}

/// The values of both coordinates.
struct Axes {
    shifts_m: Vec<u32>,
    distances_m: Vec<u32>,
}

impl Axes {
    fn new(quick: bool) -> Self {
        if quick {
            Self { shifts_m: vec![0, 50, 100, 150], distances_m: vec![25, 35, 45, 55] }
        } else {
            Self { shifts_m: (0..=160).step_by(10).collect(), distances_m: (25..=60).step_by(5).collect() }
        }
    }

    /// All places, row by row from the least safe distance.
    fn places(&self) -> impl Iterator<Item = Place> {
        let row = |&distance_m: &u32| self.shifts_m.iter().map(move |&shift_m| Place { shift_m, distance_m });
        self.distances_m.iter().flat_map(row)
    }
}

fn flight(Place { shift_m, distance_m }: Place, strategy: &str) -> Flight {
    let y_m = -i64::from(shift_m);
    Flight::new("s2-right", strategy).with("obstacle.0.centre_m.1", y_m).with("drone.safe_distance_m", distance_m)
}

/// The flights that the surface needs.
pub(crate) fn flights(quick: bool) -> Vec<Flight> {
    let strategies = [PAPER, LOOK_AHEAD, SHORTEST];
    Axes::new(quick).places().flat_map(|place| strategies.map(|strategy| flight(place, strategy))).collect()
}

/// The share of shortest path's cost that a rule saves, %.
fn gain(results: &Results, place: Place, rule: &str, cost: Cost) -> Option<f64> {
    let of = |strategy| results.reached(&flight(place, strategy)).and_then(cost.of);
    Some((1.0 - of(rule)? / of(SHORTEST)?) * 100.0)
}

/// All gains of a rule, the least first.
fn gains(results: &Results, quick: bool, rule: &str, cost: Cost) -> Vec<Gain> {
    let gain = |at| Some(Gain { percent: gain(results, at, rule, cost)?, at });
    let mut gains: Vec<Gain> = Axes::new(quick).places().filter_map(gain).collect();
    gains.sort_by(|a, b| a.percent.total_cmp(&b.percent));
    gains
}

/// The section of the report.
pub(crate) fn blocks(results: &Results, quick: bool) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading("The gain over shift and safe distance".to_owned()),
        Block::Text(
            "S2 with its obstacle from the centre to 160 m to the right, and with safe distances from 25 m: the share of \
             shortest path's energy and time that a rule saves, in per cent. Blue is a loss, orange is a gain, and the black \
             line divides them. All values are in `gain.csv`."
                .to_owned(),
        ),
    ];
    for rule in RULES {
        let sentences: Vec<String> = COSTS.iter().map(|cost| finding(results, quick, rule, *cost)).collect();
        blocks.push(Block::Text(format!("`{rule}`: {}", sentences.join(" "))));
    }
    blocks.extend(figures(results, quick).into_iter().map(Block::Figure));
    blocks
}

fn finding(results: &Results, quick: bool, rule: &str, cost: Cost) -> String {
    let (gains, words) = (gains(results, quick, rule, cost), cost.words);
    let Some((least, most)) = gains.first().zip(gains.last()) else { return format!("{words}: nothing to compare.") };
    let lost: Vec<&Gain> = gains.iter().filter(|gain| gain.percent < -NONE).collect();
    let won = gains.iter().filter(|gain| gain.percent > NONE).count();
    let shown = |Gain { percent, at }: &Gain| {
        format!("{percent:+.1} % at shift {} m, safe distance {} m", at.shift_m, at.distance_m)
    };
    let worst: Vec<String> = lost.iter().take(5).map(|gain| shown(gain)).collect();
    let lost = if lost.is_empty() {
        format!("nowhere negative, least {}", shown(least))
    } else {
        format!("negative in {}, worst first: {}", lost.len(), worst.join("; "))
    };
    format!("{words}: positive in {won} of {} places, most {}; {lost}.", gains.len(), shown(most))
}

fn figures(results: &Results, quick: bool) -> Vec<Figure> {
    let axes = Axes::new(quick);
    let labels = |values: &[u32]| values.iter().map(u32::to_string).collect::<Vec<String>>();
    let mut figures = Vec::new();
    for (rule, cost) in RULES.iter().flat_map(|rule| COSTS.map(|cost| (*rule, cost))) {
        let Cost { key, words, .. } = cost;
        let surface = Surface {
            title: format!("Saved by {rule} against {SHORTEST}: {words} (%)"),
            x: ("shift of the obstacle (m)".to_owned(), labels(&axes.shifts_m)),
            y: ("safe distance (m)".to_owned(), labels(&axes.distances_m)),
            cells: axes.places().map(|place| gain(results, place, rule, cost)).collect(),
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
pub(crate) fn rows(results: &Results, quick: bool) -> Vec<Row> {
    let mut rows = Vec::new();
    for (rule, cost) in RULES.iter().flat_map(|rule| COSTS.map(|cost| (*rule, cost))) {
        let Cost { key, words, .. } = cost;
        let gains = gains(results, quick, rule, cost);
        let Some((least, most)) = gains.first().zip(gains.last()) else { continue };
        for (end, words_of_end, found) in [("least", "least", least), ("most", "greatest", most)] {
            let commands = [rule, SHORTEST].map(|strategy| flight(found.at, strategy).command());
            let quantity = format!("{words_of_end} gain over shift and safe distance, {words}, {rule}, S2");
            let what = Quantity::new(format!("gain.{key}.{rule}.{end}"), quantity, "%", Value::Null);
            rows.push(what.row(rounded(found.percent), commands.join("; ")));
        }
        let losses = gains.iter().filter(|gain| gain.percent < -NONE).count();
        let quantity = format!("places of {} where the gain is negative, {words}, {rule}, S2", gains.len());
        let command = if quick { "skein reproduce --quick" } else { "skein reproduce" };
        let what = Quantity::new(format!("gain.{key}.{rule}.losses"), quantity, "", Value::Null);
        rows.push(what.row(losses.into(), command.to_owned()));
    }
    rows
}

/// The content of gain.csv: one line for each place and rule.
pub(crate) fn csv(results: &Results, quick: bool) -> String {
    let mut csv = "shift_m,safe_distance_m,strategy,energy_gain_percent,time_gain_percent\n".to_owned();
    for (place, rule) in Axes::new(quick).places().flat_map(|place| RULES.map(|rule| (place, rule))) {
        let [energy, time] = COSTS.map(|cost| field(gain(results, place, rule, cost)));
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{},{},{rule},{energy},{time}", place.shift_m, place.distance_m);
    }
    csv
}
