//! How a run in processes is started.

use crate::clock::Clock;
use crate::host_share::HostShare;
use crate::program::Program;
use crate::tuning::HUNG_AFTER;
use skein_bus::{PinMode, WaitMode};
use skein_scenario::Scenario;
use std::time::Duration;

/// Default of [`Launch::patience`].
pub const PATIENCE: Duration = HUNG_AFTER;

/// How a run in processes is started.
pub struct Launch<'a> {
    /// What is flown.
    pub scenario: &'a Scenario,
    /// What paces the ticks.
    pub clock: Clock,
    /// Whether each process stays on one core.
    pub pin: PinMode,
    /// How processes wait for each other.
    pub wait: WaitMode,
    /// In lockstep, a drone that does not answer a tick for this long is given up: [`PATIENCE`] by default.
    pub patience: Duration,
    /// Drones per process, from 1. With more than one, no fault of the scenario may end or stop a process.
    pub per_process: u32,
    /// The program with the roles `world` and `drone`. Drones whose pilot is a program of its own are started from that one.
    pub program: &'a Program,
    /// The drones that fly on other machines. All others fly on this one.
    pub hosts: &'a [HostShare],
    /// Called with all processes of the run when they are ready and before the first tick. Called again, with the ended
    /// processes included, when a drone got a new process. An error of the first call ends the run with
    /// `RuntimeError::OnReady`.
    pub on_ready: &'a mut OnReady<'a>,
    /// Called about once per millisecond. It returns the number of a signal that should stop the run.
    pub interrupted: &'a mut dyn FnMut() -> Option<i32>,
}

/// Receives the processes of a run.
pub type OnReady<'a> = dyn FnMut(&[ProcessInfo]) -> Result<(), Box<dyn std::error::Error + Send + Sync>> + 'a;

/// What a process is in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessRole {
    /// Starts the others and records.
    Launcher,
    /// Owns the physics and the channel.
    World,
    /// Flies a drone, or several.
    Drone,
}

/// A process of a run. A process with several drones is listed once per drone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProcessInfo {
    /// What it is.
    pub role: ProcessRole,
    /// The drone's number; `None` for the other roles.
    pub id: Option<u32>,
    /// Its process id.
    pub pid: u32,
}
