//! What can go wrong with a run's record and folder.

use crate::table::TableError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a run's folder cannot be made, written or read.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The folder exists already.
    #[error("{0} exists already; name another folder with --out, or replace the run in it with --force")]
    Exists(PathBuf),
    /// The folder holds something that is not a run.
    #[error("{0} is not the folder of a run (it has no manifest.json of a run); nothing in it was changed")]
    NotARun(PathBuf),
    /// The run was recorded, but its summary was not written.
    #[error("{0}: the run in it has no summary: it still flies, or it was killed; `skein report` then writes one")]
    NoSummary(PathBuf),
    /// Another process writes to the folder.
    #[error("{0}: another process is at work in this folder; wait for its end, or name another folder")]
    InUse(PathBuf),
    /// The folder belongs to another user, who could lead files anywhere.
    #[error("{path}: belongs to user {owner}; expected a folder of your own")]
    Foreign {
        /// The folder, or the link to it.
        path: PathBuf,
        /// Its owner.
        owner: u32,
    },
    /// The recording of a large swarm does not list its frames.
    #[error("the frames of {drones} drones are not recorded; expected a run of at most {most} drones")]
    NotListed {
        /// Number of drones.
        drones: u32,
        /// Largest number of drones whose frames are recorded.
        most: usize,
    },
    /// Parquet is wanted from a program that cannot write it.
    #[error(transparent)]
    NoParquet(TableError),
    /// A signal came in while files were written.
    #[error("interrupted while the files of the run were written")]
    Interrupted,
    /// An operation of the file system failed.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system reported.
        source: std::io::Error,
    },
    /// The content of a file is not what it should be.
    #[error("{path}: expected {expected}: {found}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What the file should contain.
        expected: &'static str,
        /// What it contains, and where.
        found: String,
    },
    /// run.mcap cannot be written or read.
    #[error("{path}: {source}")]
    Recording {
        /// The file.
        path: PathBuf,
        /// What the MCAP library reported.
        source: mcap::McapError,
    },
    /// A plot cannot be drawn.
    #[error("{path}: {source}")]
    Plot {
        /// The file that was to hold the plot.
        path: PathBuf,
        /// Why.
        source: DrawError,
    },
}

impl ReportError {
    /// Whether the caller's input is at fault (exit code 2), not the environment (exit code 3).
    #[must_use]
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Exists(_) | Self::NotARun(_) | Self::NoSummary(_) | Self::InUse(_) | Self::NoParquet(_) => true,
            Self::Foreign { .. } | Self::Content { .. } | Self::NotListed { .. } => true,
            Self::Interrupted | Self::Io { .. } | Self::Recording { .. } | Self::Plot { .. } => false,
        }
    }

    /// For `map_err`: an I/O error at `path`.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    /// For `map_err`: an error in the recording at `path`.
    pub(crate) fn recording(path: &Path) -> impl FnOnce(mcap::McapError) -> Self + use<> {
        let path = path.to_owned();
        move |source| Self::Recording { path, source }
    }
}

/// Why a plot cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the plot cannot be drawn: {reason}")]
pub struct DrawError {
    /// What the SVG backend reported.
    reason: String,
}

impl DrawError {
    /// For `map_err`: an error of the SVG backend, whose type depends on the backend.
    pub(crate) fn new(error: impl std::error::Error) -> Self {
        Self { reason: error.to_string() }
    }
}

/// Why the record of a tick cannot be used.
#[derive(Debug, Error)]
pub(crate) enum TickError {
    /// The record does not have one row per drone.
    #[error("tick {tick}: expected a record of {expected} rows, one per drone, found {found}")]
    Rows {
        /// The tick of the record.
        tick: u64,
        /// Number of drones of the run.
        expected: usize,
        /// Number of rows of the record.
        found: usize,
    },
    /// A line of the record's events is not an event.
    #[error("tick {tick}: expected an event as JSON: {source}")]
    Event {
        /// The tick of the record.
        tick: u64,
        /// What the JSON parser reported.
        source: serde_json::Error,
    },
}
