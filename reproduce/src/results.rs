//! The summaries of the flights.

use crate::error::ReproduceError;
use crate::flight::{Flight, JITTER_M};
use skein_protocol::record::Outcome;
use skein_report::{Summary, text};
use skein_runtime::PilotRegistry;
use skein_sweep::{Interrupted, Progress, WorkerPool, fly_inline};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The summaries, by flight.
pub(crate) struct Results(BTreeMap<Flight, Summary>);

impl Results {
    /// Flies the missions side by side. `None` if interrupted.
    pub(crate) fn fly(
        flights: &[Flight],
        workers: usize,
        mut progress: impl FnMut(Progress),
        interrupted: &Interrupted<'_>,
    ) -> Result<Option<Self>, ReproduceError> {
        let runs = flights.len();
        progress(Progress { done: 0, runs });
        let mut summaries = BTreeMap::new();
        let jobs: Vec<usize> = (0..runs).collect();
        let pool = WorkerPool { jobs: &jobs, workers: workers.min(runs) };
        pool.run(
            |job| {
                let flown = fly_one(&flights[job], interrupted);
                interrupted().is_none().then_some((job, flown))
            },
            |done| {
                if let Some((job, flown)) = done {
                    summaries.insert(flights[job].clone(), flown?);
                }
                progress(Progress { done: summaries.len(), runs });
                Ok::<(), ReproduceError>(())
            },
        )?;
        Ok(interrupted().is_none().then_some(Self(summaries)))
    }

    /// The summary of a flight, if it reached its goal.
    pub(crate) fn reached(&self, flight: &Flight) -> Option<&Summary> {
        self.0.get(flight).filter(|summary| summary.outcome == Outcome::Reached)
    }

    /// The summary of a flight, whatever its outcome.
    pub(crate) fn get(&self, flight: &Flight) -> Option<&Summary> {
        self.0.get(flight)
    }

    /// Flights that did not reach their goal.
    pub(crate) fn failed(&self) -> impl Iterator<Item = (&Flight, &Summary)> {
        self.0.iter().filter(|(_, summary)| summary.outcome != Outcome::Reached)
    }

    /// Number of flights.
    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    /// The content of results.csv: one line for each flight. Fields that do not apply are empty. Values that differ by
    /// obstacle set are separated by spaces.
    pub(crate) fn csv(&self) -> String {
        let mut csv = "scenario,strategy,seed,start_jitter_m,outcome,pass_times_s,splits_left_to_right,predicted_s,\
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

/// Flies one mission inline.
fn fly_one(flight: &Flight, interrupted: &Interrupted<'_>) -> Result<Summary, ReproduceError> {
    let flown = fly_inline(&flight.resolve()?, &PilotRegistry::built_in()?, interrupted);
    flown.map_err(|source| ReproduceError::Flight { command: flight.command(), source })
}

/// A number as a CSV field; empty if there is none.
pub(crate) fn field(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.4}"))
}

/// The number of drones on each route from left to right, such as `6/2`; empty if there is none.
pub(crate) fn split(drones: Option<&[u32]>) -> String {
    drones.map(text::split).unwrap_or_default()
}
