//! A flown mission with its whole record.

use skein_protocol::record::{DroneRow, EventKind, Outcome, RecordSink, RecordView, RunEvent, SinkError};
use skein_protocol::{DroneId, Phase, Vec2};
use skein_runtime::{PilotRegistry, inline};
use skein_scenario::{Scenario, ScenarioSource};

/// The record of a flight.
#[derive(Default)]
pub(crate) struct Flown {
    /// Of every tick: the time, s, and one row per drone.
    pub ticks: Vec<(f64, Vec<DroneRow>)>,
    pub events: Vec<RunEvent>,
}

impl RecordSink for Flown {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let parse = |line: &[u8]| serde_json::from_slice::<RunEvent>(line).map_err(|error| error.to_string());
        self.events.extend(record.parse_events(parse)?);
        let t_s = record.head.now.secs();
        // The last record may repeat the rows.
        if !record.rows.is_empty() && self.ticks.last().is_none_or(|(last_s, _)| t_s > *last_s) {
            self.ticks.push((t_s, record.rows.to_vec()));
        }
        Ok(())
    }
}

/// A scenario file below `scenarios`, such as `paper/s2-right`, with these keys set.
pub(crate) fn scenario(name: &str, sets: &[(&str, &str)]) -> Scenario {
    let path = format!("{}/../scenarios/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    parse(&std::fs::read_to_string(&path).unwrap(), sets)
}

/// A scenario from text.
pub(crate) fn parse(text: &str, sets: &[(&str, &str)]) -> Scenario {
    let sets: Vec<_> = sets.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
    Scenario::parse(text, ScenarioSource { name: "test", stem: "test" }, &sets).unwrap()
}

pub(crate) fn fly(scenario: &Scenario) -> Flown {
    let mut flown = Flown::default();
    inline::run(scenario, &PilotRegistry::built_in().unwrap(), &mut flown, || None).unwrap();
    flown
}

/// Flies a scenario file by the paper's rule. The mission must reach its goal with every distance kept.
pub(crate) fn fly_file(name: &str, sets: &[(&str, &str)]) -> Flown {
    let rule = ("strategy", "congestion-aware-paper");
    let flown = fly(&scenario(name, &[&[rule], sets].concat()));
    assert_eq!(flown.outcome(), Outcome::Reached, "{name} {sets:?}");
    flown
}

pub(crate) fn position(row: &DroneRow) -> Vec2 {
    skein_protocol::horizontal(row.position_m)
}

pub(crate) fn velocity(row: &DroneRow) -> Vec2 {
    skein_protocol::horizontal(row.velocity_mps)
}

impl Flown {
    pub(crate) fn outcome(&self) -> Outcome {
        let end = |event: &RunEvent| match event.what {
            EventKind::End { outcome, .. } => Some(outcome),
            _ => None,
        };
        self.events.iter().find_map(end).unwrap()
    }

    /// Time of the first event that fulfils a condition, s.
    pub(crate) fn when(&self, what: impl Fn(&EventKind) -> bool) -> f64 {
        self.events.iter().find(|event| what(&event.what)).unwrap().t_s
    }

    pub(crate) fn detected_s(&self, set: u32) -> f64 {
        self.when(|what| matches!(what, EventKind::Detected { stage, .. } if *stage == set))
    }

    pub(crate) fn passed_s(&self, set: u32) -> f64 {
        self.when(|what| matches!(what, EventKind::Passed { stage } if *stage == set))
    }

    /// The first plan to avoid an obstacle set: its predicted time, s, and when it was made, s.
    pub(crate) fn grouping(&self) -> (f64, f64) {
        let avoid = |event: &RunEvent| match &event.what {
            EventKind::Grouping { phase, predicted_s, .. } if *phase == Phase::Avoid => {
                Some((predicted_s.unwrap(), event.t_s))
            }
            _ => None,
        };
        self.events.iter().find_map(avoid).unwrap()
    }

    /// Number of routes of the last plan to avoid an obstacle set. The last plan knows all obstacles, also those seen late.
    pub(crate) fn routes(&self) -> u32 {
        let avoid = |event: &RunEvent| match &event.what {
            EventKind::Grouping { phase, routes, .. } if *phase == Phase::Avoid => Some(*routes),
            _ => None,
        };
        self.events.iter().rev().find_map(avoid).unwrap()
    }

    pub(crate) fn at(&self, t_s: f64) -> &[DroneRow] {
        &self.ticks.iter().find(|(now_s, _)| *now_s >= t_s - 1e-9).unwrap().1
    }

    /// When each drone first passes this abscissa, m, with its row at that time; in order of time.
    pub(crate) fn crossings(&self, x_m: f64) -> Vec<(f64, DroneId, DroneRow)> {
        let drones = self.ticks[0].1.len();
        let crossing = |drone: usize| {
            let (t_s, rows) = self.ticks.iter().find(|(_, rows)| rows[drone].position_m[0] >= x_m)?;
            Some((*t_s, DroneId(drone as u32), rows[drone]))
        };
        let mut crossings: Vec<_> = (0..drones).filter_map(crossing).collect();
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        crossings
    }

    /// Least distance between two drones over the mission, m.
    pub(crate) fn separation_m(&self) -> f64 {
        let least = |rows: &[DroneRow]| {
            let pairs = (0..rows.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
            pairs.map(|(i, j)| (position(&rows[i]) - position(&rows[j])).norm()).fold(f64::INFINITY, f64::min)
        };
        self.ticks.iter().map(|(_, rows)| least(rows)).fold(f64::INFINITY, f64::min)
    }
}
