//! Distances between bodies, and of bodies to obstacles and to the ground, checked in every tick.

use crate::body::Body;
use crate::event_log::EventLog;
use crate::neighbours::closest_pair_squared;
use crate::sweep::SensorSweep;
use crate::tuning::ROUNDING_M;
use skein_protocol::record::ViolationKind;
use skein_protocol::{DroneId, SimTime};

/// Checks the distances, and keeps the least of them.
#[derive(Clone, Debug)]
pub(crate) struct DistanceMonitor {
    safe_distance_m: f64,
    clearance_m: f64,
    /// Square of the least distance of two bodies so far, m².
    separation_squared: f64,
    min_clearance_m: f64,
    /// The pairs that are too close in this tick, ascending.
    close: Vec<(u32, u32)>,
    /// The pairs that were too close in the tick before, ascending.
    close_before: Vec<(u32, u32)>,
    /// Whether each drone is too close to an obstacle.
    grazing: Vec<bool>,
    /// Whether each drone is too close to the ground.
    low: Vec<bool>,
}

impl DistanceMonitor {
    /// A monitor of bodies at their starts, with the two limits, m.
    pub(crate) fn new(bodies: &[Body], safe_distance_m: f64, clearance_m: f64) -> Self {
        Self {
            safe_distance_m,
            clearance_m,
            separation_squared: closest_pair_squared(bodies),
            min_clearance_m: f64::INFINITY,
            close: Vec::new(),
            close_before: Vec::new(),
            grazing: vec![false; bodies.len()],
            low: vec![false; bodies.len()],
        }
    }

    /// Least distance of two bodies so far, m; infinite if there were never two.
    pub(crate) fn min_separation_m(&self) -> f64 {
        self.separation_squared.sqrt()
    }

    /// Least distance of a body to an obstacle so far, m; infinite if there was none.
    pub(crate) fn min_clearance_m(&self) -> f64 {
        self.min_clearance_m
    }

    /// Checks the sweep at the end of a tick. Returns the number of violations that begin. The sweep must have looked as
    /// far as both limits and both least distances: what is beyond changes nothing.
    pub(crate) fn check(&mut self, bodies: &[Body], sweep: &SensorSweep, end: SimTime, log: &mut EventLog) -> u64 {
        self.check_separation(bodies, sweep, end, log)
            + self.check_clearance(sweep, end, log)
            + self.check_ground(bodies, end, log)
    }

    fn check_separation(&mut self, bodies: &[Body], sweep: &SensorSweep, end: SimTime, log: &mut EventLog) -> u64 {
        std::mem::swap(&mut self.close, &mut self.close_before);
        self.close.clear();
        let limit = (self.safe_distance_m - ROUNDING_M).max(0.0).powi(2);
        let mut violations = 0;
        for (i, body) in bodies.iter().enumerate() {
            for &j in sweep.neighbours_of(i).iter().filter(|&&j| j as usize > i) {
                let square = (bodies[j as usize].position() - body.position()).norm_squared();
                self.separation_squared = self.separation_squared.min(square);
                if square < limit {
                    violations += self.note_close((i as u32, j), square, end, log);
                }
            }
        }
        violations
    }

    /// Notes a pair that is too close. Returns 1 if it was not in the tick before, else 0.
    fn note_close(&mut self, pair: (u32, u32), square: f64, end: SimTime, log: &mut EventLog) -> u64 {
        self.close.push(pair);
        if self.close_before.binary_search(&pair).is_ok() {
            return 0;
        }
        log.push_violation(end, ViolationKind::Separation, &[DroneId(pair.0), DroneId(pair.1)], square.sqrt());
        1
    }

    fn check_clearance(&mut self, sweep: &SensorSweep, end: SimTime, log: &mut EventLog) -> u64 {
        let mut violations = 0;
        for (i, (&distance_m, grazing)) in sweep.clearances_m().iter().zip(&mut self.grazing).enumerate() {
            self.min_clearance_m = self.min_clearance_m.min(distance_m);
            let before = std::mem::replace(grazing, distance_m < self.clearance_m - ROUNDING_M);
            if *grazing && !before {
                violations += 1;
                log.push_violation(end, ViolationKind::Clearance, &[DroneId(i as u32)], distance_m);
            }
        }
        violations
    }

    /// A drone without a process may land.
    fn check_ground(&mut self, bodies: &[Body], end: SimTime, log: &mut EventLog) -> u64 {
        let mut violations = 0;
        for (i, (body, low)) in bodies.iter().zip(&mut self.low).enumerate() {
            let altitude_m = body.position().z;
            let before = std::mem::replace(low, body.is_alive() && altitude_m < self.clearance_m - ROUNDING_M);
            if *low && !before {
                violations += 1;
                log.push_violation(end, ViolationKind::Ground, &[DroneId(i as u32)], altitude_m);
            }
        }
        violations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event_log::tests::read;
    use crate::geometry::Outline;
    use crate::sweep::SweepRange;
    use crate::testing::{bodies, event_kinds, rectangle};
    use skein_protocol::record::EventKind;

    const RANGE: SweepRange = SweepRange { bodies_m: 100.0, detection_m: 0.0, clearance_m: 100.0 };

    /// Puts bodies at these positions in turn. Gives the violations, and their number.
    fn violations(steps: &[&[[f64; 2]]]) -> (DistanceMonitor, u64, Vec<Vec<EventKind>>) {
        let outline = Outline::new(&rectangle(0.0, 0.0, 10.0, 10.0));
        let mut distances = DistanceMonitor::new(&bodies(steps[0]), 33.0, 15.0);
        let (mut sweep, mut log) = (SensorSweep::new(vec![outline]), EventLog::default());
        let (mut count, mut events) = (0, Vec::new());
        for positions in steps {
            sweep.sweep(&bodies(positions), RANGE);
            count += distances.check(&bodies(positions), &sweep, SimTime::ZERO, &mut log);
            events.push(event_kinds(read(&mut log)));
        }
        (distances, count, events)
    }

    fn of(kind: ViolationKind, drones: &[u32], value_m: f64) -> Vec<EventKind> {
        vec![EventKind::Violation { kind, drones: drones.iter().map(|&d| DroneId(d)).collect(), value_m }]
    }

    #[test]
    fn a_lost_separation_is_logged_once_and_again_after_it_held() {
        let (near, far): (&[[f64; 2]], &[[f64; 2]]) = (&[[100.0, 0.0], [130.0, 0.0]], &[[100.0, 0.0], [133.0, 0.0]]);
        let (distances, count, events) = violations(&[far, near, near, far, near]);
        let broken = of(ViolationKind::Separation, &[0, 1], 30.0);
        assert_eq!(events, [vec![], broken.clone(), vec![], vec![], broken]);
        assert_eq!((count, distances.min_separation_m()), (2, 30.0));
    }

    #[test]
    fn a_lost_clearance_is_logged_for_each_drone() {
        let out = [-100.0, 0.0];
        let (distances, _, events) = violations(&[&[out, [50.0, 0.0]], &[out, [24.0, 0.0]], &[out, [26.0, 0.0]]]);
        assert_eq!(events, [vec![], of(ViolationKind::Clearance, &[1], 14.0), vec![]]);
        assert_eq!(distances.min_clearance_m(), 14.0);
    }

    #[test]
    fn a_rounding_error_is_no_violation() {
        let (_, _, events) = violations(&[&[[100.0, 0.0], [133.0 - 1e-7, 0.0]], &[[100.0, 0.0], [133.0 - 1e-5, 0.0]]]);
        assert_eq!((events[0].len(), events[1].len()), (0, 1));
    }
}
