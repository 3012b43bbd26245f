//! Constants of a rollout.

use crate::tuning::ROLLOUT_STEP_S;
use skein_leader::params::PlannerParams;

/// The vehicle, its sensors and the mission, as a rollout needs them.
#[derive(Clone, Debug)]
pub struct RolloutParams {
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Least distance between two drones, m.
    pub safe_distance_m: f64,
    /// Least distance of a drone's centre to an obstacle, m.
    pub clearance_m: f64,
    /// Largest acceleration, m/s².
    pub acceleration_max_mps2: f64,
    /// Range of the obstacle sensor, m.
    pub detection_range_m: f64,
    /// Range within which neighbours are sensed, m.
    pub ranging_m: f64,
    /// Nominal speed, m/s.
    pub speed_mps: f64,
    /// Largest speed while a drone approaches its slot, m/s.
    pub reform_speed_max_mps: f64,
    /// The mission.
    pub planner: PlannerParams,
}

impl RolloutParams {
    /// Ticks in a step: as many as come closest to `ROLLOUT_STEP_S`, at least one.
    #[must_use]
    pub fn step_ticks(&self) -> u64 {
        ((ROLLOUT_STEP_S / self.dt_s).round() as u64).max(1)
    }

    /// Length of a step, s.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.dt_s * self.step_ticks() as f64
    }

    /// Abscissas of the slots in which this many drones end the mission, m.
    pub(crate) fn end_slots(&self, drones: usize) -> Vec<f64> {
        let planner = &self.planner;
        let front_m = planner.destination.stop_x_m();
        planner.shape.slots(drones, planner.spacing_m).iter().map(|slot| front_m + slot.x).collect()
    }
}
