//! What each drone obeys, checked in every tick: one assignment per plan, and never an older plan.

use crate::event_log::EventLog;
use crate::tuning::PLANS_KEPT;
use skein_protocol::record::ViolationKind;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, PlanStamp, SimTime};
use std::collections::BTreeMap;

/// The plan that one drone obeys, and those that it has obeyed.
#[derive(Clone, Debug, Default)]
pub(crate) struct ObedienceMonitor {
    /// The plan it obeys, and the hash of its assignment.
    last: (PlanStamp, u64),
    /// The hash of the assignment it obeyed under each of its latest plans.
    assignments: BTreeMap<PlanStamp, u64>,
    restarted: bool,
}

impl ObedienceMonitor {
    /// The drone has a new process. It may obey an older plan than the process before it, but no other assignment under
    /// the same plan.
    pub(crate) fn restart(&mut self) {
        self.restarted = true;
    }

    /// Checks what a drone reports to obey. Returns the number of violations.
    pub(crate) fn check(&mut self, drone: DroneId, slot: &Slot, at: SimTime, log: &mut EventLog) -> u64 {
        let reported = (slot.obeyed, slot.part_hash);
        let restarted = std::mem::take(&mut self.restarted);
        let before = std::mem::replace(&mut self.last, reported);
        if before == reported {
            return 0;
        }
        let mut violations = 0;
        if reported.0 < before.0 && !restarted {
            violations += 1;
            log.push_violation(at, ViolationKind::BallotWentBack, &[drone], 0.0);
        }
        if self.is_other_assignment(reported) {
            violations += 1;
            log.push_violation(at, ViolationKind::ConflictingAssignment, &[drone], 0.0);
        }
        violations
    }

    /// Whether the drone obeyed another assignment under this plan before. A hash of 0 means no assignment.
    fn is_other_assignment(&mut self, (plan, hash): (PlanStamp, u64)) -> bool {
        let known = if hash == 0 { None } else { self.assignments.insert(plan, hash) };
        if self.assignments.len() > PLANS_KEPT {
            self.assignments.pop_first();
        }
        known.is_some_and(|known| known != hash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::Ballot;

    fn obeys(round: u32, epoch: u32, part_hash: u64) -> Slot {
        let obeyed = PlanStamp { ballot: Ballot { round, incarnation: 1, claimant: DroneId(0) }, epoch };
        Slot { obeyed, part_hash, ..Slot::default() }
    }

    /// The number of violations in each tick of a drone that reports these slots.
    fn violations(slots: &[Slot]) -> Vec<u64> {
        let mut obedience = ObedienceMonitor::default();
        slots.iter().map(|slot| obedience.check(DroneId(1), slot, SimTime::ZERO, &mut EventLog::default())).collect()
    }

    #[test]
    fn one_plan_has_one_assignment_per_drone() {
        assert_eq!(violations(&[obeys(1, 1, 7), obeys(1, 1, 7), obeys(1, 1, 8), obeys(1, 1, 8)]), [0, 0, 1, 0]);
        assert_eq!(violations(&[obeys(1, 1, 7), obeys(1, 1, 0), obeys(1, 1, 8)]), [0, 0, 1]);
        assert_eq!(violations(&[obeys(1, 1, 0), obeys(1, 1, 7), obeys(1, 2, 8), obeys(2, 1, 9)]), [0, 0, 0, 0]);
    }

    #[test]
    fn an_older_plan_is_a_violation() {
        assert_eq!(violations(&[obeys(1, 2, 1), obeys(1, 1, 2), obeys(1, 1, 2), obeys(1, 2, 1)]), [0, 1, 0, 0]);
        assert_eq!(violations(&[obeys(2, 1, 1), obeys(1, 9, 2)]), [0, 1]);
    }

    #[test]
    fn only_a_new_process_may_obey_an_older_plan() {
        let mut obedience = ObedienceMonitor::default();
        let mut log = EventLog::default();
        let mut check =
            |obedience: &mut ObedienceMonitor, slot| obedience.check(DroneId(1), &slot, SimTime::ZERO, &mut log);
        assert_eq!(check(&mut obedience, obeys(2, 1, 5)), 0);
        obedience.restart();
        assert_eq!(check(&mut obedience, Slot::default()), 0);
        assert_eq!(check(&mut obedience, obeys(1, 1, 6)), 0);
        assert_eq!(check(&mut obedience, obeys(2, 1, 7)), 1);
        assert_eq!(check(&mut obedience, obeys(1, 1, 6)), 1);
    }
}
