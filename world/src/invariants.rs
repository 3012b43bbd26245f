//! What must hold in every tick. A violation is logged once, when it begins.

mod distances;
mod obedience;

use crate::body::Body;
use crate::event_log::EventLog;
use crate::sweep::SensorSweep;
use distances::DistanceMonitor;
use obedience::ObedienceMonitor;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, SimTime};

/// Checks all invariants and counts their violations.
#[derive(Clone, Debug)]
pub(crate) struct InvariantMonitor {
    distances: DistanceMonitor,
    /// By drone.
    obedience: Vec<ObedienceMonitor>,
    violations: u64,
}

impl InvariantMonitor {
    /// A monitor of bodies at their starts, with the least distance between bodies and that to obstacles and the ground, m.
    pub(crate) fn new(bodies: &[Body], safe_distance_m: f64, clearance_m: f64) -> Self {
        Self {
            distances: DistanceMonitor::new(bodies, safe_distance_m, clearance_m),
            obedience: vec![ObedienceMonitor::default(); bodies.len()],
            violations: 0,
        }
    }

    /// Checks the distances that were swept at the end of a tick.
    pub(crate) fn check_distances(&mut self, bodies: &[Body], sweep: &SensorSweep, end: SimTime, log: &mut EventLog) {
        self.violations += self.distances.check(bodies, sweep, end, log);
    }

    /// Checks what a drone reports to obey.
    pub(crate) fn check_obedience(&mut self, drone: DroneId, slot: &Slot, at: SimTime, log: &mut EventLog) {
        if let Some(obedience) = self.obedience.get_mut(drone.index()) {
            self.violations += obedience.check(drone, slot, at, log);
        }
    }

    /// The drone has a new process, which may obey an older plan.
    pub(crate) fn restart(&mut self, drone: DroneId) {
        if let Some(obedience) = self.obedience.get_mut(drone.index()) {
            obedience.restart();
        }
    }

    /// Violations so far.
    pub(crate) fn violations(&self) -> u64 {
        self.violations
    }

    /// Least distance of two bodies so far, m; infinite if there were never two.
    pub(crate) fn min_separation_m(&self) -> f64 {
        self.distances.min_separation_m()
    }

    /// Least distance of a body to an obstacle so far, m; infinite if there was none.
    pub(crate) fn min_clearance_m(&self) -> f64 {
        self.distances.min_clearance_m()
    }
}
