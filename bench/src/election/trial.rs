//! What one election of the benchmark tries, and what came of it.

use super::topology::Topology;

/// What is tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trial {
    /// Who hears whom.
    pub(super) topology: Topology,
    /// Size of the swarm.
    pub(super) drones: u32,
    /// Share of the frames that a receiver loses.
    pub(super) loss: f64,
    /// Share of the drones that die in the first seconds.
    pub(super) failing: f64,
    /// Seed of everything random.
    pub(super) seed: u64,
}

/// What happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Elected {
    /// Time from the start until there was one leader, s; `None` if there was none in time.
    pub(super) time_s: Option<f64>,
    /// Frames that a drone had sent until then, on average.
    pub(super) frames: f64,
    /// Drones that led before and had given way.
    pub(super) false_leaders: usize,
    /// Terms that began while the swarm was watched afterwards.
    pub(super) later: usize,
    /// What a living drone sent in that time, on average, bytes/s.
    pub(super) bytes_per_s: f64,
    /// Hops between the two drones that are farthest from each other.
    pub(super) hops: usize,
}
