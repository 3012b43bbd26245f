//! How a run ended.

use crate::host_share::HostReport;

/// How a run ended: what its record does not tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunEnd {
    /// Wall time from the call to the first tick, s.
    pub startup_s: f64,
    /// System calls of the barrier: those of the world, and those of all drones together.
    pub calls: [u64; 2],
    /// The signal that interrupted the run.
    pub signal: Option<i32>,
    /// Why records are missing: the first error.
    pub sink_error: Option<String>,
    /// Number of records that could not be used and were left out.
    pub bad_records: u64,
    /// What failed in the environment during the flight, such as the death of the world process.
    pub failure: Option<String>,
    /// What became of each host, in the order of [`crate::Launch::hosts`]; `None` if it was gone before the end.
    pub hosts: Vec<Option<HostReport>>,
}
