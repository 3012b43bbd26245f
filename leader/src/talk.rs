//! What a drone says, and when: its beacon, what it leads with, and repetitions of whatever others may have missed.

use crate::leading::{Leading, Own};
use crate::obstacles::{Obstacles, set_array, set_ids};
use crate::plan_bundle::PlanBundle;
use skein_protocol::payload::{MAX_PLACES, Obstacle, POSE_IMPAIRED, POSE_LEADS, Passed, Pose, QueuePlace};
use skein_protocol::{DroneId, Message, ObstacleId, Phase, PlanStamp, SimTime, flag};

/// Periods, and what was said when.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Talk {
    beacon_ticks: u64,
    repeat_s: f64,
    spoken: bool,
    next_repeat: SimTime,
    told: PlanStamp,
}

impl Talk {
    /// Nothing said yet.
    pub fn new(start: SimTime, dt_s: f64, beacon_period_s: f64, repeat_s: f64) -> Self {
        Self {
            beacon_ticks: ((beacon_period_s / dt_s).round() as u64).max(1),
            repeat_s,
            spoken: false,
            next_repeat: start,
            told: PlanStamp::default(),
        }
    }

    /// Something new is known: do not wait for the next repetition.
    pub fn hurry(&mut self) {
        self.next_repeat = SimTime::ZERO;
    }

    /// Whether a beacon is due. Those of different drones fall into different ticks; the very first is said at once, so
    /// that all are known.
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
}

impl Leading {
    /// Says what is due; `places` are this drone's places in queues.
    pub fn speak(&mut self, now: SimTime, own: &Own, places: &[QueuePlace; MAX_PLACES], say: &mut Vec<Message>) {
        if self.talk.beacon_due(own.tick, self.me) {
            say.push(Message::Pose(self.pose(now, own, places)));
        }
        if !self.talk.repeat_due(now) {
            return;
        }
        self.tell_obstacles(say);
        self.tell_passed(now, own, say);
        if self.election.leads() {
            self.tell_orders(now, say);
        }
    }

    fn pose(&self, now: SimTime, own: &Own, places: &[QueuePlace; MAX_PLACES]) -> Pose {
        Pose {
            stamp: now,
            position_m: own.position.into(),
            velocity_mps: own.velocity.into(),
            queue: *places,
            obeyed: self.ledger.stamp(),
            group: self.ledger.group(),
            term: self.election.obeyed(),
            incarnation: self.incarnation,
            flags: flag(self.election.leads(), POSE_LEADS) | flag(self.impaired, POSE_IMPAIRED),
            reserved: 0,
        }
    }

    /// Whoever knows an obstacle that no plan holds yet repeats it, so that the leader comes to know what any member
    /// senses.
    fn tell_obstacles(&self, say: &mut Vec<Message>) {
        let planned = |id: ObstacleId| self.ledger.sets().iter().any(|set| set.ids.contains(&id));
        let untold = self.obstacles.iter().map(|(id, _)| id);
        let untold = untold.filter(|&id| !planned(id) && !self.obstacles.has_passed(self.me, id));
        say.extend(untold.filter_map(|id| told(&self.obstacles, id)));
    }

    /// Says which sets it is past, until the swarm re-forms.
    fn tell_passed(&self, now: SimTime, own: &Own, say: &mut Vec<Message>) {
        for set in self.ledger.sets().iter().filter(|set| own.position.x >= set.routes.exit_x_m()) {
            let (ids, set_count) = set_array(&set.ids);
            say.push(Message::Passed(Passed { stamp: now, set_count, set: ids, reserved: 0 }));
        }
    }

    /// The plan of one's own; the parts of all when it is new, then of those whose beacons do not show that they obey
    /// it. A plan of the leader before, that split its group, is repeated for those alone who missed it.
    fn tell_orders(&mut self, now: SimTime, say: &mut Vec<Message>) {
        let Some(bundle) = self.ledger.obeyed() else { return };
        let own = bundle.plan.id.ballot == self.election.obeyed();
        let new = own && self.talk.told != bundle.plan.id;
        if own {
            say.push(Message::Plan(bundle.plan));
        }
        if own || bundle.plan.group != self.election.scope() {
            self.tell_parts(bundle, now, own, new, say);
        }
        if let Some(origin) = self.ledger.origin() {
            self.tell_parts(origin, now, false, false, say);
        }
        if own {
            self.talk.told = bundle.plan.id;
        }
    }

    /// The parts of all, or of living members that obey an older plan, with the obstacles they may not know; the plan
    /// itself unless it is `told` already.
    fn tell_parts(&self, bundle: &PlanBundle, now: SimTime, told_already: bool, all: bool, say: &mut Vec<Message>) {
        let stamp = bundle.plan.id;
        let late =
            |id: DroneId| self.peers.is_living(id, now) && self.peers.last(id).is_some_and(|pose| pose.obeyed < stamp);
        let first = say.len();
        say.extend(bundle.parts.iter().filter(|part| all || late(part.drone)).map(|part| Message::Assignment(*part)));
        if say.len() == first {
            return;
        }
        if !told_already {
            say.push(Message::Plan(bundle.plan));
        }
        if bundle.plan.phase() == Phase::Avoid {
            let ids = set_ids(&bundle.plan.set, bundle.plan.set_count);
            say.extend(ids.iter().filter_map(|&id| told(&self.obstacles, id)));
        }
    }
}

fn told(obstacles: &Obstacles, id: ObstacleId) -> Option<Message> {
    let known = obstacles.get(id)?;
    Some(Message::Obstacle(Obstacle { shape: known.shape, id, witness: known.witness }))
}
