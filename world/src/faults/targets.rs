//! Whom a fault meets, by what drones say of themselves in the tick before.

use super::FaultTargets;
use super::chance::Chance;
use crate::body::Body;
use crate::process::Process;
use crate::stages::Stages;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, GroupId};
use std::cmp::Reverse;

/// The truth at the beginning of a tick.
#[derive(Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub bodies: &'a [Body],
    pub processes: &'a [Process],
    pub stages: &'a Stages,
}

impl Scene<'_> {
    /// The last answer of a drone whose process runs.
    pub fn answering(&self, drone: usize) -> Option<&Slot> {
        let process = self.processes.get(drone)?;
        (self.bodies[drone].alive && !process.frozen).then_some(&process.slot)
    }

    fn all(&self) -> impl Iterator<Item = (usize, &Slot)> {
        (0..self.bodies.len()).filter_map(|drone| Some((drone, self.answering(drone)?)))
    }

    fn leaders(&self) -> impl Iterator<Item = (usize, &Slot)> {
        self.all().filter(|(_, slot)| slot.leads())
    }

    fn queued(&self) -> impl Iterator<Item = (usize, &Slot)> {
        self.all().filter(|(_, slot)| slot.is_queued())
    }

    /// The drones that a fault meets now, by number; none if nobody has the role. Those named are not asked whether they
    /// live.
    pub fn meets(&self, targets: &FaultTargets, mut chance: Chance) -> Vec<DroneId> {
        let along = |drone: usize| OrderedX(self.bodies[drone].position.x);
        let one = |found: Option<usize>| found.into_iter().collect();
        let drones: Vec<usize> = match targets {
            FaultTargets::Drones(drones) => {
                drones.iter().map(|id| id.index()).filter(|&d| d < self.bodies.len()).collect()
            }
            FaultTargets::All => self.all().map(|(drone, _)| drone).collect(),
            FaultTargets::Leader => one(self.leader(|_| true)),
            FaultTargets::GroupLeader(group) => one(self.leader(|led| led == *group)),
            FaultTargets::FirstInQueue => {
                let key = |&(drone, slot): &(usize, &Slot)| (slot.rank, Reverse(along(drone)), drone);
                one(self.queued().min_by_key(key).map(|(drone, _)| drone))
            }
            FaultTargets::LastInQueue => {
                let key = |&(drone, slot): &(usize, &Slot)| (Reverse(slot.rank), along(drone), drone);
                one(self.queued().min_by_key(key).map(|(drone, _)| drone))
            }
            FaultTargets::Member => one(self.all().find(|(_, slot)| !slot.leads()).map(|(drone, _)| drone)),
            FaultTargets::Random => {
                let living: Vec<usize> = self.all().map(|(drone, _)| drone).collect();
                one(living.get(chance.one_of(living.len())).copied())
            }
        };
        drones.into_iter().map(|drone| DroneId(drone as u32)).collect()
    }

    /// Who leads a group of this kind; of several the one with the shallowest group, the highest ballot, the lowest
    /// number.
    fn leader(&self, of: impl Fn(GroupId) -> bool) -> Option<usize> {
        let leaders = self.leaders().filter(|(_, slot)| of(slot.led));
        let key = |&(drone, slot): &(usize, &Slot)| (slot.led.depth(), Reverse(slot.obeyed.ballot), drone);
        leaders.min_by_key(key).map(|(drone, _)| drone)
    }
}

/// An abscissa in its total order.
#[derive(PartialEq)]
struct OrderedX(f64);

impl Eq for OrderedX {}

impl PartialOrd for OrderedX {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for OrderedX {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::bodies;
    use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED};
    use skein_protocol::{Ballot, PlanStamp};

    fn process(flags: u32, led: GroupId, round: u32, rank: u16) -> Process {
        let ballot = Ballot { round, incarnation: 1, claimant: DroneId(0) };
        let slot = Slot { flags, led, rank, obeyed: PlanStamp { ballot, epoch: 1 }, ..Slot::default() };
        let mut process = Process::default();
        process.slot = slot;
        process
    }

    /// 0 leads the swarm under an old ballot, 2 under a new one; 1 leads N1; 3, 4 and 5 queue.
    fn met(targets: &FaultTargets, change: impl FnOnce(&mut Vec<Body>, &mut Vec<Process>)) -> Vec<u32> {
        let mut bodies =
            bodies(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [30.0, 0.0], [40.0, 0.0], [50.0, 0.0], [6.0, 0.0]]);
        let mut processes = vec![
            process(SLOT_LEADS, GroupId::ALL, 1, 0),
            process(SLOT_LEADS, GroupId::ALL.child(1), 9, 0),
            process(SLOT_LEADS, GroupId::ALL, 2, 0),
            process(SLOT_QUEUED, GroupId::ALL, 2, 0),
            process(SLOT_QUEUED, GroupId::ALL, 2, 1),
            process(SLOT_QUEUED, GroupId::ALL, 2, 1),
            process(0, GroupId::ALL, 2, 0),
        ];
        change(&mut bodies, &mut processes);
        let stages = Stages::new(&[], 40.0);
        let scene = Scene { bodies: &bodies, processes: &processes, stages: &stages };
        scene.meets(targets, Chance::new(1, [0; 3])).into_iter().map(|id| id.0).collect()
    }

    #[test]
    fn roles_are_found() {
        let found = |targets| met(&targets, |_, _| {});
        assert_eq!(found(FaultTargets::Leader), [2], "the newer of two terms");
        assert_eq!(found(FaultTargets::GroupLeader(GroupId::ALL.child(1))), [1]);
        assert_eq!(found(FaultTargets::GroupLeader(GroupId::ALL.child(2))), [0; 0]);
        assert_eq!(found(FaultTargets::FirstInQueue), [3]);
        assert_eq!(found(FaultTargets::LastInQueue), [4], "of two with a rank, the one behind");
        assert_eq!(found(FaultTargets::Member), [3]);
        assert_eq!(found(FaultTargets::All), [0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(found(FaultTargets::Drones(vec![DroneId(6), DroneId(99)])), [6]);
        assert_eq!(found(FaultTargets::Random).len(), 1);
    }

    #[test]
    fn the_dead_and_the_frozen_have_no_role() {
        let change = |bodies: &mut Vec<Body>, processes: &mut Vec<Process>| {
            bodies[2].alive = false;
            bodies[4].alive = false;
            processes[3].frozen = true;
        };
        assert_eq!(met(&FaultTargets::Leader, change), [0]);
        assert_eq!(met(&FaultTargets::FirstInQueue, change), [5]);
        assert_eq!(met(&FaultTargets::LastInQueue, change), [5]);
        assert_eq!(met(&FaultTargets::Member, change), [5]);
        assert_eq!(met(&FaultTargets::All, change), [0, 1, 5, 6]);
        assert_eq!(met(&FaultTargets::Drones(vec![DroneId(2)]), change), [2], "who is named is met");
    }
}
