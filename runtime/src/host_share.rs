//! What a run leaves to another machine.

use crate::program::Program;
use serde::{Deserialize, Serialize};
use skein_protocol::DroneId;

/// The drones that fly on one other machine.
#[derive(Debug)]
pub struct HostShare {
    /// Name of the host.
    pub name: String,
    /// Its first drone.
    pub first: DroneId,
    /// Number of its drones, which follow one another.
    pub count: u32,
    /// The program that takes the place of these drones on the launcher's machine. It answers to the arguments of `skein-hosts relay`.
    pub relay: Program,
}

impl HostShare {
    /// Whether a drone flies there.
    #[must_use]
    pub fn flies(&self, drone: DroneId) -> bool {
        (self.first.0..self.first.0 + self.count).contains(&drone.0)
    }
}

/// What a relay has counted when its run ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HostReport {
    /// Time from the opening of a tick to the host's answer: median, 99th percentile, maximum, µs.
    pub lateness_us: Option<[f64; 3]>,
    /// Number of ticks that the host answered.
    pub ticks: u64,
    /// Bytes sent to the host in ticks.
    pub bytes_down: u64,
    /// Bytes received from the host in ticks.
    pub bytes_up: u64,
}
