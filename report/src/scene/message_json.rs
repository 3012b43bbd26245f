//! The content of a message as JSON, for tools: enums by name, groups by lineage, times in seconds. What a field has as "none",
//! "not known" or "never" is null.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use skein_protocol::payload::{
    Arrivals, Assignment, Leadership, MAX_ROUTES, MAX_SET, NO_ROUTE, Obstacle, Passed, Plan, Pose, Presence,
    QueuePlace, Separation, Separator,
};
use skein_protocol::{Ballot, DroneId, Message, ObstacleId, PlanStamp, UserMessage};

/// The fields of a message. SI units, world frame.
#[must_use]
pub fn message_json(message: &Message) -> Value {
    match message {
        Message::Pose(pose) => of_pose(pose),
        Message::Obstacle(obstacle) => of_obstacle(obstacle),
        Message::Leadership(leadership) => of_leadership(leadership),
        Message::Plan(plan) => of_plan(plan),
        Message::Assignment(assignment) => of_assignment(assignment),
        Message::AssignmentList(list) => {
            json!({ "assignments": list.assignments().map(|part| of_assignment(&part)).collect::<Vec<_>>() })
        }
        Message::Arrivals(arrivals) => of_arrivals(arrivals),
        Message::Passed(passed) => of_passed(passed),
        Message::Presence(presence) => of_presence(presence),
        Message::Separation(separation) => of_separation(separation),
        Message::User(message) => of_user(message),
    }
}

fn of_pose(pose: &Pose) -> Value {
    let place = |place: &QueuePlace| {
        let rank = (place.rank != QueuePlace::NO_RANK).then_some(place.rank);
        json!({ "set": place.set, "route": route(place.route), "rank": rank, "remaining_m": place.remaining_m })
    };
    let queue: Vec<Value> = pose.queue.iter().filter(|place| place.set != 0).map(place).collect();
    json!({
        "stamp_s": pose.stamp.secs(), "position_m": pose.position_m, "velocity_mps": pose.velocity_mps, "queue": queue,
        "obeyed": stamp(pose.obeyed), "group": pose.group.to_string(), "term": ballot(pose.term),
        "incarnation": pose.incarnation, "leads": pose.leads(), "impaired": pose.is_impaired(), "before": pose.is_before(),
    })
}

fn of_obstacle(obstacle: &Obstacle) -> Value {
    let shape = &obstacle.shape;
    let count = (shape.count as usize).min(shape.vertices_m.len());
    json!({
        "obstacle": obstacle.id, "witness": obstacle.witness, "vertices_m": &shape.vertices_m[..count],
        "radius_m": shape.radius_m,
    })
}

fn of_leadership(leadership: &Leadership) -> Value {
    json!({
        "stamp_s": leadership.stamp.secs(), "ballot": ballot(leadership.ballot), "kind": leadership.kind(),
        "group": leadership.group.to_string(), "epoch": leadership.epoch, "heir": leadership.heir,
        "hops": leadership.hops,
    })
}

fn of_plan(plan: &Plan) -> Value {
    json!({
        "stamp_s": plan.stamp.secs(), "plan": stamp(plan.id), "group": plan.group.to_string(), "phase": plan.phase(),
        "members": plan.members, "anchor_m": plan.anchor_m, "anchor_mps": plan.anchor_mps,
        "anchor_stop_x_m": finite(plan.anchor_stop_x_m), "course": plan.course(), "predicted_s": finite(plan.predicted_s),
        "candidates": plan.candidates, "routes": plan.routes, "obstacles": set(plan.set_count, &plan.set),
    })
}

fn of_assignment(assignment: &Assignment) -> Value {
    json!({
        "plan": stamp(assignment.id), "scope": assignment.scope.to_string(), "group": assignment.group.to_string(),
        "drone": assignment.drone, "leader": assignment.leader, "slot_m": assignment.slot_m,
        "arrival_s": finite(assignment.arrival_s), "route": route(assignment.route), "rank": assignment.rank,
    })
}

fn of_arrivals(arrivals: &Arrivals) -> Value {
    let count = (arrivals.routes as usize).min(MAX_ROUTES);
    let gates: Vec<Option<f64>> = arrivals.gate_s[..count].iter().map(|&gate_s| finite(f64::from(gate_s))).collect();
    json!({
        "stamp_s": arrivals.stamp.secs(), "ballot": ballot(arrivals.ballot), "drone": arrivals.drone,
        "group": arrivals.group.to_string(), "set": arrivals.set, "kind": arrivals.kind(), "gate_s": gates,
    })
}

fn of_separation(separation: &Separation) -> Value {
    let entry = |s: &Separator| {
        json!({
            "peer": s.peer.0,
            "number": s.number,
            "stamp_s": s.stamp.secs(),
            "angle_rad": s.angle_rad,
            "stop_m": s.stop_m,
            "speed_mps": s.speed_mps,
            "deceleration_mps2": s.deceleration_mps2,
            "incarnation": s.incarnation,
            "peer_incarnation": s.peer_incarnation,
        })
    };
    json!({ "separators": separation.separators().iter().map(entry).collect::<Vec<_>>() })
}

fn of_passed(passed: &Passed) -> Value {
    json!({ "stamp_s": passed.stamp.secs(), "drone": passed.of.checked_sub(1), "obstacles": set(passed.set_count, &passed.set) })
}

fn of_presence(presence: &Presence) -> Value {
    let drone = |(id, pose): (DroneId, Pose)| {
        json!({
            "drone": id, "stamp_s": pose.stamp.secs(), "position_m": pose.position_m, "velocity_mps": pose.velocity_mps,
            "incarnation": pose.incarnation, "leads": pose.leads(), "impaired": pose.is_impaired(), "before": pose.is_before(),
        })
    };
    json!({
        "obeyed": stamp(presence.obeyed), "group": presence.group.to_string(), "term": ballot(presence.term),
        "drones": presence.poses().map(drone).collect::<Vec<_>>(),
    })
}

/// A message of a pilot's own: its bytes in Base64, and as text if they are text.
fn of_user(message: &UserMessage) -> Value {
    let bytes = message.bytes();
    json!({ "topic": message.topic().to_string(), "text": str::from_utf8(bytes).ok(), "base64": STANDARD.encode(bytes) })
}

fn ballot(ballot: Ballot) -> Option<Ballot> {
    ballot.is_some().then_some(ballot)
}

fn stamp(stamp: PlanStamp) -> Option<PlanStamp> {
    stamp.ballot.is_some().then_some(stamp)
}

fn route(route: u16) -> Option<u16> {
    (route != NO_ROUTE).then_some(route)
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn set(count: u32, set: &[ObstacleId; MAX_SET]) -> &[ObstacleId] {
    &set[..(count as usize).min(MAX_SET)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::{DroneId, GroupId, LeadershipKind, Phase, SimTime};

    #[test]
    fn what_is_not_there_is_null() {
        let claim = Leadership {
            stamp: SimTime::from_secs(1.5),
            ballot: Ballot { round: 2, incarnation: 1, claimant: DroneId(3) },
            kind: LeadershipKind::Claim.to_wire() as u16,
            group: GroupId::ALL.child(1),
            epoch: 0,
            heir: DroneId::NONE,
            hops: 0,
        };
        let ballot = json!({ "round": 2, "incarnation": 1, "claimant": 3 });
        let wanted = json!({
            "stamp_s": 1.5, "ballot": ballot, "kind": "claim", "group": "N1", "epoch": 0, "heir": null,
            "hops": 0,
        });
        assert_eq!(message_json(&Message::Leadership(claim)), wanted);
        let plan = Plan {
            stamp: SimTime::ZERO,
            id: PlanStamp { ballot: claim.ballot, epoch: 1 },
            group: GroupId::ALL,
            phase: Phase::Cruise.to_wire(),
            members: 2,
            anchor_m: [0.0; 2],
            anchor_mps: [10.0, 0.0],
            anchor_stop_x_m: f64::INFINITY,
            predicted_s: f64::NAN,
            candidates: 0,
            routes: 0,
            set_count: 1,
            set: [ObstacleId(4); MAX_SET],
            course: 0,
        };
        let plan = message_json(&Message::Plan(plan));
        assert_eq!((&plan["anchor_stop_x_m"], &plan["predicted_s"]), (&Value::Null, &Value::Null));
        assert_eq!((&plan["phase"], &plan["obstacles"]), (&json!("cruise"), &json!([4])));
    }
}
