//! The drones of one process.

use skein_protocol::{DroneId, Tick};
use std::process::Command;

/// The drones of one process: consecutive ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DroneRange {
    /// The lowest id.
    pub first: DroneId,
    /// Number of drones.
    pub count: u32,
    /// Counts the processes that have flown these drones, from 1. A restart makes it one more.
    pub incarnation: u32,
    /// The first tick that the process answers.
    pub first_tick: Tick,
}

impl DroneRange {
    /// The ids, in rising order.
    pub fn ids(&self) -> impl Iterator<Item = DroneId> + use<> {
        (self.first.0..self.first.0 + self.count).map(DroneId)
    }

    /// Whether a drone is among them.
    #[must_use]
    pub fn has(&self, drone: DroneId) -> bool {
        (self.first.0..self.first.0 + self.count).contains(&drone.0)
    }

    /// Appends the arguments that say which drones these are.
    pub(crate) fn append_to<'c>(&self, command: &'c mut Command) -> &'c mut Command {
        command.args(["--id", &self.first.to_string(), "--count", &self.count.to_string()]);
        command.args(["--incarnation", &self.incarnation.to_string(), "--first-tick", &self.first_tick.to_string()])
    }
}
