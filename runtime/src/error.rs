//! What keeps a run from being started or carried through.

use crate::pilot_problem::PilotProblem;
use skein_bus::{BusError, Version};
use skein_protocol::DroneId;
use skein_protocol::shape::ShapeError;
use skein_world::WorldError;
use skein_world::split::SplitError;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;
use thiserror::Error;

/// Why a run could not be started or carried through.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// No world can be made of the scenario.
    #[error("the scenario makes no world: {0}")]
    Scenario(#[from] WorldError),
    /// An obstacle of the scenario has an impossible shape.
    #[error("the scenario makes no world: {0}")]
    Shape(ShapeError),
    /// The world cannot be divided.
    #[error("the world is not divided: {0}")]
    Split(#[from] SplitError),
    /// The pilots of the scenario cannot fly it.
    #[error(transparent)]
    Pilot(#[from] PilotProblem),
    /// Shared memory, a service or the barrier failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The launcher ended before its child process was set up.
    #[error("expected the launcher as parent process, but process {pid} has ended")]
    LauncherGone {
        /// Process id of the launcher.
        pid: u32,
    },
    /// The scenario file of a run's domain holds something else.
    #[error("{}: expected the resolved scenario of a run, as this version writes it: {source}", path.display())]
    ScenarioFile {
        /// The file.
        path: PathBuf,
        /// Where it differs.
        source: serde_json::Error,
    },
    /// A program is built with another version of Skein.
    #[error(
        "{process}: {program} is built with {found}, expected {}, which this program is built with; build it again with this \
         version (a program in Python: install this version of the module skein)",
        Version::OWN
    )]
    OtherVersion {
        /// Which process, and which pilot it should fly, in words.
        process: String,
        /// The program.
        program: String,
        /// The version that it is built with.
        found: Version,
    },
    /// A process ended before the first tick.
    #[error("{process} ended before the first tick: {status}")]
    EndedEarly {
        /// Which process, in words.
        process: String,
        /// How it ended.
        status: ExitStatus,
    },
    /// Processes took too long to get ready.
    #[error("only {ready} of {drones} drones were ready after {waited:.0?}")]
    NotReady {
        /// Drones that were ready; those after the first one that was not do not count.
        ready: usize,
        /// Drones of the swarm.
        drones: usize,
        /// How long the launcher waited.
        waited: Duration,
    },
    /// The caller's `Launch::on_ready` failed.
    #[error("{0}")]
    OnReady(Box<dyn std::error::Error + Send + Sync>),
    /// A drone got no new process.
    #[error("drone {drone} was not started again: expected a process of incarnation {incarnation} to be ready")]
    NotRestarted {
        /// The drone.
        drone: DroneId,
        /// The incarnation that the new process should have.
        incarnation: u32,
    },
    /// The launcher does not take the record.
    #[error("the launcher has taken no record for {waited:.0?}; is the disk of the run's folder stuck?")]
    RecordNotTaken {
        /// How long the world waited.
        waited: Duration,
    },
    /// Frames are missing.
    #[error("uplink shard {shard}: expected all frames that its drones announced, but some did not arrive")]
    MissingFrames {
        /// The shard of the uplink.
        shard: usize,
    },
    /// A file or a system call failed.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: String,
        /// The error of the operating system.
        source: std::io::Error,
    },
}

impl RuntimeError {
    /// Makes an error of the operating system an error while doing `what`.
    pub fn system(what: impl Into<String>) -> impl FnOnce(std::io::Error) -> Self {
        let what = what.into();
        move |source| Self::System { what, source }
    }
}
