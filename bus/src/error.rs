//! Errors of the bus.

use crate::file_limit;
use crate::version::Version;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why the bus failed, where, and what to try.
#[derive(Debug, Error)]
pub enum BusError {
    /// The operating system refused a file operation.
    #[error("cannot {what} {}: {source}{}", path.display(), file_limit::hint(source))]
    Io {
        /// What was tried, as a verb.
        what: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A folder of the domain is not what it must be.
    #[error("{} cannot hold a run: {why}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What was expected of it.
        why: String,
    },
    /// The control segment is not what it must be.
    #[error("control segment: {0}")]
    Control(String),
    /// The run is that of a launcher of another version.
    #[error(
        "this program is built with {own}, but the launcher that started it with {launcher}; build both with the same version"
    )]
    Version {
        /// The version of this program.
        own: Version,
        /// The version of the launcher.
        launcher: Version,
    },
    /// The operating system refused a call that has no path.
    #[error("cannot {what}: {source}{}", file_limit::hint(source))]
    System {
        /// What was tried, as a verb.
        what: &'static str,
        /// The system's error.
        source: io::Error,
    },
    /// A node, service or port could not be made or opened.
    #[error("cannot {what} `{service}`: {cause}; {hint}")]
    Service {
        /// What was tried: a verb and a kind of port.
        what: &'static str,
        /// Name of the service or node.
        service: String,
        /// iceoryx2's error.
        cause: String,
        /// What to try.
        hint: &'static str,
    },
    /// A run has no place for another observer.
    #[error(
        "the run has {most} observers, and no place for another: end one of them (`skein view`, `skein top`, `skein topic`, `skein share`)"
    )]
    Crowded {
        /// Maximum number of observers at a time.
        most: usize,
    },
    /// A sample could not be loaned, sent or received.
    #[error("cannot {what} on `{service}`: {cause}; {hint}")]
    Transfer {
        /// What was tried, as a verb.
        what: &'static str,
        /// Name of the service.
        service: String,
        /// iceoryx2's error.
        cause: String,
        /// What to try.
        hint: &'static str,
    },
    /// A port lost its connection to another port or never had one, so that samples would be lost silently. Every later call
    /// on the port fails, too.
    #[error(
        "a connection of `{service}` could not be made or is corrupted, samples are lost; raise the limits of open files (`ulimit -n`) and file sizes (`ulimit -f`), or free space in /dev/shm"
    )]
    Degraded {
        /// Name of the service.
        service: String,
    },
    /// The receiver has not drained its buffer.
    #[error("the buffer of `{service}` is full: its reader does not drain it")]
    Full {
        /// Name of the service.
        service: String,
    },
    /// Shared memory is too full.
    #[error(
        "shared memory is full: {needed} more bytes are needed in /dev/shm, {free} are free; `skein clean` removes what dead runs left behind, `mount -o remount,size=` makes it larger"
    )]
    NoRoom {
        /// Bytes that are needed beside those that the run has.
        needed: u64,
        /// Bytes that are free.
        free: u64,
    },
    /// The other side did not answer.
    #[error("no answer within {limit_s} s: {what}")]
    NoAnswer {
        /// What was requested.
        what: String,
        /// Time waited, s.
        limit_s: f64,
    },
}

impl BusError {
    /// For `map_err` on file operations.
    pub(crate) fn io<E: Into<io::Error>>(what: &'static str, path: &Path) -> impl FnOnce(E) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { what, path, source: source.into() }
    }

    /// For `map_err` on system calls without a path.
    pub(crate) fn system<E: Into<io::Error>>(what: &'static str) -> impl FnOnce(E) -> Self {
        move |source| Self::System { what, source: source.into() }
    }
}
