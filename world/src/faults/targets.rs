//! Which drones a fault affects, by what drones reported of themselves in the tick before.

use super::keyed_rng::KeyedRng;
use super::view::FaultView;
use crate::fault_plan::FaultTargets;
use skein_protocol::slot::Slot;
use skein_protocol::{DroneId, GroupId};
use std::cmp::Reverse;

/// The drones that `targets` names now, by id; none if no drone has the role. Drones that are named by id are given even
/// if they are dead.
pub(crate) fn resolve(targets: &FaultTargets, view: &FaultView<'_>, mut rng: KeyedRng) -> Vec<DroneId> {
    let count = view.drones.bodies().len();
    let one = |found: Option<usize>| found.into_iter().collect();
    let drones: Vec<usize> = match targets {
        FaultTargets::Drones(drones) => drones.iter().map(|id| id.index()).filter(|&drone| drone < count).collect(),
        FaultTargets::All => view.drones.answers().map(|(drone, _)| drone).collect(),
        FaultTargets::Leader => one(leader(view, |_| true)),
        FaultTargets::GroupLeader(group) => one(leader(view, |led| led == *group)),
        FaultTargets::FirstInQueue => one(first_in_queue(view)),
        FaultTargets::LastInQueue => one(last_in_queue(view)),
        FaultTargets::Member => one(view.drones.answers().find(|(_, slot)| !slot.leads()).map(|(drone, _)| drone)),
        FaultTargets::Random => {
            let living: Vec<usize> = view.drones.answers().map(|(drone, _)| drone).collect();
            one(living.get(rng.one_of(living.len())).copied())
        }
    };
    drones.into_iter().map(|drone| DroneId(drone as u32)).collect()
}

/// The leader of a group of this kind; of several the one with the shallowest group, then the highest ballot, then the
/// lowest id.
fn leader(view: &FaultView<'_>, of: impl Fn(GroupId) -> bool) -> Option<usize> {
    let leaders = view.drones.answers().filter(|(_, slot)| slot.leads() && of(slot.led));
    let key = |&(drone, slot): &(usize, &Slot)| (slot.led.depth(), Reverse(slot.obeyed.ballot), drone);
    leaders.min_by_key(key).map(|(drone, _)| drone)
}

fn first_in_queue(view: &FaultView<'_>) -> Option<usize> {
    let key = |&(drone, slot): &(usize, &Slot)| (slot.rank, Reverse(along(view, drone)), drone);
    queued(view).min_by_key(key).map(|(drone, _)| drone)
}

fn last_in_queue(view: &FaultView<'_>) -> Option<usize> {
    let key = |&(drone, slot): &(usize, &Slot)| (Reverse(slot.rank), along(view, drone), drone);
    queued(view).min_by_key(key).map(|(drone, _)| drone)
}

fn queued<'a>(view: &FaultView<'a>) -> impl Iterator<Item = (usize, &'a Slot)> {
    view.drones.answers().filter(|(_, slot)| slot.is_queued())
}

fn along(view: &FaultView<'_>, drone: usize) -> OrderedX {
    OrderedX(view.stages.along_m(&view.drones.bodies()[drone]))
}

/// An abscissa (m) in its total order.
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
    use crate::drones::DroneTable;
    use crate::stages::Stages;
    use skein_protocol::slot::{SLOT_LEADS, SLOT_QUEUED};
    use skein_protocol::{Ballot, Course, PlanStamp, Vec3};

    fn slot(flags: u32, led: GroupId, round: u32, rank: u16) -> Slot {
        let ballot = Ballot { round, incarnation: 1, claimant: DroneId(0) };
        Slot { flags, led, rank, obeyed: PlanStamp { ballot, epoch: 1 }, ..Slot::default() }
    }

    /// 0 leads the swarm under an old ballot, 2 under a new one; 1 leads N1; 3, 4 and 5 queue.
    fn resolved(targets: &FaultTargets, change: impl FnOnce(&mut DroneTable)) -> Vec<u32> {
        let starts = [0.0, 1.0, 2.0, 30.0, 40.0, 50.0, 6.0].map(|x| (Vec3::new(x, 0.0, 50.0), Vec3::zeros()));
        let mut drones = DroneTable::new(&starts);
        let slots = [
            slot(SLOT_LEADS, GroupId::ALL, 1, 0),
            slot(SLOT_LEADS, GroupId::ALL.child(1), 9, 0),
            slot(SLOT_LEADS, GroupId::ALL, 2, 0),
            slot(SLOT_QUEUED, GroupId::ALL, 2, 0),
            slot(SLOT_QUEUED, GroupId::ALL, 2, 1),
            slot(SLOT_QUEUED, GroupId::ALL, 2, 1),
            slot(0, GroupId::ALL, 2, 0),
        ];
        for (id, slot) in (0..).map(DroneId).zip(&slots) {
            drones.take_slot(id, slot);
        }
        change(&mut drones);
        let stages = Stages::new(Course::East, &[], 40.0);
        let view = FaultView { drones: &drones, stages: &stages };
        resolve(targets, &view, KeyedRng::new(1, [0; 3])).into_iter().map(|id| id.0).collect()
    }

    #[test]
    fn roles_are_found() {
        let found = |targets| resolved(&targets, |_| {});
        assert_eq!(found(FaultTargets::Leader), [2], "the newer of two terms wins");
        assert_eq!(found(FaultTargets::GroupLeader(GroupId::ALL.child(1))), [1]);
        assert_eq!(found(FaultTargets::GroupLeader(GroupId::ALL.child(2))), [0; 0]);
        assert_eq!(found(FaultTargets::FirstInQueue), [3]);
        assert_eq!(found(FaultTargets::LastInQueue), [4], "of two with one rank, the one behind is last");
        assert_eq!(found(FaultTargets::Member), [3]);
        assert_eq!(found(FaultTargets::All), [0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(found(FaultTargets::Drones(vec![DroneId(6), DroneId(99)])), [6]);
        assert_eq!(found(FaultTargets::Random).len(), 1);
    }

    #[test]
    fn dead_and_frozen_drones_have_no_role() {
        let change = |drones: &mut DroneTable| {
            drones.kill(DroneId(2));
            drones.kill(DroneId(4));
            drones.freeze(DroneId(3));
        };
        assert_eq!(resolved(&FaultTargets::Leader, change), [0]);
        assert_eq!(resolved(&FaultTargets::FirstInQueue, change), [5]);
        assert_eq!(resolved(&FaultTargets::LastInQueue, change), [5]);
        assert_eq!(resolved(&FaultTargets::Member, change), [5]);
        assert_eq!(resolved(&FaultTargets::All, change), [0, 1, 5, 6]);
        assert_eq!(
            resolved(&FaultTargets::Drones(vec![DroneId(2)]), change),
            [2],
            "a drone that is named by id is given even if it is dead"
        );
    }
}
