//! One row for each published quantity, and for those of ours that belong beside them.

use super::flight::Flight;
use super::flights::{GEOMETRIES, PAPER, SHORTEST, title};
use super::forest::{FOUR_GROUPS, Forest};
use super::results::Results;
use super::studies::{Line, Study, studies};
use super::{gain, jitter};
use serde::Serialize;
use serde_json::{Value, json};
use skein_protocol::energy::power_w;
use skein_protocol::record::Outcome;
use skein_report::Summary;
use skein_report::deviation::ShapeDeviation;
use skein_report::plot::reproduce::SwarmExtent;

/// A row of reproduction.json.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The paper's row, and which of our geometries and conventions.
    pub id: String,
    /// What it is, in words.
    pub quantity: String,
    /// By the paper; null where it is silent.
    pub published: Value,
    /// Null if the flight did not reach its goal.
    pub ours: Value,
    /// Empty for a number without unit and for a split.
    pub unit: &'static str,
    /// Ends of a 95 % interval, where `ours` is a mean over seeds.
    pub interval: Option<[f64; 2]>,
    /// Repeats it.
    pub command: String,
}

impl Row {
    /// A row without an interval; `values` are the published one and ours.
    pub fn new(id: String, quantity: String, unit: &'static str, values: (Value, Value), command: String) -> Self {
        let (published, ours) = values;
        Self { id, quantity, published, ours, unit, interval: None, command }
    }
}

/// Energy in one of the conventions of a mission's end, J.
pub type Convention = (&'static str, &'static str, fn(&Summary) -> Option<f64>);

/// Key, words and value of each convention.
pub const CONVENTIONS: [Convention; 3] = [
    ("total", "start to end", |summary| Some(summary.energy_j.total)),
    ("until_passed", "start to pass", |summary| summary.energy_j.until_passed),
    ("detection_to_pass", "detection to pass", |summary| summary.energy_j.detection_to_pass),
];

/// Time from detection until the last drone is past the first obstacle set, s.
pub fn pass_s(summary: &Summary) -> Option<f64> {
    summary.stages.first()?.pass_time_s
}

/// In all rows a number has three decimals.
pub fn rounded(value: f64) -> Value {
    json!((value * 1e3).round() / 1e3)
}

struct Rows<'a> {
    results: &'a Results,
    rows: Vec<Row>,
}

/// All rows.
pub fn rows(results: &Results, forest: &Forest, quick: bool) -> Vec<Row> {
    let mut rows = Rows { results, rows: Vec::new() };
    GEOMETRIES.iter().for_each(|geometry| rows.times(geometry));
    GEOMETRIES.iter().for_each(|geometry| rows.energies(geometry));
    GEOMETRIES.iter().for_each(|geometry| rows.forecasts(geometry));
    rows.forest(forest);
    rows.disturbance(forest);
    rows.rows.extend(jitter::rows(results, quick));
    rows.power();
    studies(quick).iter().for_each(|study| rows.study(study));
    rows.rows.extend(gain::rows(results, quick));
    rows.rows
}

impl Rows<'_> {
    fn push(&mut self, id: String, quantity: String, unit: &'static str, values: (Value, Value), command: String) {
        self.rows.push(Row::new(id, quantity, unit, values, command));
    }

    /// A row of one flight.
    fn of(
        &mut self,
        (id, quantity, unit): (String, String, &'static str),
        published: Value,
        flight: &Flight,
        ours: impl Fn(&Summary) -> Option<Value>,
    ) {
        let ours = self.results.reached(flight).and_then(ours).unwrap_or_default();
        self.push(id, quantity, unit, (published, ours), flight.command());
    }

    fn times(&mut self, geometry: &str) {
        let name = title(geometry);
        let published = [
            ("R1", "centred", json!(28.0), "4/4"),
            ("R2", "left", Value::Null, "6/2"),
            ("R3", "right", json!(32.0), "2/6"),
        ];
        for (id, placement, time_s, split) in published {
            let flight = Flight::new(&format!("{geometry}-{placement}"), PAPER);
            let where_ = format!("obstacle {placement}, {name}");
            let what = (format!("{id}.{name}.time"), format!("time to pass, {where_}"), "s");
            self.of(what, time_s, &flight, |summary| pass_s(summary).map(rounded));
            let what = (format!("{id}.{name}.split"), format!("best split in the paper's labels, {where_}"), "");
            self.of(what, json!(split), &flight, |summary| {
                // The paper's left is our right: the report says why.
                let [left, right] = summary.stages.first()?.split_left_right?;
                Some(json!(format!("{right}/{left}")))
            });
        }
    }

    fn energies(&mut self, geometry: &str) {
        let name = title(geometry);
        let [paper, shortest] = [PAPER, SHORTEST].map(|strategy| Flight::new(&format!("{geometry}-right"), strategy));
        for (flight, strategy, published) in [(&paper, PAPER, 54.111), (&shortest, SHORTEST, 62.084)] {
            let what = (format!("R4.{name}.{strategy}"), format!("energy, {strategy}, {name}"), "kJ");
            self.of(what, json!(published), flight, |summary| Some(rounded(summary.energy_j.total / 1e3)));
        }
        let command = format!("{}; {}", paper.command(), shortest.command());
        for (key, words, energy) in CONVENTIONS {
            let of = |flight| self.results.reached(flight).and_then(energy);
            let ours = of(&shortest).zip(of(&paper)).map(|(shortest, paper)| rounded(shortest / paper));
            let quantity = format!("energy, shortest path / congestion aware, {words}, {name}");
            let values = (json!(1.147), ours.unwrap_or_default());
            self.push(format!("R4.{name}.ratio.{key}"), quantity, "", values, command.clone());
        }
        let what = (format!("R4.{name}.time.{SHORTEST}"), format!("time to pass, {SHORTEST}, {name}"), "s");
        self.of(what, Value::Null, &shortest, |summary| pass_s(summary).map(rounded));
    }

    fn forecasts(&mut self, geometry: &str) {
        let name = title(geometry);
        let cases = [("best", "right", PAPER), ("shortest", "right", SHORTEST), ("centred", "centred", PAPER)];
        for (key, placement, strategy) in cases {
            let flight = Flight::new(&format!("{geometry}-{placement}"), strategy);
            let quantity = format!("T* as the leader forecasts it, {strategy}, obstacle {placement}, {name}");
            self.of((format!("T*.{name}.{key}"), quantity, "s"), Value::Null, &flight, |summary| {
                summary.stages.first()?.predicted_s.map(rounded)
            });
        }
    }

    fn forest(&mut self, forest: &Forest) {
        let flight = Flight::new("forest", PAPER);
        let stage = |summary: &Summary, i: usize| summary.stages.get(i).cloned();
        let mut add = |key: &str, quantity: &str, unit, published: Value, ours: Option<f64>| {
            let ours = ours.filter(|_| forest.summary.outcome == Outcome::Reached);
            let values = (published, ours.map(rounded).unwrap_or_default());
            self.push(key.to_owned(), format!("{quantity}, forest"), unit, values, flight.command());
        };
        let summary = &forest.summary;
        let (first, second) = (stage(summary, 0), stage(summary, 1));
        let detected = |stage: &Option<skein_report::Stage>| stage.as_ref().and_then(|stage| stage.detected_s);
        let passed = |stage: &Option<skein_report::Stage>| stage.as_ref().and_then(|stage| stage.passed_s);
        let between = detected(&first).zip(detected(&second));
        let peak = |of: fn(&SwarmExtent) -> f64| {
            let (from_s, to_s) = between?;
            forest.snapshots.extents(from_s, to_s).max_by(|a, b| of(a).total_cmp(&of(b))).map(|extent| extent.t_s)
        };
        let (farthest, widest) = (peak(|extent| extent.distance_m), peak(|extent| extent.width_m));
        add("R5.detection.1", "first obstacles detected", "s", json!(25.0), detected(&first));
        add("R5.peak", "greatest mean inter-drone distance", "s", json!(43.0), farthest);
        add("R5.widest", "widest across the flight", "s", json!(50.0), widest);
        add("R5.passed.1", "first obstacles passed", "s", Value::Null, passed(&first));
        add("R5.detection.2", "second set detected", "s", json!(66.0), detected(&second));
        add("R5.passed.2", "second set passed", "s", Value::Null, passed(&second));
        add("R5.reformation", "reformation begins", "s", json!(80.0), summary.reform_start_s);
        add("R5.end", "formation closed", "s", Value::Null, summary.reform_end_s);
        add(
            "R5.separation",
            "least separation (published: the safe distance)",
            "m",
            json!(25.0),
            summary.min_separation_m,
        );
        add("R6", "error in the mean inter-drone distance", "m", json!(0.8), summary.mean_distance_error_m);
        add("R6.slot", "largest slot error", "m", Value::Null, summary.formation_error_m);
        add(
            "R5.energy.congestion-aware-paper",
            "energy, congestion-aware-paper",
            "kJ",
            Value::Null,
            Some(summary.energy_j.total / 1e3),
        );
        let groups = json!(forest.snapshots.groups(FOUR_GROUPS).join(" "));
        let values = (json!("N11 N12 N21 N22"), groups);
        self.push("R5.groups".to_owned(), "subgroups at 70 s, forest".to_owned(), "", values, flight.command());
        let shortest = Flight::new("forest", SHORTEST);
        let what = (format!("R5.energy.{SHORTEST}"), format!("energy, {SHORTEST}, forest"), "kJ");
        self.of(what, Value::Null, &shortest, |summary| Some(rounded(summary.energy_j.total / 1e3)));
    }

    /// E6 over the forest mission.
    fn disturbance(&mut self, forest: &Forest) {
        let detected = |set: usize| forest.summary.stages.get(set).and_then(|stage| stage.detected_s);
        let most = |from_s: Option<f64>, to_s: Option<f64>| forest.disturbance(from_s?, to_s?);
        let (first, second) = (most(detected(0), detected(1)), most(detected(1), Some(f64::INFINITY)));
        let how_much = |deviation: Option<&ShapeDeviation>| deviation.map(|deviation| deviation.disturbance_m);
        let bending = forest.deviations.iter().map(|deviation| deviation.bending).reduce(f64::max);
        let rows = [
            (
                "R5.disturbance",
                "formation disturbance at maximum",
                "s",
                json!(50.0),
                first.map(|deviation| deviation.t_s),
            ),
            ("E6.disturbance.1", "greatest disturbance, first obstacle", "m", Value::Null, how_much(first)),
            ("E6.disturbance.2", "greatest disturbance, second set", "m", Value::Null, how_much(second)),
            ("E6.bending", "greatest bending energy (λ = 0)", "", Value::Null, bending),
        ];
        let command = Flight::new("forest", PAPER).command();
        for (id, quantity, unit, published, ours) in rows {
            let values = (published, ours.map(rounded).unwrap_or_default());
            self.push(id.to_owned(), format!("{quantity}, forest"), unit, values, command.clone());
        }
    }

    fn study(&mut self, study: &Study) {
        for Line { id, labels, flight, published_kj } in &study.lines {
            let words = labels.join(", ");
            let what = (format!("{id}.time"), format!("time to pass the first obstacles, {words}"), "s");
            self.of(what, Value::Null, flight, |summary| pass_s(summary).map(rounded));
            let what = (format!("{id}.mission"), format!("time of the mission, {words}"), "s");
            self.of(what, Value::Null, flight, |summary| Some(rounded(summary.mission_s)));
            for (key, convention, energy) in CONVENTIONS {
                let what = (format!("{id}.{key}"), format!("energy, {convention}, {words}"), "kJ");
                self.of(what, json!(published_kj), flight, |summary| {
                    energy(summary).map(|joules| rounded(joules / 1e3))
                });
            }
            let what = (format!("{id}.separation"), format!("least separation, {words}"), "m");
            self.of(what, Value::Null, flight, |summary| summary.min_separation_m.map(rounded));
        }
    }

    fn power(&mut self) {
        for (speed_mps, published) in [(0.0, 168.48), (5.0, 143.61), (10.0, 126.03), (20.0, 178.30)] {
            let values = (json!(published), rounded(power_w(speed_mps)));
            let quantity = format!("power in level flight at {speed_mps} m/s");
            self.push(format!("P1.{speed_mps}"), quantity, "W", values, "skein reproduce --quick".to_owned());
        }
    }
}
