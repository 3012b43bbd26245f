//! What a drone broadcasts, and when: its beacon, its plan, and repetitions of what others may have missed.

use crate::knowledge::Knowledge;
use crate::obstacles::{Obstacles, set_array, set_ids};
use crate::own_state::OwnState;
use crate::plan_bundle::PlanBundle;
use skein_protocol::payload::{MAX_PLACES, Obstacle, POSE_IMPAIRED, POSE_LEADS, Passed, Pose, QueuePlace};
use skein_protocol::{DroneId, Message, ObstacleId, Phase, PlanStamp, SimTime, flag};

/// The broadcasts of one drone: their periods, and what was said when.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Broadcaster {
    beacon_ticks: u64,
    repeat_s: f64,
    /// Whether the first beacon was said.
    spoken: bool,
    next_repeat: SimTime,
    /// The last plan of its own whose assignments it has said in full.
    announced: PlanStamp,
}

/// What is said of a bundle's assignments.
#[derive(Clone, Copy)]
struct Extent {
    /// All assignments, not only those of drones that obey an older plan.
    all: bool,
    /// The plan itself, too.
    plan: bool,
}

impl Broadcaster {
    /// Nothing said yet, at the time `start`; a tick takes `dt_s`.
    pub(crate) fn new(start: SimTime, dt_s: f64, beacon_period_s: f64, repeat_s: f64) -> Self {
        Self {
            beacon_ticks: ((beacon_period_s / dt_s).round() as u64).max(1),
            repeat_s,
            spoken: false,
            next_repeat: start,
            announced: PlanStamp::default(),
        }
    }

    /// Makes the next repetition due at once: something new is known.
    pub(crate) fn hurry(&mut self) {
        self.next_repeat = SimTime::ZERO;
    }

    /// Says what is due; `places` are this drone's places in queues. Call once per tick.
    pub(crate) fn speak(
        &mut self,
        k: &Knowledge,
        now: SimTime,
        own: &OwnState,
        places: &[QueuePlace; MAX_PLACES],
        say: &mut Vec<Message>,
    ) {
        if self.beacon_due(own.tick, k.me()) {
            say.push(Message::Pose(pose(k, now, own, places)));
        }
        if !self.repeat_due(now) {
            return;
        }
        say_obstacles(k, say);
        say_passed(k, now, own, say);
        if k.election().leads() {
            self.say_plans(k, now, say);
        }
    }

    /// Whether a beacon is due. The beacons of different drones fall into different ticks. The first one is said at once,
    /// so that all drones know each other.
    fn beacon_due(&mut self, tick: u64, me: DroneId) -> bool {
        let first = !std::mem::replace(&mut self.spoken, true);
        first || tick % self.beacon_ticks == u64::from(me.0) % self.beacon_ticks
    }

    fn repeat_due(&mut self, now: SimTime) -> bool {
        let due = now >= self.next_repeat;
        if due {
            self.next_repeat = now.after(self.repeat_s);
        }
        due
    }

    /// Says the leader's own plan: the assignments of all drones when it is new, later those of drones whose beacons do
    /// not show that they obey it. A plan of an earlier leader, which split the group, is repeated only for drones that
    /// missed it.
    fn say_plans(&mut self, k: &Knowledge, now: SimTime, say: &mut Vec<Message>) {
        let Some(bundle) = k.ledger().obeyed() else { return };
        let own = bundle.plan.id.ballot == k.election().obeyed();
        let new = own && self.announced != bundle.plan.id;
        if own {
            say.push(Message::Plan(bundle.plan));
        }
        if own || bundle.plan.group != k.election().scope() {
            say_parts(k, bundle, now, Extent { all: new, plan: !own }, say);
        }
        if let Some(origin) = k.ledger().origin() {
            say_parts(k, origin, now, Extent { all: false, plan: true }, say);
        }
        if own {
            self.announced = bundle.plan.id;
        }
    }
}

/// The beacon of this drone.
fn pose(k: &Knowledge, now: SimTime, own: &OwnState, places: &[QueuePlace; MAX_PLACES]) -> Pose {
    Pose {
        stamp: now,
        position_m: own.position.into(),
        velocity_mps: own.velocity.into(),
        queue: *places,
        obeyed: k.ledger().stamp(),
        group: k.ledger().group(),
        term: k.election().obeyed(),
        incarnation: k.incarnation(),
        flags: flag(k.election().leads(), POSE_LEADS) | flag(k.is_impaired(), POSE_IMPAIRED),
        reserved: 0,
    }
}

/// Repeats the obstacles that no plan covers yet, so that the leader learns what any member senses.
fn say_obstacles(k: &Knowledge, say: &mut Vec<Message>) {
    let planned = |id: ObstacleId| k.ledger().sets().iter().any(|set| set.ids.contains(&id));
    let known = k.obstacles().iter().map(|(id, _)| id);
    let open = known.filter(|&id| !planned(id) && !k.obstacles().has_passed(k.me(), id));
    say.extend(open.filter_map(|id| obstacle(k.obstacles(), id)));
}

/// Says which sets this drone has passed, until the swarm re-forms.
fn say_passed(k: &Knowledge, now: SimTime, own: &OwnState, say: &mut Vec<Message>) {
    for set in k.ledger().sets().iter().filter(|set| own.position.x >= set.routes.exit_x_m()) {
        let (ids, set_count) = set_array(&set.ids);
        say.push(Message::Passed(Passed { stamp: now, set_count, set: ids, reserved: 0 }));
    }
}

/// Says assignments of a bundle, to the given extent, with the obstacles that their drones may not know. Says nothing if
/// there is no assignment to be said.
fn say_parts(k: &Knowledge, bundle: &PlanBundle, now: SimTime, extent: Extent, say: &mut Vec<Message>) {
    let (stamp, peers) = (bundle.plan.id, k.peers());
    let late = |id: DroneId| peers.is_living(id, now) && peers.last(id).is_some_and(|pose| pose.obeyed < stamp);
    let first = say.len();
    let parts = bundle.parts.iter().filter(|part| extent.all || late(part.drone));
    say.extend(parts.map(|part| Message::Assignment(*part)));
    if say.len() == first {
        return;
    }
    if extent.plan {
        say.push(Message::Plan(bundle.plan));
    }
    if bundle.plan.phase() == Phase::Avoid {
        let ids = set_ids(&bundle.plan.set, bundle.plan.set_count);
        say.extend(ids.iter().filter_map(|&id| obstacle(k.obstacles(), id)));
    }
}

/// The message about a known obstacle.
fn obstacle(obstacles: &Obstacles, id: ObstacleId) -> Option<Message> {
    let known = obstacles.get(id)?;
    Some(Message::Obstacle(Obstacle { shape: known.shape, id, witness: known.witness }))
}
