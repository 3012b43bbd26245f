//! What a drone says, and when: its beacon, what it leads with, and repetitions of whatever others may have missed.

use crate::params::PilotParams;
use skein_leader::ledger::{Ledger, Orders};
use skein_leader::membership::Peers;
use skein_leader::obstacles::{Obstacles, set_array, set_ids};
use skein_protocol::downlink::Senses;
use skein_protocol::payload::{MAX_PLACES, Obstacle, PHASE_AVOID, POSE_LEADS, Passed, Pose, QueuePlace};
use skein_protocol::{Ballot, DroneId, GroupId, Message, ObstacleId, PlanStamp, SimTime};

/// What there is to tell.
#[derive(Clone, Copy, Debug)]
pub struct Topics<'a> {
    /// The plan it obeys.
    pub obeyed: PlanStamp,
    /// Its group.
    pub group: GroupId,
    /// Whether it leads.
    pub leads: bool,
    /// Its places in queues.
    pub places: [QueuePlace; MAX_PLACES],
    /// Plans.
    pub ledger: &'a Ledger,
    /// Obstacles.
    pub obstacles: &'a Obstacles,
    /// Peers.
    pub peers: &'a Peers,
    /// The term it obeys, or leads in.
    pub ballot: Ballot,
}

/// Periods, and what was said when.
#[derive(Clone, Debug)]
pub struct Talk {
    me: DroneId,
    incarnation: u32,
    beacon_ticks: u64,
    repeat_s: f64,
    spoken: bool,
    next_repeat: SimTime,
    told: PlanStamp,
}

impl Talk {
    /// Nothing said yet.
    #[must_use]
    pub fn new(params: &PilotParams) -> Self {
        Self {
            me: params.me,
            incarnation: params.incarnation,
            beacon_ticks: ((params.beacon_period_s / params.dt_s).round() as u64).max(1),
            repeat_s: params.repeat_period_s,
            spoken: false,
            next_repeat: params.start,
            told: PlanStamp::default(),
        }
    }

    /// Something new is known: do not wait for the next repetition.
    pub fn hurry(&mut self) {
        self.next_repeat = SimTime::ZERO;
    }

    /// Says what is due.
    pub fn speak(&mut self, senses: &Senses<'_>, topics: &Topics<'_>, say: &mut Vec<Message>) {
        // Beacons of different drones fall into different ticks; the very first is said at once, so that all are known.
        if !self.spoken || senses.tick % self.beacon_ticks == u64::from(self.me.0) % self.beacon_ticks {
            self.spoken = true;
            say.push(Message::Pose(self.pose(senses, topics)));
        }
        if senses.now < self.next_repeat {
            return;
        }
        self.next_repeat = senses.now.after(self.repeat_s);
        self.tell_obstacles(topics, say);
        tell_passed(senses, topics, say);
        if let Some(orders) = topics.ledger.obeyed().filter(|o| topics.leads && o.plan.id.ballot == topics.ballot) {
            self.tell_orders(orders, topics, say);
        }
    }

    fn pose(&self, senses: &Senses<'_>, topics: &Topics<'_>) -> Pose {
        Pose {
            stamp: senses.now,
            position_m: senses.position.into(),
            velocity_mps: senses.velocity.into(),
            queue: topics.places,
            obeyed: topics.obeyed,
            group: topics.group,
            incarnation: self.incarnation,
            flags: if topics.leads { POSE_LEADS } else { 0 },
        }
    }

    /// Whoever knows an obstacle that no plan holds yet repeats it, so that the leader comes to know what any member
    /// senses.
    fn tell_obstacles(&self, topics: &Topics<'_>, say: &mut Vec<Message>) {
        let planned = |id: ObstacleId| topics.ledger.sets().iter().any(|set| set.ids.contains(&id));
        let untold =
            topics.obstacles.iter().filter(|(id, _)| !planned(*id) && !topics.obstacles.has_passed(self.me, *id));
        say.extend(
            untold.map(|(id, known)| Message::Obstacle(Obstacle { shape: known.shape, id, witness: known.witness })),
        );
    }

    /// The plan; the parts of all when it is new, then of those whose beacons do not show that they obey it, with the
    /// obstacles they may not know.
    fn tell_orders(&mut self, orders: &Orders, topics: &Topics<'_>, say: &mut Vec<Message>) {
        let stamp = orders.plan.id;
        let new = self.told != stamp;
        self.told = stamp;
        say.push(Message::Plan(orders.plan));
        let behind = |id: &DroneId| new || topics.peers.last(*id).is_some_and(|pose| pose.obeyed != stamp);
        let first = say.len();
        say.extend(orders.parts.iter().filter(|(id, _)| behind(id)).map(|(_, part)| Message::Assignment(*part)));
        if say.len() > first && orders.plan.phase == PHASE_AVOID {
            let ids = set_ids(&orders.plan.set, orders.plan.set_count);
            say.extend(
                ids.iter()
                    .filter_map(|&id| topics.obstacles.get(id).map(|known| (id, known)))
                    .map(|(id, known)| Message::Obstacle(Obstacle { shape: known.shape, id, witness: known.witness })),
            );
        }
    }
}

/// Says which sets it is past, until the swarm re-forms.
fn tell_passed(senses: &Senses<'_>, topics: &Topics<'_>, say: &mut Vec<Message>) {
    for set in topics.ledger.sets().iter().filter(|set| senses.position.x >= set.routes.exit_x_m()) {
        let (ids, set_count) = set_array(&set.ids);
        say.push(Message::Passed(Passed { stamp: senses.now, set_count, set: ids, reserved: 0 }));
    }
}
