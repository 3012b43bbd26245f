//! What must hold in every tick. A violation is told once, when it begins.

use crate::body::Body;
use crate::grid::closest_pair_squared;
use crate::log::Log;
use crate::senses::Surroundings;
use skein_protocol::record::{EventKind, ViolationKind};
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, PlanStamp, SimTime};
use std::collections::BTreeMap;

/// Room for rounding, m: not a softer limit.
const ROUNDING_M: f64 = 1e-6;

/// Distances between bodies, and of bodies to obstacles.
#[derive(Clone, Debug)]
pub(crate) struct Distances {
    safe_distance_m: f64,
    clearance_m: f64,
    separation_squared: f64,
    /// Least distance of a body to an obstacle so far, m.
    pub min_clearance_m: f64,
    /// Pairs that are too close, ascending; of this tick and, while it is checked, of the one before.
    close: Vec<(u32, u32)>,
    close_before: Vec<(u32, u32)>,
    grazing: Vec<bool>,
    /// Violations so far.
    pub violations: u64,
}

impl Distances {
    /// For bodies at their starts.
    pub fn new(bodies: &[Body], safe_distance_m: f64, clearance_m: f64) -> Self {
        Self {
            safe_distance_m,
            clearance_m,
            separation_squared: closest_pair_squared(bodies),
            min_clearance_m: f64::INFINITY,
            close: Vec::new(),
            close_before: Vec::new(),
            grazing: vec![false; bodies.len()],
            violations: 0,
        }
    }

    /// Least distance of two bodies so far, m; infinite before two have flown.
    pub fn min_separation_m(&self) -> f64 {
        self.separation_squared.sqrt()
    }

    /// Checks what was surveyed at the end of a tick. The survey must have looked as far as both limits and both
    /// minima: what is beyond changes neither.
    pub fn check(&mut self, bodies: &[Body], around: &Surroundings, end: SimTime, log: &mut Log) {
        self.check_separation(bodies, around, end, log);
        self.check_clearance(around, end, log);
    }

    fn check_separation(&mut self, bodies: &[Body], around: &Surroundings, end: SimTime, log: &mut Log) {
        std::mem::swap(&mut self.close, &mut self.close_before);
        self.close.clear();
        let limit = (self.safe_distance_m - ROUNDING_M).max(0.0).powi(2);
        for (i, body) in bodies.iter().enumerate() {
            for &j in around.neighbours.of(i).iter().filter(|&&j| j as usize > i) {
                let square = (bodies[j as usize].position - body.position).norm_squared();
                self.separation_squared = self.separation_squared.min(square);
                if square < limit {
                    self.close_pair((i as u32, j), square, end, log);
                }
            }
        }
    }

    fn close_pair(&mut self, pair: (u32, u32), square: f64, end: SimTime, log: &mut Log) {
        self.close.push(pair);
        if self.close_before.binary_search(&pair).is_err() {
            self.violations += 1;
            let drones = [DroneId(pair.0), DroneId(pair.1)];
            violation(ViolationKind::Separation, &drones, square.sqrt(), end, log);
        }
    }

    fn check_clearance(&mut self, around: &Surroundings, end: SimTime, log: &mut Log) {
        for (i, (&distance, grazing)) in around.clearance_m.iter().zip(&mut self.grazing).enumerate() {
            self.min_clearance_m = self.min_clearance_m.min(distance);
            let before = std::mem::replace(grazing, distance < self.clearance_m - ROUNDING_M);
            if *grazing && !before {
                self.violations += 1;
                violation(ViolationKind::Clearance, &[DroneId(i as u32)], distance, end, log);
            }
        }
    }
}

/// Plans whose parts are remembered for a drone: more than a restarted one could hear of again.
const PLANS_KEPT: usize = 16;

/// What one drone obeys and has obeyed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Obedience {
    last: (PlanStamp, u64),
    /// The part it obeyed under each of its latest plans.
    parts: BTreeMap<PlanStamp, u64>,
    restarted: bool,
}

impl Obedience {
    /// A new process may obey an older plan than the one before it did, but no other part of the same.
    pub fn restart(&mut self) {
        self.restarted = true;
    }

    /// Checks what a drone says it obeys; the number of violations told.
    pub fn check(&mut self, drone: DroneId, slot: &Slot, at: SimTime, log: &mut Log) -> u64 {
        let said = (slot.obeyed, slot.part_hash);
        let restarted = std::mem::take(&mut self.restarted);
        let before = std::mem::replace(&mut self.last, said);
        if before == said {
            return 0;
        }
        let mut broken = 0;
        if said.0 < before.0 && !restarted {
            broken += 1;
            violation(ViolationKind::BallotWentBack, &[drone], 0.0, at, log);
        }
        if self.is_other_part(said) {
            broken += 1;
            violation(ViolationKind::ConflictingAssignment, &[drone], 0.0, at, log);
        }
        broken
    }

    fn is_other_part(&mut self, (plan, part): (PlanStamp, u64)) -> bool {
        let known = if part == 0 { None } else { self.parts.insert(plan, part) };
        if self.parts.len() > PLANS_KEPT {
            self.parts.pop_first();
        }
        known.is_some_and(|known| known != part)
    }
}

fn violation(kind: ViolationKind, drones: &[DroneId], value_m: f64, at: SimTime, log: &mut Log) {
    log.push(at, EventKind::Violation { kind, drones: drones.to_vec(), value_m });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Outline;
    use crate::log::tests::read;
    use crate::senses::Reach;
    use crate::testing::{bodies, happenings, rectangle};
    use skein_protocol::Ballot;

    const REACH: Reach = Reach { bodies_m: 100.0, detection_m: 0.0, clearance_m: 100.0 };

    /// The violations of bodies that stand at these positions in turn.
    fn violations(steps: &[&[[f64; 2]]]) -> (Distances, Vec<Vec<EventKind>>) {
        let outline = Outline::new(&rectangle(0.0, 0.0, 10.0, 10.0));
        let mut distances = Distances::new(&bodies(steps[0]), 33.0, 15.0);
        let (mut around, mut log) = (Surroundings::default(), Log::default());
        let told = steps.iter().map(|positions| {
            around.survey(&bodies(positions), std::slice::from_ref(&outline), REACH);
            distances.check(&bodies(positions), &around, SimTime::ZERO, &mut log);
            happenings(read(&mut log))
        });
        let told = told.collect();
        (distances, told)
    }

    fn of(kind: ViolationKind, drones: &[u32], value_m: f64) -> Vec<EventKind> {
        vec![EventKind::Violation { kind, drones: drones.iter().map(|&d| DroneId(d)).collect(), value_m }]
    }

    #[test]
    fn separation_is_told_when_it_breaks_and_again_after_it_held() {
        let (near, far): (&[[f64; 2]], &[[f64; 2]]) = (&[[100.0, 0.0], [130.0, 0.0]], &[[100.0, 0.0], [133.0, 0.0]]);
        let (distances, told) = violations(&[far, near, near, far, near]);
        let broken = of(ViolationKind::Separation, &[0, 1], 30.0);
        assert_eq!(told, [vec![], broken.clone(), vec![], vec![], broken]);
        assert_eq!((distances.violations, distances.min_separation_m()), (2, 30.0));
    }

    #[test]
    fn clearance_is_told_for_each_drone() {
        let out = [-100.0, 0.0];
        let (distances, told) = violations(&[&[out, [50.0, 0.0]], &[out, [24.0, 0.0]], &[out, [26.0, 0.0]]]);
        assert_eq!(told, [vec![], of(ViolationKind::Clearance, &[1], 14.0), vec![]]);
        assert_eq!(distances.min_clearance_m, 14.0);
    }

    #[test]
    fn rounding_is_no_violation() {
        let (_, told) = violations(&[&[[100.0, 0.0], [133.0 - 1e-7, 0.0]], &[[100.0, 0.0], [133.0 - 1e-5, 0.0]]]);
        assert_eq!((told[0].len(), told[1].len()), (0, 1));
    }

    fn obeys(round: u32, epoch: u32, part_hash: u64) -> Slot {
        let obeyed = PlanStamp { ballot: Ballot { round, incarnation: 1, claimant: DroneId(0) }, epoch };
        Slot { obeyed, part_hash, ..Slot::default() }
    }

    /// The number of violations in each tick of a drone that says this.
    fn counted(slots: &[Slot]) -> Vec<u64> {
        let mut obedience = Obedience::default();
        slots.iter().map(|slot| obedience.check(DroneId(1), slot, SimTime::ZERO, &mut Log::default())).collect()
    }

    #[test]
    fn one_plan_has_one_part() {
        assert_eq!(counted(&[obeys(1, 1, 7), obeys(1, 1, 7), obeys(1, 1, 8), obeys(1, 1, 8)]), [0, 0, 1, 0]);
        assert_eq!(counted(&[obeys(1, 1, 7), obeys(1, 1, 0), obeys(1, 1, 8)]), [0, 0, 1]);
        assert_eq!(counted(&[obeys(1, 1, 0), obeys(1, 1, 7), obeys(1, 2, 8), obeys(2, 1, 9)]), [0, 0, 0, 0]);
    }

    #[test]
    fn plans_do_not_go_back() {
        assert_eq!(counted(&[obeys(1, 2, 1), obeys(1, 1, 2), obeys(1, 1, 2), obeys(1, 2, 1)]), [0, 1, 0, 0]);
        assert_eq!(counted(&[obeys(2, 1, 1), obeys(1, 9, 2)]), [0, 1]);
    }

    #[test]
    fn a_new_process_may_begin_below_but_not_otherwise() {
        let mut obedience = Obedience::default();
        let mut log = Log::default();
        let mut check = |obedience: &mut Obedience, slot| obedience.check(DroneId(1), &slot, SimTime::ZERO, &mut log);
        assert_eq!(check(&mut obedience, obeys(2, 1, 5)), 0);
        obedience.restart();
        assert_eq!(check(&mut obedience, Slot::default()), 0);
        assert_eq!(check(&mut obedience, obeys(1, 1, 6)), 0);
        assert_eq!(check(&mut obedience, obeys(2, 1, 7)), 1);
        assert_eq!(check(&mut obedience, obeys(1, 1, 6)), 1);
    }
}
