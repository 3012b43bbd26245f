//! The forest mission, recorded: what figures and the times of the paper's story are taken from.

use super::flight::Flight;
use super::flights::PAPER;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::run::write_manifest;
use skein_protocol::record::Outcome;
use skein_report::deviation::{self, ShapeDeviation};
use skein_report::plot::reproduce::Snapshots;
use skein_report::{Recorder, RunCompletion, RunFacts, RunFolder, Summary, plot};
use skein_runtime::inline;
use skein_runtime::run_facts::run_facts;
use std::path::Path;

/// Moments of the paper's snapshots, s; the last is the mission's end.
pub const MOMENTS_S: [f64; 5] = [0.0, 25.0, 50.0, 70.0, f64::INFINITY];
/// The place among them at which the paper speaks of four subgroups.
pub const FOUR_GROUPS: usize = 3;

/// The recorded mission.
pub struct Forest {
    /// As ordered.
    pub facts: RunFacts,
    /// What came of it.
    pub summary: Summary,
    /// Moments of it.
    pub snapshots: Snapshots,
    /// How far the swarm was from its shape, over time.
    pub deviations: Vec<ShapeDeviation>,
    /// File names and SVGs of a run's plots.
    pub plots: Vec<(String, String)>,
}

impl Forest {
    /// Flies it with the paper's rule and records it in this folder, which may hold an earlier recording.
    pub fn record(path: &Path, interrupt: &Interrupt) -> Result<Self, Failure> {
        let scenario = Flight::new("forest", PAPER).resolve().map_err(Failure::environment)?;
        let facts = run_facts(&scenario, "inline", "lockstep").map_err(Failure::usage)?;
        let folder = RunFolder::at(path, true).map_err(Failure::usage)?;
        let manifest = write_manifest(&folder, &facts, &scenario)?;
        let mut recorder =
            Recorder::in_folder(facts.clone(), &folder, &manifest.scenario).map_err(Failure::environment)?;
        let end = inline::run(&scenario, &mut recorder, || interrupt.signal()).map_err(Failure::environment)?;
        let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
        let (summary, recorded) = recorder.finish(&completion);
        recorded.map_err(Failure::environment)?;
        if let Some(error) = end.sink_error {
            return Err(Failure::environment(error));
        }
        folder.write_summary(&summary).map_err(Failure::environment)?;
        let mut plots = Vec::new();
        for path in plot::write(&folder, &facts).map_err(Failure::environment)? {
            let svg = std::fs::read_to_string(&path);
            let svg = svg.map_err(|error| Failure::environment(format!("{}: {error}", path.display())))?;
            plots.push((path.file_name().unwrap_or_default().to_string_lossy().into_owned(), svg));
        }
        let snapshots = Snapshots::read(&folder, &MOMENTS_S).map_err(Failure::environment)?;
        let deviations = deviation::read(folder.path()).map_err(Failure::environment)?;
        Ok(Self { facts, summary, snapshots, deviations, plots })
    }

    /// The moment of the greatest disturbance between these times, s.
    pub fn disturbance(&self, from_s: f64, to_s: f64) -> Option<&ShapeDeviation> {
        let then = self.deviations.iter().filter(|deviation| (from_s..=to_s).contains(&deviation.t_s));
        then.max_by(|a, b| a.disturbance_m.total_cmp(&b.disturbance_m))
    }
}
