//! The drones that keep a mission from its goal when its time is over, by the true state and by what they last said.

use crate::body::Body;
use crate::end_condition::EndCondition;
use crate::goal_slots;
use crate::params::{End, WorldParams};
use crate::process::Process;
use crate::slot_gaps::slot_gaps;
use crate::stages::Stages;
use crate::stillness::Stillness;
use skein_protocol::payload::NO_ROUTE;
use skein_protocol::{DroneId, Lack, SimTime, UnfinishedDrone};

/// What is looked at.
#[derive(Clone, Copy)]
pub(crate) struct Unfinished<'a> {
    pub(crate) params: &'a WorldParams,
    /// The bodies and their processes, by id.
    pub(crate) bodies: &'a [Body],
    pub(crate) processes: &'a [Process],
    pub(crate) condition: &'a EndCondition,
    pub(crate) stages: &'a Stages,
    pub(crate) stillness: &'a Stillness,
    pub(crate) now: SimTime,
}

impl Unfinished<'_> {
    /// The unfinished drones of these parts of the swarm. Those before the first obstacle sets and in front of their queues come first.
    pub(crate) fn drones(&self, parts: &[Vec<usize>]) -> Vec<UnfinishedDrone> {
        let mut all: Vec<UnfinishedDrone> = parts.iter().flat_map(|part| self.of_part(part)).collect();
        // `None` would come before all numbers.
        let behind = |number: Option<u32>| number.unwrap_or(u32::MAX);
        all.sort_by_key(|drone| (behind(drone.stage), behind(drone.rank.map(u32::from)), drone.drone));
        all
    }

    fn of_part(&self, part: &[usize]) -> Vec<UnfinishedDrone> {
        let places: Vec<_> = part.iter().map(|&drone| self.bodies[drone].position().xy()).collect();
        let dead: Vec<_> = goal_slots::dead(self.bodies).collect();
        let gaps = slot_gaps(self.params, &places, &self.condition.ground(self.params, &dead));
        let gap = |place: usize| gaps.as_ref().map(|gaps| gaps[place]);
        let drones = part.iter().enumerate().map(|(place, &drone)| (drone, gap(place)));
        drones.filter_map(|(drone, gap_m)| Some(self.describe(drone, self.lack(drone, gap_m)?, gap_m))).collect()
    }

    fn lack(&self, drone: usize, gap_m: Option<f64>) -> Option<Lack> {
        let outside = gap_m.is_none_or(|gap_m| gap_m > self.params.arrival_error_m);
        let body = &self.bodies[drone];
        match self.params.end {
            End::Hold { .. } if !self.condition.is_past(drone) => Some(Lack::Pass),
            End::Hold { .. } if outside => Some(Lack::Slot),
            End::Hold { .. } => (!EndCondition::is_slow(self.params, body)).then_some(Lack::Stop),
            End::Goal { .. } => outside.then_some(Lack::Slot),
            End::Pilots => (!self.processes[drone].slot().is_done()).then_some(Lack::Done),
            End::Time { .. } => None,
        }
    }

    fn describe(&self, drone: usize, lack: Lack, slot_distance_m: Option<f64>) -> UnfinishedDrone {
        let slot = self.processes[drone].slot();
        let route = (slot.is_queued() && slot.route != NO_ROUTE).then_some(slot.route);
        UnfinishedDrone {
            drone: DroneId(drone as u32),
            lack,
            slot_distance_m,
            still_s: self.stillness.still_s(drone, self.now),
            stage: self.stages.ahead_of(self.stages.along_m(&self.bodies[drone])),
            group: slot.group.to_string(),
            leader: slot.obeyed.ballot.is_some().then_some(slot.obeyed.ballot.claimant),
            phase: slot.phase(),
            route,
            rank: route.map(|_| slot.rank),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Outline;
    use crate::testing::{bodies, params, rectangle, starts};
    use skein_protocol::slot::{SLOT_DONE, SLOT_QUEUED, Slot};
    use skein_protocol::{Ballot, PlanStamp, Vec2, Vec3};

    fn formed(count: usize) -> Vec<Body> {
        starts(count).into_iter().map(|(place, _)| Body::new(place, Vec3::zeros())).collect()
    }

    fn found(end: End, bodies: &[Body], slots: &[Slot]) -> Vec<UnfinishedDrone> {
        let params = WorldParams { end, ..params() };
        let outline = Outline::new(&rectangle(0.0, 0.0, 10.0, 10.0));
        let (stages, mut condition) = (Stages::sensed(&[outline], 40.0), EndCondition::default());
        let mut processes = vec![Process::default(); bodies.len()];
        for (process, slot) in processes.iter_mut().zip(slots) {
            process.take(slot);
        }
        let all = [(0..bodies.len()).collect::<Vec<usize>>()];
        condition.is_met(&params, bodies, &stages, &all);
        let stillness = Stillness::new(bodies, 1.0);
        let now = SimTime::from_secs(30.0);
        let (bodies, processes) = (bodies, &processes[..]);
        Unfinished {
            params: &params,
            bodies,
            processes,
            condition: &condition,
            stages: &stages,
            stillness: &stillness,
            now,
        }
        .drones(&all)
    }

    #[test]
    fn a_drone_away_from_its_slot_is_named_with_what_it_obeys() {
        let mut all = formed(8);
        all[3] = bodies(&[[-100.0, 80.0]])[0];
        let obeyed = PlanStamp { ballot: Ballot { round: 1, incarnation: 1, claimant: DroneId(5) }, epoch: 2 };
        let mut slots = [Slot::default(); 8];
        slots[3] = Slot { flags: SLOT_QUEUED, route: 1, rank: 2, obeyed, ..Slot::default() };
        let late = found(End::Goal { front_m: Vec2::zeros() }, &all, &slots);
        let [late] = &late[..] else { panic!("{late:?}") };
        assert_eq!((late.drone, late.lack, late.stage, late.still_s), (DroneId(3), Lack::Slot, Some(0), 30.0));
        assert_eq!((late.route, late.rank, late.leader), (Some(1), Some(2), Some(DroneId(5))));
        assert!(late.slot_distance_m.is_some_and(|gap_m| gap_m > 50.0), "{late:?}");
    }

    #[test]
    fn drones_that_have_not_passed_or_not_stopped_are_told_apart() {
        let hold = End::Hold { stop_x_m: -1e9 };
        // Those behind x = 10 m have not passed, although they are in their slots.
        let lacks = |all: &[Body]| found(hold, all, &[]).iter().map(|late| late.lack).collect::<Vec<_>>();
        assert_eq!(lacks(&formed(8)), [Lack::Pass; 8]);
        let ahead = Vec3::new(500.0, 0.0, 0.0);
        let mut all: Vec<Body> =
            formed(8).iter().map(|body| Body::new(body.position() + ahead, Vec3::zeros())).collect();
        assert_eq!(lacks(&all), []);
        all[2] = Body::new(all[2].position(), Vec3::new(0.0, 1.1, 0.0));
        assert_eq!(lacks(&all), [Lack::Stop]);
    }

    #[test]
    fn pilots_that_are_not_done_are_named_and_a_time_names_nobody() {
        let slots = [Slot { flags: SLOT_DONE, ..Slot::default() }, Slot::default()];
        let late = found(End::Pilots, &formed(2), &slots);
        assert_eq!(late.iter().map(|late| (late.drone, late.lack)).collect::<Vec<_>>(), [(DroneId(1), Lack::Done)]);
        assert_eq!(found(End::Time { duration_s: 1e3 }, &formed(2), &slots), []);
    }
}
