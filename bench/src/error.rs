//! What can go wrong in a benchmark.

use skein_bus::BusError;
use skein_leader::split::SplitError;
use skein_report::DrawError;
use skein_runtime::RuntimeError;
use skein_scenario::ScenarioErrors;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a benchmark could not be carried through.
#[derive(Debug, Error)]
pub enum BenchError {
    /// The benchmark's scenario is not valid, for example because of the number of drones.
    #[error(transparent)]
    Scenario(#[from] ScenarioErrors),
    /// No chosen case can be measured with this number of drones.
    #[error("--cases: none of these cases can be measured with {drones} drones")]
    NoCase {
        /// Size of the swarm.
        drones: u32,
    },
    /// A peer process got neither a segment nor a folder of sockets.
    #[error("expected --segment or --sockets")]
    NoTransport,
    /// The runtime failed.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// Shared memory or a system limit failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A flight was flown, but something failed meanwhile.
    #[error("the flight failed: {0}")]
    Flight(String),
    /// A flight in another process gave no summary.
    #[error("{flight} gave no summary: {stderr}")]
    NoSummary {
        /// Which flight.
        flight: String,
        /// What the process wrote to stderr.
        stderr: String,
    },
    /// The baseline's processes did not start in time.
    #[error("the baseline's processes did not start within {seconds} s")]
    PeersMissing {
        /// The limit, s.
        seconds: u64,
    },
    /// The system refused something.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A file cannot be written or read.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A scenario cannot be written as TOML.
    #[error("the benchmark's scenario cannot be written: {0}")]
    Toml(#[from] toml::ser::Error),
    /// The plot cannot be drawn.
    #[error(transparent)]
    Plot(#[from] DrawError),
    /// A divided world and the same one in one piece gave different digests.
    #[error("{drones} drones in {parts} parts have another digest than in one")]
    Digests {
        /// Size of the swarm.
        drones: u32,
        /// Number of parts.
        parts: usize,
    },
    /// What Skein is compared with cannot be run.
    #[error("{}: {why}; the comparison needs Python with RVO2: `pip install pyrvo` installs it where there is a wheel", python.display())]
    NoPeer {
        /// The program.
        python: PathBuf,
        /// What it said.
        why: String,
    },
    /// The table of arrival times is not valid.
    #[error("the table of arrival times: {0}")]
    Arrivals(#[from] SplitError),
}

impl BenchError {
    /// Whether the caller's input is at fault (exit code 2), not the environment (exit code 3).
    #[must_use]
    pub fn is_usage(&self) -> bool {
        use RuntimeError::{OtherVersion, Pilot};
        matches!(
            self,
            Self::Scenario(_) | Self::NoCase { .. } | Self::NoTransport | Self::Runtime(Pilot(_) | OtherVersion { .. })
        )
    }

    /// For `map_err`: an error of the system while doing `what`.
    pub(crate) fn system<E: Into<std::io::Error>>(what: &'static str) -> impl FnOnce(E) -> Self {
        move |source| Self::System { what, source: source.into() }
    }

    /// For `map_err`: an I/O error at `path`.
    pub(crate) fn file(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::File { path: path.to_owned(), source }
    }
}
