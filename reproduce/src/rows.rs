//! The rows of the report: one for each published quantity, and for quantities of ours that belong beside them.

use crate::cases::{DRONES, GEOMETRIES, PAPER, SHORTEST, fixed, title};
use crate::flight::Flight;
use crate::forest::{FOUR_GROUPS, Forest};
use crate::results::Results;
use crate::row::{CONVENTIONS, Convention, Quantity, Row, pass_s, rounded};
use crate::studies::studies;
use crate::study::{Study, StudyCase};
use crate::{gain, jitter};
use serde_json::{Value, json};
use skein_protocol::energy::power_w;
use skein_protocol::record::Outcome;
use skein_report::Summary;
use skein_report::deviation::ShapeDeviation;
use skein_report::plot::reproduce::SwarmExtent;

struct Rows<'a> {
    results: &'a Results,
    rows: Vec<Row>,
}

/// All rows.
pub(crate) fn rows(results: &Results, forest: &Forest, quick: bool) -> Vec<Row> {
    let mut rows = Rows { results, rows: Vec::new() };
    for geometry in GEOMETRIES {
        rows.times(geometry);
    }
    for geometry in GEOMETRIES {
        rows.energies(geometry);
    }
    for geometry in GEOMETRIES {
        rows.forecasts(geometry);
    }
    rows.forest(forest);
    rows.disturbance(forest);
    rows.rows.extend(jitter::rows(results, quick));
    rows.power();
    for study in studies(quick) {
        rows.study(&study);
    }
    rows.rows.extend(gain::rows(results, quick));
    rows.rows
}

impl Rows<'_> {
    /// Adds the row of one flight. `ours` takes the value from its summary.
    fn of(&mut self, quantity: Quantity, flight: &Flight, ours: impl Fn(&Summary) -> Option<Value>) {
        let ours = self.results.reached(flight).and_then(ours).unwrap_or_default();
        self.rows.push(quantity.row(ours, flight.command()));
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
            let what =
                Quantity::new(format!("{id}.{name}.time"), format!("time to pass, {where_}"), "s", time_s.clone());
            self.of(what, &flight, |summary| pass_s(summary).map(rounded));
            let what = Quantity::new(
                format!("{id}.{name}.split"),
                format!("split that the rule takes, in the paper's labels, {where_}"),
                "",
                json!(split),
            );
            self.of(what, &flight, |summary| {
                // The paper's left is our right; the report says why.
                let [left, right] = summary.stages.first()?.split_left_right?;
                Some(json!(format!("{right}/{left}")))
            });
            self.fastest(&format!("{geometry}-{placement}"), [id, &name, &where_], (time_s, split));
        }
    }

    /// The split that is the fastest one as flown, of those that were flown. It need not be the one that the rule takes.
    fn fastest(&mut self, scenario: &str, [id, name, where_]: [&str; 3], (time_s, split): (Value, &str)) {
        let time = |left: u32| {
            let flight = Flight::new(scenario, &fixed(left));
            Some((self.results.reached(&flight).and_then(pass_s)?, left, flight))
        };
        let fastest = (0..=DRONES).filter_map(time).min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((fastest_s, left, flight)) = fastest else { return };
        let words = format!("time to pass, fastest split as flown, {where_}");
        let what = Quantity::new(format!("{id}.{name}.fastest.time"), words, "s", time_s);
        self.rows.push(what.row(rounded(fastest_s), flight.command()));
        let words = format!("fastest split as flown, in the paper's labels, {where_}");
        let what = Quantity::new(format!("{id}.{name}.fastest.split"), words, "", json!(split));
        self.rows.push(what.row(json!(format!("{}/{left}", DRONES - left)), flight.command()));
    }

    fn energies(&mut self, geometry: &str) {
        let name = title(geometry);
        let [paper, shortest] = [PAPER, SHORTEST].map(|strategy| Flight::new(&format!("{geometry}-right"), strategy));
        for (flight, strategy, published) in [(&paper, PAPER, 54.111), (&shortest, SHORTEST, 62.084)] {
            let what = Quantity::new(
                format!("R4.{name}.{strategy}"),
                format!("energy, {strategy}, {name}"),
                "kJ",
                json!(published),
            );
            self.of(what, flight, |summary| Some(rounded(summary.energy_j.total / 1e3)));
        }
        let command = format!("{}; {}", paper.command(), shortest.command());
        for Convention { key, words, energy_j } in CONVENTIONS {
            let of = |flight| self.results.reached(flight).and_then(energy_j);
            let ours = of(&shortest).zip(of(&paper)).map(|(shortest, paper)| rounded(shortest / paper));
            let words = format!("energy, shortest path / congestion aware, {words}, {name}");
            let what = Quantity::new(format!("R4.{name}.ratio.{key}"), words, "", json!(1.147));
            self.rows.push(what.row(ours.unwrap_or_default(), command.clone()));
        }
        let what = Quantity::new(
            format!("R4.{name}.time.{SHORTEST}"),
            format!("time to pass, {SHORTEST}, {name}"),
            "s",
            Value::Null,
        );
        self.of(what, &shortest, |summary| pass_s(summary).map(rounded));
    }

    fn forecasts(&mut self, geometry: &str) {
        let name = title(geometry);
        let cases = [("best", "right", PAPER), ("shortest", "right", SHORTEST), ("centred", "centred", PAPER)];
        for (key, placement, strategy) in cases {
            let flight = Flight::new(&format!("{geometry}-{placement}"), strategy);
            let words = format!("T* as the leader forecasts it, {strategy}, obstacle {placement}, {name}");
            let what = Quantity::new(format!("T*.{name}.{key}"), words, "s", Value::Null);
            self.of(what, &flight, |summary| summary.stages.first()?.predicted_s.map(rounded));
        }
    }

    fn forest(&mut self, forest: &Forest) {
        let flight = Flight::new("forest", PAPER);
        let stage = |summary: &Summary, i: usize| summary.stages.get(i).cloned();
        let mut add = |key: &str, quantity: &str, unit, published: Value, ours: Option<f64>| {
            let ours = ours.filter(|_| forest.summary.outcome == Outcome::Reached);
            let what = Quantity::new(key.to_owned(), format!("{quantity}, forest"), unit, published);
            self.rows.push(what.row(ours.map(rounded).unwrap_or_default(), flight.command()));
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
            "least separation / safe distance (published: never closer; the 25 m are ours)",
            "",
            json!(1.0),
            summary.min_separation_m.map(|separation_m| separation_m / forest.facts.safe_distance_m),
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
        let words = "subgroups at 70 s, forest".to_owned();
        let what = Quantity::new("R5.groups".to_owned(), words, "", json!("N11 N12 N21 N22"));
        self.rows.push(what.row(groups, flight.command()));
        let shortest = Flight::new("forest", SHORTEST);
        let what =
            Quantity::new(format!("R5.energy.{SHORTEST}"), format!("energy, {SHORTEST}, forest"), "kJ", Value::Null);
        self.of(what, &shortest, |summary| Some(rounded(summary.energy_j.total / 1e3)));
    }

    /// E6 over the forest mission.
    fn disturbance(&mut self, forest: &Forest) {
        let detected = |set: usize| forest.summary.stages.get(set).and_then(|stage| stage.detected_s);
        let most = |from_s: Option<f64>, to_s: Option<f64>| forest.disturbance(from_s?, to_s?);
        let (first, second) = (most(detected(0), detected(1)), most(detected(1), Some(f64::INFINITY)));
        let disturbance_m = |deviation: Option<&ShapeDeviation>| deviation.map(|deviation| deviation.disturbance_m);
        let bending = forest.deviations.iter().map(|deviation| deviation.bending).reduce(f64::max);
        let rows = [
            (
                "R5.disturbance",
                "formation disturbance at maximum",
                "s",
                json!(50.0),
                first.map(|deviation| deviation.t_s),
            ),
            ("E6.disturbance.1", "greatest disturbance, first obstacle", "m", Value::Null, disturbance_m(first)),
            ("E6.disturbance.2", "greatest disturbance, second set", "m", Value::Null, disturbance_m(second)),
            ("E6.bending", "greatest bending energy (λ = 0)", "", Value::Null, bending),
        ];
        let command = Flight::new("forest", PAPER).command();
        for (id, quantity, unit, published, ours) in rows {
            let what = Quantity::new(id.to_owned(), format!("{quantity}, forest"), unit, published);
            self.rows.push(what.row(ours.map(rounded).unwrap_or_default(), command.clone()));
        }
    }

    fn study(&mut self, study: &Study) {
        for StudyCase { id, labels, flight, published_kj } in &study.cases {
            let words = labels.join(", ");
            let what = Quantity::new(
                format!("{id}.time"),
                format!("time to pass the first obstacles, {words}"),
                "s",
                Value::Null,
            );
            self.of(what, flight, |summary| pass_s(summary).map(rounded));
            let what =
                Quantity::new(format!("{id}.mission"), format!("time of the mission, {words}"), "s", Value::Null);
            self.of(what, flight, |summary| Some(rounded(summary.mission_s)));
            for Convention { key, words: convention, energy_j } in CONVENTIONS {
                let what = Quantity::new(
                    format!("{id}.{key}"),
                    format!("energy, {convention}, {words}"),
                    "kJ",
                    json!(published_kj),
                );
                self.of(what, flight, |summary| energy_j(summary).map(|joules| rounded(joules / 1e3)));
            }
            let what =
                Quantity::new(format!("{id}.separation"), format!("least separation, {words}"), "m", Value::Null);
            self.of(what, flight, |summary| summary.min_separation_m.map(rounded));
        }
    }

    fn power(&mut self) {
        // The paper publishes no power: a value that is computed from Zeng's formula would agree with itself.
        for speed_mps in [0.0, 5.0, 10.0, 20.0] {
            let words =
                format!("power in level flight at {speed_mps} m/s, by the formula of Zeng, Xu and Zhang (2019)");
            let what = Quantity::new(format!("P1.{speed_mps}"), words, "W", Value::Null);
            self.rows.push(what.row(rounded(power_w(speed_mps)), "skein reproduce --quick".to_owned()));
        }
    }
}
