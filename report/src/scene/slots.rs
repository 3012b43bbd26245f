//! The current positions of the drones' slots, from the plans and assignments that leaders send.

use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::payload::{Assignment, Plan};
use skein_protocol::record::DroneRow;
use skein_protocol::{Message, Phase, PlanStamp, SimTime, Vec2};
use std::collections::BTreeMap;

/// The plans that were sent, and the latest assignment of each drone.
#[derive(Debug, Default)]
pub(super) struct Slots {
    plans: BTreeMap<PlanStamp, Plan>,
    assignments: Vec<Option<Assignment>>,
}

impl Slots {
    /// Takes the frames of a tick. Forgets superseded plans that no drone obeys any more.
    pub(super) fn take_frames(&mut self, frames: &[AirFrame], rows: &[DroneRow]) {
        self.assignments.resize(rows.len(), None);
        let mut planned = false;
        let of_plan = |frame: &&AirFrame| [Topic::Plan as u16, Topic::Assignment as u16].contains(&frame.frame.kind);
        for frame in frames.iter().filter(of_plan) {
            match Message::decode(&frame.frame) {
                Ok(Message::Plan(plan)) => planned |= self.plans.insert(plan.id, plan).is_none(),
                Ok(Message::Assignment(assignment)) => {
                    if let Some(place) = self.assignments.get_mut(assignment.drone.index())
                        && place.is_none_or(|known| known.id <= assignment.id)
                    {
                        *place = Some(assignment);
                    }
                }
                // Malformed: its receivers count it.
                _ => {}
            }
        }
        if planned {
            let newest = self.plans.last_key_value().map(|(id, _)| *id);
            self.plans.retain(|id, _| Some(*id) >= newest || rows.iter().any(|row| row.obeyed == *id));
        }
    }

    /// Position of a drone's slot, world frame, m. `None` while the drone avoids obstacles, or if the slot is not known.
    pub(super) fn of(&self, drone: usize, row: &DroneRow, now: SimTime) -> Option<Vec2> {
        let assignment = self.assignments.get(drone).copied().flatten().filter(|known| known.id == row.obeyed)?;
        let plan = self.plans.get(&assignment.id).filter(|plan| plan.phase() != Phase::Avoid)?;
        let (anchor, _) = plan.anchor_at(now);
        Some(anchor + Vec2::from(assignment.slot_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::row;
    use skein_protocol::payload::{MAX_SET, NO_ROUTE};
    use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId};

    fn sent(message: Message) -> AirFrame {
        AirFrame {
            tick: 0,
            source: DroneId(0),
            sequence: 0,
            position_m: [0.0, 0.0, 50.0],
            queue_ns: 0,
            link_faults: Default::default(),
            frame: message.encode(),
        }
    }

    #[test]
    fn a_slot_moves_with_its_anchor_until_that_stops() {
        let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(0) };
        let id = PlanStamp { ballot, epoch: 1 };
        let plan = Plan {
            stamp: SimTime::ZERO,
            id,
            group: GroupId::ALL,
            phase: Phase::Cruise.to_wire(),
            members: 1,
            anchor_m: [0.0, 5.0],
            anchor_mps: [10.0, 0.0],
            anchor_stop_x_m: 15.0,
            predicted_s: f64::NAN,
            candidates: 0,
            routes: 0,
            set_count: 0,
            set: [ObstacleId(0); MAX_SET],
            course: 0,
        };
        let assignment = Assignment {
            id,
            scope: GroupId::ALL,
            group: GroupId::ALL,
            drone: DroneId(1),
            leader: DroneId(0),
            slot_m: [-3.0, 1.0],
            arrival_s: 0.0,
            route: NO_ROUTE,
            rank: 0,
            reserved: 0,
        };
        let rows = [row(0.0, 0.0), DroneRow { obeyed: id, ..row(0.0, 0.0) }];
        let mut slots = Slots::default();
        slots.take_frames(&[sent(Message::Plan(plan)), sent(Message::Assignment(assignment))], &rows);
        let at = |s: f64| slots.of(1, &rows[1], SimTime::from_secs(s));
        assert_eq!(at(1.0), Some(Vec2::new(7.0, 6.0)));
        assert_eq!(at(9.0), Some(Vec2::new(12.0, 6.0)));
        assert_eq!(slots.of(1, &rows[0], SimTime::ZERO), None);
        assert_eq!(slots.of(0, &rows[0], SimTime::ZERO), None);
    }
}
