//! A study: flights side by side in a table, and what they show.

use crate::flight::Flight;
use crate::results::Results;
use skein_report::Summary;

/// Flights side by side in a table.
pub(crate) struct Study {
    /// Heading of its section.
    pub(crate) heading: &'static str,
    /// Headings of the first columns.
    pub(crate) labels: &'static [&'static str],
    /// One case for each flight.
    pub(crate) cases: Vec<StudyCase>,
    /// Describes in words what the numbers show.
    pub(crate) finding: fn(&Study, &Results) -> String,
}

/// A flight of a study.
pub(crate) struct StudyCase {
    /// Id of its rows in reproduction.json, without the quantity.
    pub(crate) id: String,
    /// Content of the first columns.
    pub(crate) labels: Vec<String>,
    /// The flight.
    pub(crate) flight: Flight,
    /// Energy published for it, kJ, under a convention that the paper does not name.
    pub(crate) published_kj: Option<f64>,
}

impl StudyCase {
    /// A case without a published energy.
    pub(crate) fn new(id: String, labels: &[&str], flight: Flight) -> Self {
        Self { id, labels: labels.iter().map(|&label| label.to_owned()).collect(), flight, published_kj: None }
    }
}

impl Study {
    /// Summary of the flight with these labels, if it reached its goal.
    pub(crate) fn reached<'a>(&self, results: &'a Results, labels: &[&str]) -> Option<&'a Summary> {
        results.reached(&self.cases.iter().find(|case| case.labels == labels)?.flight)
    }

    /// Energy of one flight over that of another, start to end.
    pub(crate) fn ratio(&self, results: &Results, one: &[&str], other: &[&str]) -> Option<f64> {
        Some(self.reached(results, one)?.energy_j.total / self.reached(results, other)?.energy_j.total)
    }

    /// The different contents of the first column, in order.
    pub(crate) fn first_labels(&self) -> Vec<&str> {
        let mut first: Vec<&str> = self.cases.iter().map(|case| case.labels[0].as_str()).collect();
        first.dedup();
        first
    }
}
