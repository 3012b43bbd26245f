//! The recorded forest mission. Figures and the times of R5 are taken from it.

use crate::cases::PAPER;
use crate::error::ReproduceError;
use crate::flight::Flight;
use crate::recording::Recording;
use skein_report::deviation::{self, ShapeDeviation};
use skein_report::plot::reproduce::Snapshots;
use skein_report::{RunFacts, RunFolder, Summary, plot};
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
        let Recording { facts, summary, folder } = Recording::make(path, &Flight::new("forest", PAPER), interrupted)?;
        let stop = || interrupted().is_some();
        let stop = skein_report::Interrupted::when(&stop);
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
