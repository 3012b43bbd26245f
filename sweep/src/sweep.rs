//! A sweep: flies the runs of a grid side by side, in memory or in a folder from which it can be resumed.

use crate::error::SweepError;
use crate::experiment::{Experiment, Mission};
use crate::flight::{FlightMode, Interrupted, fly};
use crate::grid::Grid;
use crate::missions::Missions;
use crate::report::SweepReport;
use crate::row::Row;
use crate::shard::Shard;
use crate::store::{Identity, Store};
use crate::worker_pool::WorkerPool;
use skein_bus::{PinMode, pin_to_core};
use skein_protocol::digest::Digest;
use skein_runtime::PilotRegistry;
use std::path::Path;

/// How far a sweep is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Runs that are done, those of an earlier sweep in the same folder included.
    pub done: usize,
    /// All runs; those of the shard, if only a shard is flown.
    pub runs: usize,
}

/// How a sweep ended.
#[derive(Debug)]
pub enum SweepEnd<'a> {
    /// All runs are done.
    Complete(SweepReport<'a>),
    /// All runs of the shard are done. The results of all shards can be merged: [`crate::Shards`].
    Shard(Progress),
    /// It was interrupted before all runs were done.
    Interrupted(Progress),
}

impl<'a> SweepEnd<'a> {
    /// The results, if all runs are done.
    #[must_use]
    pub fn complete(self) -> Option<SweepReport<'a>> {
        match self {
            Self::Complete(report) => Some(report),
            Self::Shard(_) | Self::Interrupted(_) => None,
        }
    }
}

/// A sweep over a grid, with its settings.
pub struct Sweep<'g, 'c> {
    grid: &'g Grid<'g>,
    workers: usize,
    shard: Option<Shard>,
    parquet: bool,
    pilots: &'g PilotRegistry,
    interrupted: &'c Interrupted<'c>,
    progress: Box<dyn FnMut(Progress) + 'c>,
}

impl<'g, 'c> Sweep<'g, 'c> {
    /// A sweep of these pilots with as many workers as there are cores, which reports no progress and cannot be interrupted. Runs of
    /// processes are flown by the command `run` of the pilots' program.
    #[must_use]
    pub fn new(grid: &'g Grid<'g>, pilots: &'g PilotRegistry) -> Self {
        let workers = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Self { grid, workers, shard: None, parquet: false, pilots, interrupted: &|| None, progress: Box::new(|_| {}) }
    }

    /// Flies this many runs side by side.
    #[must_use]
    pub fn workers(self, workers: usize) -> Self {
        Self { workers, ..self }
    }

    /// Flies the runs of this shard alone. In a folder, nothing but their rows is written.
    #[must_use]
    pub fn shard(self, shard: Shard) -> Self {
        Self { shard: Some(shard), ..self }
    }

    /// Writes the table of runs as Parquet as well.
    #[must_use]
    pub fn parquet(self, parquet: bool) -> Self {
        Self { parquet, ..self }
    }

    /// Stops as soon as this returns the number of a signal.
    #[must_use]
    pub fn interrupted(self, interrupted: &'c Interrupted<'c>) -> Self {
        Self { interrupted, ..self }
    }

    /// Calls this at the beginning, after each run, and several times a second in between.
    #[must_use]
    pub fn progress(self, progress: impl FnMut(Progress) + 'c) -> Self {
        Self { progress: Box::new(progress), ..self }
    }

    /// Flies all runs inline and writes nothing, whatever runtime the experiment asks for.
    ///
    /// # Errors
    /// [`SweepError::Scenario`] if a combination of the grid is not a valid scenario. Nothing is flown then.
    pub fn run_in_memory(mut self) -> Result<SweepEnd<'g>, SweepError> {
        self.grid.check(self.pilots, true)?;
        let mut rows = Vec::new();
        self.fly_missing(&FlightMode::Inline, &mut rows, |_| Ok(()))?;
        self.end(rows)
    }

    /// Flies the runs that the folder does not hold yet. Once all are done, writes `runs.csv`, `summary.json`, the plots, and
    /// `runs.parquet` if it is wanted. The folder is made if it does not exist.
    ///
    /// # Errors
    /// [`SweepError`]. If it is a usage error, nothing was flown.
    pub fn run_in_folder(mut self, folder: &Path) -> Result<SweepEnd<'g>, SweepError> {
        self.grid.check(self.pilots, !self.grid.experiment().processes)?;
        let (mut store, mut rows) = Store::open(folder, &Identity { shard: self.shard, ..identity(self.grid) })?;
        if self.shard.is_some() {
            let (experiment, overrides) = (self.grid.experiment().clone(), self.grid.overrides().to_vec());
            let program = self.grid.program_name().to_owned();
            store.keep_missions(&Missions { experiment, overrides, program })?;
        }
        let flights = folder.join("flights");
        // Left behind by a sweep that was killed.
        let _ = std::fs::remove_dir_all(&flights);
        let mode = self.mode(&flights);
        let ended = self.fly_missing(&mode, &mut rows, |row| store.keep(row));
        // Empty by now.
        let _ = std::fs::remove_dir_all(flights);
        ended?;
        let end = self.end(rows)?;
        if let SweepEnd::Complete(report) = &end {
            write(&store, report, self.parquet)?;
        }
        Ok(end)
    }

    fn mode(&self, flights: &Path) -> FlightMode {
        if self.grid.experiment().processes {
            FlightMode::Processes { folder: flights.join(std::process::id().to_string()) }
        } else {
            FlightMode::Inline
        }
    }

    fn fly_missing(
        &mut self,
        mode: &FlightMode,
        rows: &mut Vec<Row>,
        mut keep: impl FnMut(&Row) -> Result<(), SweepError>,
    ) -> Result<(), SweepError> {
        let (grid, pilots, interrupted, runs) = (self.grid, self.pilots, self.interrupted, self.runs());
        let mut done = vec![false; grid.len()];
        for row in &*rows {
            done[row.job] = true;
        }
        let wanted = |job: &usize| self.shard.is_none_or(|shard| shard.holds(*job));
        let missing: Vec<usize> = (0..grid.len()).filter(wanted).filter(|&job| !done[job]).collect();
        (self.progress)(Progress { done: rows.len(), runs });
        let pin = |worker| {
            if let FlightMode::Processes { .. } = mode {
                // The swarm inherits the core. If pinning fails, it is only slower.
                let _ = pin_to_core(worker, PinMode::Auto);
            }
        };
        let pool = WorkerPool { jobs: &missing, workers: self.workers.min(missing.len()) };
        pool.run_with(
            pin,
            |job| fly(grid, job, mode, pilots, interrupted),
            |row| {
                if let Some(row) = row {
                    keep(&row)?;
                    rows.push(row);
                }
                (self.progress)(Progress { done: rows.len(), runs });
                Ok(())
            },
        )
    }

    /// Number of runs to fly.
    fn runs(&self) -> usize {
        self.shard.map_or(self.grid.len(), |shard| shard.len(self.grid.len()))
    }

    fn end(&self, rows: Vec<Row>) -> Result<SweepEnd<'g>, SweepError> {
        let progress = Progress { done: rows.len(), runs: self.runs() };
        if progress.done == progress.runs && self.shard.is_some() {
            Ok(SweepEnd::Shard(progress))
        } else if progress.done == progress.runs {
            Ok(SweepEnd::Complete(SweepReport::new(self.grid, rows)))
        } else if (self.interrupted)().is_some() {
            Ok(SweepEnd::Interrupted(progress))
        } else {
            Err(SweepError::Incomplete { done: progress.done, runs: progress.runs })
        }
    }
}

/// The identity of a grid's sweep. It hashes texts, not paths or places, so that a sweep may be resumed from another folder. It
/// leaves out the metrics, which only choose what is shown.
pub(crate) fn identity(grid: &Grid<'_>) -> Identity {
    let mut digest = Digest::default();
    let mut fold = |text: &str| {
        digest.word(text.len() as u64).bytes(text.as_bytes());
    };
    let Experiment { strategies, seeds, grid: axes, processes, bounds, .. } = grid.experiment();
    let overrides = grid.overrides();
    let axes: Vec<_> = axes.iter().map(|axis| (&axis.key, &axis.values)).collect();
    fold(&format!("{strategies:?} {seeds:?} {axes:?} {processes} {bounds:?} {overrides:?}"));
    for mission in &grid.experiment().scenarios {
        match mission {
            Mission::Random => fold("random"),
            Mission::Wide => fold("wide"),
            Mission::File { text, .. } => fold(text),
        }
    }
    fold(env!("CARGO_PKG_VERSION"));
    fold(option_env!("SKEIN_COMMIT").unwrap_or_default());
    Identity {
        schema: "skein-sweep-experiment/1".to_owned(),
        name: grid.experiment().name.clone(),
        hash: format!("{:016x}", digest.value()),
        runs: grid.len(),
        shard: None,
    }
}

/// Writes the results of a complete sweep into its folder.
pub(crate) fn write(store: &Store, report: &SweepReport<'_>, parquet: bool) -> Result<(), SweepError> {
    store.arrange(report.rows())?;
    let folder = store.folder();
    folder.write("runs.csv", &report.csv())?;
    folder.write("summary.json", &serde_json::to_vec_pretty(&report.summary())?)?;
    let plots = folder.subfolder("plots")?;
    for plot in report.plots()? {
        plots.write(&plot.file, plot.svg.as_bytes())?;
    }
    if let Some(csv) = report.ratios_csv() {
        folder.write("ratios.csv", csv.as_bytes())?;
    }
    if parquet {
        folder.write("runs.parquet", &report.parquet()?)?;
    }
    Ok(())
}
