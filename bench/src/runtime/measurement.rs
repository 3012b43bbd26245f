//! The measurement of one case in one round.

use crate::median::median;
use serde::Serialize;

/// The measurement of one case in one round. An agent-step is one tick of one drone.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Measurement {
    /// Ticks per second of wall time.
    pub ticks_per_s: f64,
    /// Agent-steps per second of wall time.
    pub agent_steps_per_s: f64,
    /// Simulated seconds per second of wall time; `None` without a simulation.
    pub realtime_factor: Option<f64>,
    /// Median duration of a drone's step, µs.
    pub step_us_p50: Option<f64>,
    /// 99th percentile of a drone's step, µs.
    pub step_us_p99: Option<f64>,
    /// Longest step of a drone, µs.
    pub step_us_max: Option<f64>,
    /// System calls of the barrier per agent-step: the world's and the drones'.
    pub calls_per_step: Option<f64>,
    /// Context switches of all processes per agent-step.
    pub switches_per_step: Option<f64>,
    /// CPU time of all processes per agent-step, µs.
    pub cpu_us_per_step: Option<f64>,
    /// CPU time of the world per agent-step, µs.
    pub world_us_per_step: Option<f64>,
    /// CPU time of the drones per agent-step, µs.
    pub drones_us_per_step: Option<f64>,
    /// Resident memory of all processes, MiB.
    pub rss_mib: Option<f64>,
    /// Memory of all processes with shared pages divided, MiB.
    pub pss_mib: Option<f64>,
    /// Files in shared memory.
    pub shm_files: Option<f64>,
    /// Descriptors that the world holds.
    pub world_files: Option<f64>,
    /// From the launch to the first tick, s.
    pub startup_s: Option<f64>,
    /// From the last tick to the end, s.
    pub shutdown_s: Option<f64>,
}

impl Measurement {
    /// The median of each figure over the rounds.
    #[must_use]
    pub fn median(rounds: &[Self]) -> Self {
        let of = |value: fn(&Self) -> Option<f64>| {
            let values: Vec<f64> = rounds.iter().filter_map(value).collect();
            if values.is_empty() { None } else { Some(median(values.into_iter())) }
        };
        Self {
            ticks_per_s: median(rounds.iter().map(|m| m.ticks_per_s)),
            agent_steps_per_s: median(rounds.iter().map(|m| m.agent_steps_per_s)),
            realtime_factor: of(|m| m.realtime_factor),
            step_us_p50: of(|m| m.step_us_p50),
            step_us_p99: of(|m| m.step_us_p99),
            step_us_max: of(|m| m.step_us_max),
            calls_per_step: of(|m| m.calls_per_step),
            switches_per_step: of(|m| m.switches_per_step),
            cpu_us_per_step: of(|m| m.cpu_us_per_step),
            world_us_per_step: of(|m| m.world_us_per_step),
            drones_us_per_step: of(|m| m.drones_us_per_step),
            rss_mib: of(|m| m.rss_mib),
            pss_mib: of(|m| m.pss_mib),
            shm_files: of(|m| m.shm_files),
            world_files: of(|m| m.world_files),
            startup_s: of(|m| m.startup_s),
            shutdown_s: of(|m| m.shutdown_s),
        }
    }
}
