//! What came of the flights.

use super::flight::{Flight, JITTER_M};
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::sweep::command::progress_bar;
use crate::sweep::fly::fly_inline;
use crate::sweep::pool::side_by_side;
use skein_protocol::record::Outcome;
use skein_report::Summary;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The summaries, by flight.
pub struct Results(BTreeMap<Flight, Summary>);

impl Results {
    /// Flies them side by side; `None` if interrupted.
    pub fn fly(
        flights: &[Flight],
        workers: usize,
        quiet: bool,
        interrupt: &Interrupt,
    ) -> Result<Option<Self>, Failure> {
        let bar = progress_bar(quiet, flights.len(), 0);
        let mut summaries = BTreeMap::new();
        let jobs: Vec<usize> = (0..flights.len()).collect();
        let work = |job: usize| {
            let flown = flights[job].resolve().and_then(|scenario| fly_inline(&scenario, interrupt));
            interrupt.signal().is_none().then_some((job, flown))
        };
        let ended = side_by_side(
            &jobs,
            workers.min(jobs.len()),
            |_| {},
            work,
            |done| {
                bar.tick();
                let Some((job, flown)) = done else { return Ok(()) };
                let summary = flown.map_err(|error| format!("{}: {error}", flights[job].command()))?;
                summaries.insert(flights[job].clone(), summary);
                bar.inc(1);
                Ok::<(), String>(())
            },
        );
        bar.finish_and_clear();
        ended.map_err(Failure::environment)?;
        Ok(interrupt.signal().is_none().then_some(Self(summaries)))
    }

    /// Of a flight that reached its goal.
    pub fn reached(&self, flight: &Flight) -> Option<&Summary> {
        self.0.get(flight).filter(|summary| summary.outcome == Outcome::Reached)
    }

    /// Of a flight, whatever became of it.
    pub fn get(&self, flight: &Flight) -> Option<&Summary> {
        self.0.get(flight)
    }

    /// Flights that did not reach their goal.
    pub fn failed(&self) -> impl Iterator<Item = (&Flight, &Summary)> {
        self.0.iter().filter(|(_, summary)| summary.outcome != Outcome::Reached)
    }

    /// Number of flights.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// A line a flight; what does not apply is empty, what differs by obstacle set is separated by spaces.
    pub fn csv(&self) -> String {
        let mut csv = "scenario,strategy,seed,start_jitter_m,outcome,pass_times_s,splits_rightmost_first,predicted_s,\
                       mission_s,energy_total_j,energy_until_passed_j,energy_detection_to_pass_j,min_separation_m,\
                       min_clearance_m,formation_error_m,mean_distance_error_m,digest,command\n"
            .to_owned();
        for (flight, summary) in &self.0 {
            let jitter = flight.seed.map_or(0.0, |_| JITTER_M);
            let outcome = serde_json::to_value(summary.outcome).unwrap_or_default();
            let stages = |text: fn(&skein_report::Stage) -> String| {
                summary.stages.iter().map(text).collect::<Vec<String>>().join(" ")
            };
            // Writing to a string cannot fail.
            let _ = writeln!(
                csv,
                "{},{},{},{jitter},{},{},{},{},{},{},{},{},{},{},{},{},{},\"{}\"",
                flight.scenario,
                flight.strategy,
                summary.seed,
                outcome.as_str().unwrap_or_default(),
                stages(|stage| field(stage.pass_time_s)),
                stages(|stage| split(stage.split.as_deref())),
                stages(|stage| field(stage.predicted_s)),
                field(Some(summary.mission_s)),
                field(Some(summary.energy_j.total)),
                field(summary.energy_j.until_passed),
                field(summary.energy_j.detection_to_pass),
                field(summary.min_separation_m),
                field(summary.min_clearance_m),
                field(summary.formation_error_m),
                field(summary.mean_distance_error_m),
                summary.digest.as_deref().unwrap_or_default(),
                flight.command(),
            );
        }
        csv
    }
}

/// A number of a CSV, empty if there is none.
pub fn field(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.4}"))
}

/// Drones for each route, such as `6/2`.
pub fn split(drones: Option<&[u32]>) -> String {
    let counts: Vec<String> = drones.unwrap_or_default().iter().map(u32::to_string).collect();
    counts.join("/")
}
