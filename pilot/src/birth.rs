//! What a pilot is made from.

use crate::params::Params;
use serde_json::Value;
use std::sync::Arc;

/// What a pilot is made from. A restarted drone gets a new pilot that knows nothing but this.
#[derive(Clone, Debug, Default)]
pub struct Birth {
    /// Number of the drone, from 0.
    pub drone: u32,
    /// Number of drones in the swarm.
    pub drones: u32,
    /// Counts the starts of this drone, from 1. A restart makes it one more.
    pub incarnation: u32,
    /// Simulated time of the pilot's first step, s.
    pub start_s: f64,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Seed of the mission. A pilot that needs randomness derives it from this, its drone and its incarnation.
    pub seed: u64,
    /// Name of the pilot.
    pub pilot: String,
    /// The table `params` of the pilot in the scenario.
    pub params: Params,
    /// The whole scenario as resolved, with all defaults.
    pub scenario: Arc<Value>,
}
