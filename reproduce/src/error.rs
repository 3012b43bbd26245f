//! What can go wrong with the reproduction.

use skein_report::{DrawError, ReportError};
use skein_runtime::RuntimeError;
use skein_scenario::ScenarioErrors;
use skein_sweep::FlightError;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the report could not be made.
#[derive(Debug, Error)]
pub enum ReproduceError {
    /// The folder exists already.
    #[error("{}: exists already; name another --out, or use --force", .0.display())]
    Exists(PathBuf),
    /// The folder is not a report's.
    #[error("{}: is not the folder of a report; --force does not replace it", .0.display())]
    NotAReport(PathBuf),
    /// The folder for the forest mission cannot be used.
    #[error(transparent)]
    Folder(ReportError),
    /// A flight's scenario is not valid.
    #[error(transparent)]
    Mission(#[from] MissionError),
    /// A flight could not be flown.
    #[error("{command}: {source}")]
    Flight {
        /// The command that repeats the flight.
        command: String,
        /// Why it could not be flown.
        source: FlightError,
    },
    /// The forest mission could not be flown.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// The forest mission could not be recorded, or its recording not be read.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The record of the forest mission could not be evaluated.
    #[error("the forest mission could not be recorded: {0}")]
    Record(String),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The rows cannot be written as JSON.
    #[error("the report cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
}

impl ReproduceError {
    /// Whether the caller's input is at fault (exit code 2), not the environment (exit code 3).
    #[must_use]
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Exists(_) | Self::NotAReport(_) => true,
            Self::Folder(error) => error.is_usage(),
            _ => false,
        }
    }

    /// For `map_err`: an I/O error at `path`.
    pub(crate) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

/// Why a mission has no valid scenario.
#[derive(Debug, Error)]
pub enum MissionError {
    /// The program contains no scenario of this name.
    #[error("expected the name of a scenario of the paper, found {0:?}")]
    Unknown(String),
    /// The scenario does not parse with the flight's changes.
    #[error(transparent)]
    Scenario(#[from] ScenarioErrors),
}
