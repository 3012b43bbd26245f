//! What can go wrong with a run's folder.

use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a run's folder cannot be made, written or read.
#[derive(Debug, Error)]
pub enum ReportError {
    /// The folder is there already.
    #[error("{0} exists already; another --out, or --force to replace the run in it")]
    Exists(PathBuf),
    /// Something that is not a run is there.
    #[error("{0} is not a run's folder (it holds no manifest.json of a run): it is left untouched")]
    NotARun(PathBuf),
    /// The file system refused.
    #[error("{path}: {source}")]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file holds something else than it should.
    #[error("{path}: expected {expected}: {found}")]
    Content {
        /// Which file.
        path: PathBuf,
        /// What should be there.
        expected: &'static str,
        /// What is there, and where.
        found: String,
    },
    /// A recording cannot be written or read.
    #[error("{path}: {source}")]
    Recording {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: mcap::McapError,
    },
    /// A plot cannot be drawn.
    #[error("{path}: cannot be drawn: {reason}")]
    Plot {
        /// Which file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl ReportError {
    /// For `map_err`: an I/O error at `path`.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
    /// For `map_err`: an error with the recording at `path`.
    pub(crate) fn recording(path: &Path) -> impl FnOnce(mcap::McapError) -> Self + use<> {
        let path = path.to_owned();
        move |source| Self::Recording { path, source }
    }
}
