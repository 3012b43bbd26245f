//! The shards of a sweep, merged into one.

use crate::error::SweepError;
use crate::grid::Grid;
use crate::missions::Missions;
use crate::report::SweepReport;
use crate::row::Row;
use crate::store::{ShardFolder, Store};
use crate::sweep::{identity, write};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Shards of one sweep, read from their folders.
#[derive(Debug)]
pub struct Shards {
    missions: Missions,
    /// The rows of all runs.
    rows: Vec<Row>,
}

impl Shards {
    /// Reads the shards in these folders. Together they must hold each run once.
    ///
    /// # Errors
    /// [`SweepError::NotAShard`], [`SweepError::OtherSweep`], [`SweepError::OtherProgram`], [`SweepError::Overlap`],
    /// [`SweepError::MissingRuns`], and what reading a folder gives. A folder is refused while a sweep writes to it.
    pub fn read(folders: &[PathBuf]) -> Result<Self, SweepError> {
        let mut merged: Option<(ShardFolder, PathBuf)> = None;
        let mut owner: Vec<Option<usize>> = Vec::new();
        for (number, path) in folders.iter().enumerate() {
            let found = ShardFolder::read(path)?;
            owner.resize(found.identity.runs, None);
            for row in &found.rows {
                if let Some(other) = owner[row.job].replace(number) {
                    let (first, second) = (folders[other].clone(), path.clone());
                    return Err(SweepError::Overlap { run: row.job, first, second });
                }
            }
            match &mut merged {
                Some((first, first_path)) if !first.identity.is_same_sweep(&found.identity) => {
                    return Err(SweepError::OtherSweep { first: first_path.clone(), second: path.clone() });
                }
                Some((first, _)) => first.rows.extend(found.rows),
                none => *none = Some((found, path.clone())),
            }
        }
        let Some((all, first)) = merged else { return Err(SweepError::NoShards) };
        let shards = Self { missions: all.missions, rows: all.rows };
        if !identity(&shards.grid()).is_same_sweep(&all.identity) {
            return Err(SweepError::OtherProgram(first));
        }
        let missing: Vec<usize> = (0..owner.len()).filter(|&job| owner[job].is_none()).collect();
        match missing.first() {
            Some(&first) => Err(SweepError::MissingRuns { missing: missing.len(), runs: owner.len(), first }),
            None => Ok(shards),
        }
    }

    /// Name of the experiment.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.missions.experiment.name
    }

    /// The runs of the whole sweep.
    #[must_use]
    pub fn grid(&self) -> Grid<'_> {
        let Missions { experiment, overrides, program } = &self.missions;
        Grid::new(experiment, overrides).program(program)
    }

    /// Writes the folder of the whole sweep: what one machine that had flown all runs would have written.
    ///
    /// # Errors
    /// [`SweepError`], if the folder cannot be used or a file not be written.
    pub fn write<'g>(&self, grid: &'g Grid<'g>, folder: &Path, parquet: bool) -> Result<SweepReport<'g>, SweepError> {
        let (mut store, kept) = Store::open(folder, &identity(grid))?;
        let mut rows = self.rows.clone();
        rows.sort_by_key(|row| row.job);
        let kept: BTreeSet<usize> = kept.iter().map(|row| row.job).collect();
        for row in rows.iter().filter(|row| !kept.contains(&row.job)) {
            store.keep(row)?;
        }
        let report = SweepReport::new(grid, rows);
        write(&store, &report, parquet)?;
        Ok(report)
    }
}
