//! What keeps a run from starting.

use skein_bus::BusError;
use skein_protocol::shape::ShapeError;
use skein_world::WorldError;
use thiserror::Error;

/// Why a run could not be started or carried through.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// The scenario makes no world.
    #[error("the scenario makes no world: {0}")]
    Scenario(#[from] WorldError),
    /// An obstacle of the scenario is none.
    #[error("the scenario makes no world: {0}")]
    Shape(ShapeError),
    /// Shared memory, services or the barrier failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A process could not be started, or ended before the first tick.
    #[error("{0}")]
    Process(String),
    /// A file or a system call failed.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: String,
        /// What the system said.
        source: std::io::Error,
    },
}

impl RuntimeError {
    /// An error of the system while doing `what`.
    pub fn system(what: impl Into<String>) -> impl FnOnce(std::io::Error) -> Self {
        let what = what.into();
        move |source| Self::System { what, source }
    }
}
