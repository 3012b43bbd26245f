//! The drones of one process.

use skein_protocol::{DroneId, Tick};

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
}
