//! The recorded forest mission. Figures and the times of R5 are taken from it.

use crate::cases::PAPER;
use crate::error::ReproduceError;
use crate::flight::Flight;
use skein_protocol::record::Outcome;
use skein_report::deviation::{self, ShapeDeviation};
use skein_report::plot::reproduce::Snapshots;
use skein_report::{Manifest, Recorder, RunCompletion, RunFacts, RunFolder, Summary, plot};
use skein_runtime::run_facts::run_facts;
use skein_runtime::{PilotRegistry, RuntimeError, inline};
use skein_sweep::Interrupted;
use std::path::{Path, PathBuf};

/// Times of the paper's snapshots, s. The last is the mission's end.
pub(crate) const MOMENTS_S: [f64; 5] = [0.0, 25.0, 50.0, 70.0, f64::INFINITY];
/// Index of the snapshot at which the paper describes four subgroups.
pub(crate) const FOUR_GROUPS: usize = 3;

/// A plot of the run.
pub(crate) struct NamedPlot {
    /// Name of its file.
    pub(crate) file: String,
    /// The drawing.
    pub(crate) svg: String,
}

/// The recorded mission.
pub(crate) struct Forest {
    /// What was flown.
    pub(crate) facts: RunFacts,
    /// Its summary.
    pub(crate) summary: Summary,
    /// Its snapshots at these times.
    pub(crate) snapshots: Snapshots,
    /// Distance of the swarm from its target shape, over time.
    pub(crate) deviations: Vec<ShapeDeviation>,
    /// The plots of the run.
    pub(crate) plots: Vec<NamedPlot>,
}

impl Forest {
    /// Flies the mission with the paper's rule and records it in this folder, which may hold an earlier recording.
    pub(crate) fn record(path: &Path, interrupted: &Interrupted<'_>) -> Result<Self, ReproduceError> {
        let scenario = Flight::new("forest", PAPER).resolve()?;
        let facts = run_facts(&scenario, "inline", "lockstep").map_err(RuntimeError::Shape)?;
        let folder = RunFolder::at(path, true).map_err(ReproduceError::Folder)?;
        let commit = option_env!("SKEIN_COMMIT").map(str::to_owned);
        let resolved = serde_json::to_value(&scenario)?;
        let manifest = Manifest::new(facts.clone(), resolved, env!("CARGO_PKG_VERSION"), commit);
        folder.begin(&manifest)?;
        let mut recorder = Recorder::in_folder(facts.clone(), &folder)?;
        let end = inline::run(&scenario, &PilotRegistry::built_in()?, &mut recorder, interrupted)?;
        let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
        let (summary, record) = recorder.finish(&completion);
        folder.write_summary(&summary)?;
        let stop = || interrupted().is_some();
        let stop = skein_report::Interrupted::when(&stop);
        if let Some(record) = record {
            record.write_files(&manifest, &stop)?;
            record.remove()?;
        }
        if let Some(error) = end.sink_error {
            return Err(ReproduceError::Record(error.to_string()));
        }
        let plots = plots(&folder, &facts, &stop)?;
        let snapshots = Snapshots::read(&folder, &MOMENTS_S)?;
        let deviations = deviation::read(&folder)?;
        Ok(Self { facts, summary, snapshots, deviations, plots })
    }

    /// The greatest disturbance between these times, s.
    pub(crate) fn disturbance(&self, from_s: f64, to_s: f64) -> Option<&ShapeDeviation> {
        let then = self.deviations.iter().filter(|deviation| (from_s..=to_s).contains(&deviation.t_s));
        then.max_by(|a, b| a.disturbance_m.total_cmp(&b.disturbance_m))
    }
}

fn plots(
    folder: &RunFolder,
    facts: &RunFacts,
    stop: &skein_report::Interrupted<'_>,
) -> Result<Vec<NamedPlot>, ReproduceError> {
    let read = |path: PathBuf| {
        let svg = std::fs::read_to_string(&path).map_err(ReproduceError::io(&path))?;
        Ok(NamedPlot { file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(), svg })
    };
    plot::write(folder, facts, stop)?.into_iter().map(read).collect()
}
