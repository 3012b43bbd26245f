//! A row of the report: one quantity, the published value and ours.

use serde::Serialize;
use serde_json::{Value, json};
use skein_report::Summary;

/// A row of reproduction.json.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The paper's row, followed by our geometry and convention.
    pub id: String,
    /// The quantity in words.
    pub quantity: String,
    /// The published value; null where the paper gives none.
    pub published: Value,
    /// Our value; null if the flight did not reach its goal.
    pub ours: Value,
    /// Unit of both values; empty for a number without unit and for a split.
    pub unit: &'static str,
    /// Ends of the 95 % interval, where `ours` is a mean over seeds.
    pub interval: Option<[f64; 2]>,
    /// The command that repeats it.
    pub command: String,
}

/// What a row is about, before it is measured.
pub(crate) struct Quantity {
    /// Id of the row.
    pub(crate) id: String,
    /// The quantity in words.
    pub(crate) words: String,
    /// Unit; empty for a number without unit and for a split.
    pub(crate) unit: &'static str,
    /// The published value; null where the paper gives none.
    pub(crate) published: Value,
}

impl Quantity {
    /// A quantity from its parts.
    pub(crate) fn new(id: String, words: String, unit: &'static str, published: Value) -> Self {
        Self { id, words, unit, published }
    }

    /// The row with our value, without an interval.
    pub(crate) fn row(self, ours: Value, command: String) -> Row {
        let Self { id, words, unit, published } = self;
        Row { id, quantity: words, published, ours, unit, interval: None, command }
    }
}

/// Which part of a mission's energy is counted.
#[derive(Clone, Copy)]
pub(crate) struct Convention {
    /// Key in row ids.
    pub(crate) key: &'static str,
    /// In words.
    pub(crate) words: &'static str,
    /// The energy, J.
    pub(crate) energy_j: fn(&Summary) -> Option<f64>,
}

/// The three conventions.
pub(crate) const CONVENTIONS: [Convention; 3] = [
    Convention { key: "total", words: "start to end", energy_j: |summary| Some(summary.energy_j.total) },
    Convention { key: "until_passed", words: "start to pass", energy_j: |summary| summary.energy_j.until_passed },
    Convention {
        key: "detection_to_pass",
        words: "detection to pass",
        energy_j: |summary| summary.energy_j.detection_to_pass,
    },
];

/// Time from detection until the last drone is past the first obstacle set, s.
pub(crate) fn pass_s(summary: &Summary) -> Option<f64> {
    summary.stages.first()?.pass_time_s
}

/// Rounds to three decimals, as all numbers in rows are.
pub(crate) fn rounded(value: f64) -> Value {
    json!((value * 1e3).round() / 1e3)
}
