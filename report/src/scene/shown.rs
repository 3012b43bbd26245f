//! What pilots show in the views: marks and lines.

use crate::scene::rounding::rounded;
use crate::tuning::SAMPLE_MARKS_MAX;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use skein_protocol::telemetry::{Telemetry, TelemetryRow};
use std::collections::BTreeMap;

/// The marks and lines that pilots show, world frame: for each drone those of the last tick since the previous sample in which
/// it showed any.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shown {
    /// The marks, by drone.
    pub marks: Vec<ShownMark>,
    /// The lines, by drone.
    pub lines: Vec<ShownLine>,
}

/// A point that a pilot shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownMark {
    /// The drone that shows it.
    pub drone: u32,
    /// What it is; may be empty.
    pub label: String,
    /// Where it is, m.
    pub at_m: [f64; 3],
}

/// A line that a pilot shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShownLine {
    /// The drone that shows it.
    pub drone: u32,
    /// What it is; may be empty.
    pub label: String,
    /// One end, m.
    pub from_m: [f64; 3],
    /// The other end, m.
    pub to_m: [f64; 3],
}

impl Shown {
    /// Whether there is nothing to show.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.marks.is_empty() && self.lines.is_empty()
    }

    fn take(&mut self, drone: u32, telemetry: Telemetry) {
        let place = |at: [f64; 3]| at.map(rounded);
        match telemetry {
            Telemetry::Mark { label, point_m } => {
                self.marks.push(ShownMark { drone, label: label.as_str().to_owned(), at_m: place(point_m) });
            }
            Telemetry::Line { label, from_m, to_m } => {
                let (from_m, to_m) = (place(from_m), place(to_m));
                self.lines.push(ShownLine { drone, label: label.as_str().to_owned(), from_m, to_m });
            }
            Telemetry::Metric { .. } | Telemetry::Failure { .. } => {}
        }
    }
}

/// Collects what pilots show between two samples.
#[derive(Debug, Default)]
pub(super) struct ShownSince {
    /// What each drone shows, and in which tick.
    drones: BTreeMap<u32, (u64, Shown)>,
}

impl ShownSince {
    /// Takes the telemetry of a tick.
    pub(super) fn take(&mut self, tick: u64, telemetry: &[TelemetryRow]) {
        for row in telemetry.iter().filter(|row| row.metric().is_none()) {
            let Some(telemetry) = row.telemetry() else { continue };
            let (at, shown) = self.drones.entry(row.drone.0).or_default();
            if *at != tick {
                (*at, *shown) = (tick, Shown::default());
            }
            shown.take(row.drone.0, telemetry);
        }
    }

    /// What is shown since the previous sample. Forgets it.
    pub(super) fn finish(&mut self) -> Shown {
        let mut all = Shown::default();
        for (_, shown) in std::mem::take(&mut self.drones).into_values() {
            all.marks.extend(shown.marks);
            all.lines.extend(shown.lines);
        }
        all.marks.truncate(SAMPLE_MARKS_MAX);
        all.lines.truncate(SAMPLE_MARKS_MAX);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::{DroneId, MetricName, ShortText};

    #[test]
    fn of_each_drone_the_last_tick_with_marks_is_shown() {
        let row = |drone, telemetry| TelemetryRow::new(DroneId(drone), &telemetry).unwrap();
        let label = ShortText::cut("goal");
        let mark = |drone, x: f64| row(drone, Telemetry::Mark { label, point_m: [x, 0.0004, 50.0] });
        let line = |drone| row(drone, Telemetry::Line { label, from_m: [0.0; 3], to_m: [1.0; 3] });
        let metric = row(0, Telemetry::Metric { name: MetricName::new("order").unwrap(), value: 1.0 });
        let mut since = ShownSince::default();
        since.take(0, &[mark(0, 1.0), metric, mark(1, 5.0)]);
        since.take(1, &[mark(0, 2.0), mark(0, 3.0), line(0)]);
        since.take(2, &[metric]);
        let shown = since.finish();
        let marks: Vec<_> = shown.marks.iter().map(|mark| (mark.drone, mark.label.as_str(), mark.at_m)).collect();
        assert_eq!(
            marks,
            [(0, "goal", [2.0, 0.0, 50.0]), (0, "goal", [3.0, 0.0, 50.0]), (1, "goal", [5.0, 0.0, 50.0])]
        );
        assert_eq!((shown.lines.len(), shown.lines[0].to_m), (1, [1.0; 3]));
        assert!(since.finish().is_empty());
    }
}
