//! Who leads and what leaders decided, logged when the world first sees it.

use crate::event_log::EventLog;
use skein_protocol::frame::AirFrame;
use skein_protocol::message::Topic;
use skein_protocol::payload::{Assignment, NO_ROUTE, Plan};
use skein_protocol::record::EventKind;
use skein_protocol::slot::Slot;
use skein_protocol::{Ballot, DroneId, GroupId, Message, Phase, PlanStamp, SimTime};
use std::collections::BTreeSet;

/// What has been logged about one drone as a leader. Only its latest plan counts: a superseded plan never comes back.
#[derive(Clone, Debug, Default)]
struct LoggedLeader {
    /// The group it leads, and the ballot of its term.
    leading: Option<(GroupId, Ballot)>,
    plan: PlanStamp,
    /// Whether the grouping of the plan has been logged.
    grouping: bool,
    /// The drones whose assignments of the plan have been logged.
    assigned: BTreeSet<DroneId>,
}

impl LoggedLeader {
    /// Whether `plan` is the latest plan. A later one becomes the latest.
    fn is_current(&mut self, plan: PlanStamp) -> bool {
        if plan > self.plan {
            self.plan = plan;
            self.grouping = false;
            self.assigned.clear();
        }
        plan == self.plan
    }
}

/// What has been logged about every drone as a leader.
#[derive(Clone, Debug)]
pub(crate) struct DecisionLog(Vec<LoggedLeader>);

impl DecisionLog {
    /// Nothing logged yet, for this number of drones.
    pub(crate) fn new(drones: usize) -> Self {
        Self(vec![LoggedLeader::default(); drones])
    }

    /// Forgets a drone whose process is gone: everything that its next process says is new. The end of its leadership is
    /// not logged, because the fault is.
    pub(crate) fn forget(&mut self, drone: DroneId) {
        self.0[drone.index()] = LoggedLeader::default();
    }

    /// Logs that a drone begins or stops leading.
    pub(crate) fn follow_slot(&mut self, drone: DroneId, slot: &Slot, at: SimTime, log: &mut EventLog) {
        let leads = slot.leads().then_some((slot.led, slot.term));
        let before = std::mem::replace(&mut self.0[drone.index()].leading, leads);
        if before == leads {
            return;
        }
        for (term, leads) in [(before, false), (leads, true)] {
            if let Some((group, ballot)) = term {
                log.push(at, EventKind::Leader { group: group.to_string(), ballot, leader: drone, leads });
            }
        }
    }

    /// Logs a plan or an assignment that is sent for the first time.
    pub(crate) fn follow_frame(&mut self, sent: &AirFrame, at: SimTime, log: &mut EventLog) {
        if ![Topic::Plan as u16, Topic::Assignment as u16].contains(&sent.frame.kind) {
            return;
        }
        match Message::decode(&sent.frame) {
            Ok(Message::Plan(plan)) => self.follow_plan(&plan, at, log),
            Ok(Message::Assignment(part)) => self.follow_assignment(&part, at, log),
            _ => {} // The frame is malformed. Its receivers count it.
        }
    }

    fn follow_plan(&mut self, plan: &Plan, at: SimTime, log: &mut EventLog) {
        let Some(logged) = self.0.get_mut(plan.id.ballot.claimant.index()) else { return };
        if logged.is_current(plan.id) && !std::mem::replace(&mut logged.grouping, true) {
            log.push(at, grouping(plan));
        }
    }

    fn follow_assignment(&mut self, part: &Assignment, at: SimTime, log: &mut EventLog) {
        let drones = self.0.len();
        let Some(logged) = self.0.get_mut(part.id.ballot.claimant.index()) else { return };
        if part.drone.index() < drones && logged.is_current(part.id) && logged.assigned.insert(part.drone) {
            log.push(at, assigned(part));
        }
    }
}

fn grouping(plan: &Plan) -> EventKind {
    // A formation names those that are passed.
    let ahead = plan.set.iter().filter(|_| plan.phase() == Phase::Avoid);
    EventKind::Grouping {
        plan: plan.id,
        group: plan.group.to_string(),
        phase: plan.phase(),
        members: plan.members,
        routes: plan.routes,
        obstacles: ahead.take(plan.set_count as usize).copied().collect(),
        predicted_s: plan.predicted_s.is_finite().then_some(plan.predicted_s),
    }
}

fn assigned(part: &Assignment) -> EventKind {
    EventKind::Assigned {
        plan: part.id,
        drone: part.drone,
        group: part.group.to_string(),
        leader: part.leader,
        route: (part.route != NO_ROUTE).then_some(part.route),
        rank: part.rank,
        slot_m: part.slot_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event_log::tests::read;
    use crate::testing::event_kinds;
    use skein_protocol::payload::MAX_SET;
    use skein_protocol::slot::SLOT_LEADS;
    use skein_protocol::{ObstacleId, Phase};

    fn stamp(round: u32, epoch: u32) -> PlanStamp {
        PlanStamp { ballot: Ballot { round, incarnation: 1, claimant: DroneId(2) }, epoch }
    }

    fn on_air(message: Message) -> AirFrame {
        AirFrame {
            tick: 0,
            source: DroneId(2),
            sequence: 0,
            position_m: [0.0; 3],
            queue_ns: 0,
            link_faults: Default::default(),
            frame: message.encode(),
        }
    }

    fn plan(id: PlanStamp, phase: Phase) -> AirFrame {
        let mut set = [ObstacleId(0); MAX_SET];
        set[0] = ObstacleId(4);
        on_air(Message::Plan(Plan {
            stamp: SimTime::ZERO,
            id,
            group: GroupId::ALL,
            phase: phase.to_wire(),
            members: 8,
            anchor_m: [0.0; 2],
            anchor_mps: [10.0, 0.0],
            anchor_stop_x_m: f64::INFINITY,
            predicted_s: if phase == Phase::Avoid { 28.5 } else { f64::NAN },
            candidates: 0,
            routes: 2,
            set_count: 1,
            set,
            course: 0,
        }))
    }

    fn assignment(id: PlanStamp, drone: u32, route: u16) -> AirFrame {
        on_air(Message::Assignment(Assignment {
            id,
            scope: GroupId::ALL,
            group: GroupId::ALL.child(1),
            drone: DroneId(drone),
            leader: DroneId(2),
            slot_m: [1.0, 2.0],
            arrival_s: 0.0,
            route,
            rank: 3,
            reserved: 0,
        }))
    }

    fn logged(frames: &[AirFrame]) -> Vec<EventKind> {
        let (mut decisions, mut log) = (DecisionLog::new(8), EventLog::default());
        for frame in frames {
            decisions.follow_frame(frame, SimTime::ZERO, &mut log);
        }
        event_kinds(read(&mut log))
    }

    #[test]
    fn repeated_plans_and_assignments_are_logged_once() {
        let (first, second) = (stamp(1, 1), stamp(1, 2));
        let events = logged(&[
            assignment(first, 5, 1),
            plan(first, Phase::Avoid),
            plan(first, Phase::Avoid),
            assignment(first, 5, 1),
            plan(second, Phase::Reform),
            plan(first, Phase::Avoid),
            assignment(second, 5, NO_ROUTE),
        ]);
        assert_eq!(events.len(), 4);
        let EventKind::Assigned { route: Some(1), rank: 3, group, .. } = &events[0] else { panic!("{:?}", events[0]) };
        assert_eq!(group, "N1");
        let EventKind::Grouping { phase, obstacles, predicted_s, .. } = &events[1] else { panic!("{:?}", events[1]) };
        assert_eq!((*phase, &obstacles[..], *predicted_s), (Phase::Avoid, &[ObstacleId(4)][..], Some(28.5)));
        assert!(matches!(&events[2], EventKind::Grouping { phase, predicted_s: None, .. } if *phase == Phase::Reform));
        assert!(matches!(events[3], EventKind::Assigned { route: None, .. }));
    }

    #[test]
    fn malformed_and_foreign_frames_are_no_decisions() {
        let mut malformed = plan(stamp(1, 1), Phase::Avoid);
        malformed.frame.len = 3;
        let stranger = PlanStamp { ballot: Ballot { claimant: DroneId(99), ..stamp(1, 1).ballot }, epoch: 1 };
        assert_eq!(logged(&[malformed, plan(stranger, Phase::Avoid), assignment(stamp(1, 1), 99, 0)]), []);
    }

    #[test]
    fn leadership_is_logged_when_it_begins_changes_and_ends() {
        let (mut decisions, mut log) = (DecisionLog::new(8), EventLog::default());
        let leads = Slot { flags: SLOT_LEADS, term: stamp(1, 1).ballot, obeyed: stamp(1, 1), ..Slot::default() };
        let next_plan = Slot { obeyed: stamp(1, 2), ..leads };
        let next_term = Slot { term: stamp(2, 1).ballot, ..leads };
        for slot in [leads, next_plan, next_term, Slot::default()] {
            decisions.follow_slot(DroneId(2), &slot, SimTime::ZERO, &mut log);
        }
        let event = |round, leads| EventKind::Leader {
            group: "N".into(),
            ballot: stamp(round, 1).ballot,
            leader: DroneId(2),
            leads,
        };
        assert_eq!(event_kinds(read(&mut log)), [event(1, true), event(1, false), event(2, true), event(2, false)]);
    }
}
