//! The paper's drone: detect, obey, avoid, queue, re-form; plan for all while it leads. Paper, Algorithm 1.

use crate::escape::Escape;
use crate::guidance::anchor;
use crate::params::PilotParams;
use crate::pilot::{Command, Heard, Pilot};
use crate::queue::{Ahead, ahead_of, queue_speed};
use crate::rehearsal::{MOST_MEMBERS, Rehearsal, Start};
use crate::safety::{NearObstacle, Neighbour, Safety};
use crate::talk::Talk;
use crate::way::{OwnWay, Way};
use skein_leader::cost::{Flight, shortest, trips};
use skein_leader::election::{Election, Input};
use skein_leader::ledger::{Ledger, Orders};
use skein_leader::membership::{Peers, extrapolated};
use skein_leader::obstacles::Obstacles;
use skein_leader::planner::{Member, Planner, Situation, Strategy};
use skein_leader::routes::Routes;
use skein_protocol::downlink::Senses;
use skein_protocol::payload::{MAX_PLACES, PHASE_AVOID, POSE_LEADS, QueuePlace, set_tag};
use skein_protocol::{DroneId, GroupId, Message, SimTime, Vec2};
use std::collections::VecDeque;

/// With a reaction time t_c, the velocity gain is at most this over t_c: a higher one oscillates.
const GAIN_BY_REACTION: f64 = 0.4;
/// A drone that hangs dead in the air is given a wider berth than the safe distance, as a factor.
const DEAD_BERTH: f64 = 1.1;

/// A drone that does not get on waits so long before it gives way, s; in formation the leader opens ranks before.
const PATIENCE_ON_THE_WAY_S: f64 = 3.0;
const PATIENCE_IN_FORMATION_S: f64 = 8.0;

/// One drone's mind, and what it remembers.
#[derive(Clone, Debug)]
pub struct SwarmPilot {
    pub(crate) params: PilotParams,
    pub(crate) peers: Peers,
    pub(crate) obstacles: Obstacles,
    pub(crate) ledger: Ledger,
    pub(crate) election: Election,
    planner: Planner,
    pub(crate) way: Way,
    talk: Talk,
    safety: Safety,
    delayed: VecDeque<Vec2>,
    escape: Escape,
    rehearsal: Option<Rehearsal>,
    members: Vec<Member>,
    silent: Vec<Vec2>,
    ahead: Vec<Ahead>,
    pub(crate) neighbours: Vec<Neighbour>,
}

impl SwarmPilot {
    /// A drone that has just started and knows nothing but its parameters.
    #[must_use]
    pub fn new(params: PilotParams) -> Self {
        let reaction_ticks = (params.braking.reaction_time_s / params.dt_s).round() as usize;
        Self {
            peers: Peers::new(params.drones, params.peer_timeout_s),
            obstacles: Obstacles::new(params.drones),
            ledger: Ledger::new(params.me, params.drones, params.planner.routes),
            election: Election::new(params.me, params.incarnation, params.election, params.start),
            planner: Planner::new(params.planner.clone()),
            way: Way::new(params.me, params.planner.course_y_m),
            talk: Talk::new(&params),
            safety: Safety::new(params.safety),
            delayed: VecDeque::from(vec![Vec2::zeros(); reaction_ticks]),
            escape: Escape::default(),
            rehearsal: None,
            members: Vec::new(),
            silent: Vec::new(),
            ahead: Vec::new(),
            neighbours: Vec::new(),
            params,
        }
    }

    fn hear(&mut self, now: SimTime, heard: &Heard) {
        let epoch = self.ledger.stamp().epoch;
        match &heard.message {
            Message::Pose(pose) => {
                self.peers.hear(now, heard.source, *pose);
                let ballot = self.election.obeyed();
                if ballot.claimant == heard.source && pose.flags & POSE_LEADS != 0 {
                    self.election.handle(now, epoch, Input::Sign(ballot));
                }
            }
            Message::Obstacle(o) => {
                if self.obstacles.learn(now, o.id, o.shape, o.witness) {
                    self.ledger.settle(&self.obstacles);
                }
            }
            Message::Leadership(l) => {
                self.election.handle(now, epoch, Input::Heard(*l));
            }
            Message::Plan(plan) => {
                self.election.handle(now, epoch, Input::Sign(plan.id.ballot));
                if plan.id.ballot == self.election.obeyed() && !self.election.leads() {
                    self.ledger.hear_plan(plan, &self.obstacles);
                }
            }
            Message::Assignment(part) => {
                self.election.handle(now, epoch, Input::Sign(part.id.ballot));
                if part.id.ballot == self.election.obeyed() && !self.election.leads() {
                    self.ledger.hear_assignment(part, &self.obstacles);
                }
            }
            Message::Passed(passed) => self.obstacles.hear_passed(heard.source, passed),
        }
    }

    /// Algorithm 2: an obstacle in detection range is sensed whole, and told.
    fn sense(&mut self, senses: &Senses<'_>) {
        for shape in senses.obstacles.iter().filter_map(|entry| senses.shape(entry)) {
            if self.obstacles.learn(senses.now, shape.id, shape.shape, self.params.me) {
                self.talk.hurry();
                self.ledger.settle(&self.obstacles);
            }
        }
    }

    /// Elections, and planning while it leads.
    fn lead(&mut self, senses: &Senses<'_>, say: &mut Vec<Message>) {
        let now = senses.now;
        let destination = self.params.planner.destination;
        let suspect = self.election.obeyed().claimant;
        let patience_s = self.peers.patience_s(suspect, self.params.election.leader_timeout_s);
        let mine = (destination.distance_m(senses.position), self.params.me);
        let closer = if self.election.leads() || self.election.has_leader(now, patience_s) {
            0
        } else {
            let rivals = self.peers.living(now).filter(|(id, _)| !self.election.obeyed().is_some() || *id != suspect);
            let key = |(id, pose): (DroneId, &_)| (destination.distance_m(extrapolated(pose, now)), id);
            rivals.map(key).filter(|key| key.0 < mine.0 || (key.0 == mine.0 && key.1 < mine.1)).count()
        };
        let epoch = self.ledger.stamp().epoch;
        if let Some(message) = self.election.handle(now, epoch, Input::Tick { closer, patience_s }) {
            say.push(Message::Leadership(message));
        }
        if self.election.leads() {
            self.plan(senses);
        } else {
            self.rehearsal = None;
        }
    }

    fn plan(&mut self, senses: &Senses<'_>) {
        let now = senses.now;
        self.members.clear();
        let (position, velocity) = (senses.position, senses.velocity);
        self.members.push(Member { id: self.params.me, position, speed_mps: velocity.norm(), velocity });
        let peers = self.peers.living(now).map(|(id, pose)| Member {
            id,
            position: extrapolated(pose, now),
            speed_mps: Vec2::from(pose.velocity_mps).norm(),
            velocity: pose.velocity_mps.into(),
        });
        self.members.extend(peers);
        self.members.sort_by_key(|member| member.id);
        for set in self.ledger.sets() {
            let past = self.members.iter().filter(|member| member.position.x >= set.routes.exit_x_m());
            past.for_each(|member| self.obstacles.note_passed(member.id, &set.ids));
        }
        if let Some(mut rehearsal) = self.rehearsal.take() {
            // What became known meanwhile is planned for in the next tick.
            let over = match rehearsal.still_holds(&self.members, self.obstacles.iter().count()) {
                true => rehearsal.work(senses.tick),
                false => Some(rehearsal.choose()),
            };
            match over {
                Some(orders) => self.adopt(orders),
                None => self.rehearsal = Some(rehearsal),
            }
            return;
        }
        let alternatives = self.planner.decide(&Situation {
            now,
            ballot: self.election.obeyed(),
            members: &self.members,
            silent: &self.silent,
            obstacles: &self.obstacles,
            ledger: &self.ledger,
        });
        match self.params.planner.strategy {
            Strategy::Rehearsed(objective) if alternatives.len() > 1 && self.members.len() <= MOST_MEMBERS => {
                self.rehearse(Start { tick: senses.tick, now, objective }, alternatives);
            }
            // Too many for a rehearsal: the rule's.
            _ => alternatives.into_iter().take(2).next_back().into_iter().for_each(|orders| self.adopt(orders)),
        }
    }

    /// Sends all on their shortest ways, in the groups they have, and begins to rehearse what else could be done.
    fn rehearse(&mut self, start: Start, alternatives: Vec<Orders>) {
        let before = self.ledger.clone();
        let mut first = alternatives[0].clone();
        let current = |id| before.obeyed().and_then(|orders| orders.parts.get(&id)).map_or(GroupId::ALL, |p| p.group);
        first.parts.iter_mut().for_each(|(&id, part)| part.group = current(id));
        self.adopt(first);
        self.rehearsal = Some(Rehearsal::new(self, &before, &self.members, start, alternatives));
    }

    pub(crate) fn adopt(&mut self, orders: Orders) {
        self.ledger.adopt(orders, &self.obstacles);
        self.talk.hurry();
    }

    /// Where drones that fell silent hang by now: their last beacon, and how far they took to stop.
    fn find_silent(&mut self, senses: &Senses<'_>) {
        let braking = 2.0 * self.params.safety.acceleration_max_mps2;
        self.silent.clear();
        for (id, pose) in self.peers.silent(senses.now) {
            let sensed = senses.neighbours.iter().find(|n| n.drone == id).map(|n| Vec2::from(n.position_m));
            let velocity = Vec2::from(pose.velocity_mps);
            let guess = || Vec2::from(pose.position_m) + velocity * (velocity.norm() / braking);
            self.silent.push(sensed.map_or_else(guess, |offset| senses.position + offset));
        }
    }

    /// Nobody said anything about an obstacle, and it is dangerously near: go round it by the nearest way.
    fn fend_for_itself(&mut self, senses: &Senses<'_>) {
        let zone_m = self.params.braking.danger_zone_m(senses.velocity.norm(), self.params.safety.clearance_m);
        let near = senses.obstacles.iter().filter(|o| o.distance_m < zone_m).filter_map(|o| senses.shape(o));
        let planned =
            |id| self.ledger.sets().iter().any(|s| s.ids.contains(&id) && s.parts.contains_key(&self.params.me));
        let past = |id| self.obstacles.has_passed(self.params.me, id);
        let Some(id) = near.map(|shape| shape.id).find(|&id| !planned(id) && !past(id)) else { return };
        let reach_m = 2.0 * self.params.planner.routes.planning_distance_m;
        let sets = self.obstacles.sets(reach_m);
        let Some(set) = sets.iter().find(|set| set.contains(&id)) else { return };
        let tag = set_tag(set);
        if self.way.own.as_ref().is_some_and(|own| own.tag == tag) {
            return;
        }
        let Some(shapes) = self.obstacles.shapes(set) else { return };
        let routes = Routes::new(&shapes, &self.params.planner.routes);
        if senses.position.x >= routes.exit_x_m() {
            return;
        }
        let flight = Flight { speed_mps: self.params.guidance.speed_mps, course_y_m: self.params.planner.course_y_m };
        let route = shortest(&trips(&[], &routes, senses.position, &flight));
        self.way.own = Some(OwnWay { tag, routes, route });
    }

    /// The velocity it wants, were nobody in the way, m/s.
    fn wanted_velocity(&mut self, senses: &Senses<'_>, places: &[QueuePlace; MAX_PLACES]) -> Vec2 {
        let guidance = self.params.guidance;
        let cruise = Vec2::new(guidance.speed_mps, 0.0);
        if let Some(pull) = self.way.pull(senses.position) {
            return pull.direction * self.queue_speed(senses.now, places);
        }
        match (self.ledger.obeyed(), self.ledger.part()) {
            (Some(orders), Some(part)) if orders.plan.phase != PHASE_AVOID => {
                let (anchor, velocity) = anchor(&orders.plan, senses.now);
                guidance.to_slot(anchor + Vec2::from(part.slot_m) - senses.position, velocity)
            }
            _ => cruise,
        }
    }

    fn queue_speed(&mut self, now: SimTime, places: &[QueuePlace; MAX_PLACES]) -> f64 {
        let guidance = self.params.guidance;
        let mut speed = guidance.speed_mps;
        for place in places.iter().filter(|place| place.set != 0 && self.way.is_open_set(place.set)) {
            ahead_of(*place, &self.peers, now, &mut self.ahead);
            let headway_s = self.params.planner.headway_s;
            let here =
                queue_speed(&self.ahead, place.remaining_m, headway_s, guidance.speed_mps, guidance.speed_change_mps);
            speed = speed.min(here);
        }
        speed
    }

    /// Acceleration towards a velocity, made safe, m/s².
    fn accelerate(&mut self, wanted: Vec2, senses: &Senses<'_>) -> Vec2 {
        let reaction_s = self.params.braking.reaction_time_s;
        let gain = match reaction_s > 0.0 {
            true => self.params.velocity_gain_per_s.min(GAIN_BY_REACTION / reaction_s),
            false => self.params.velocity_gain_per_s,
        };
        let obstacles = senses
            .obstacles
            .iter()
            .map(|o| NearObstacle { nearest_m: Vec2::from(o.nearest_m) - senses.position, distance_m: o.distance_m });
        let neighbours = self.neighbours.iter().copied();
        self.safety.filter((wanted - senses.velocity) * gain, senses.velocity, obstacles, neighbours)
    }

    fn command(&self, acceleration: Vec2, places: &[QueuePlace; MAX_PLACES]) -> Command {
        let open = places.iter().find(|place| place.set != 0 && self.way.is_open_set(place.set));
        Command {
            acceleration,
            obeyed: self.ledger.stamp(),
            part_hash: self.ledger.part_hash(),
            group: self.group(),
            leads: self.election.leads().then_some(GroupId::ALL),
            phase: self.ledger.obeyed().map_or(0, |orders| orders.plan.phase),
            place: open.map(|place| (place.route, place.rank)),
        }
    }

    fn group(&self) -> GroupId {
        self.ledger.part().map_or(GroupId::ALL, |part| part.group)
    }
}

impl Pilot for SwarmPilot {
    fn step(&mut self, senses: &Senses<'_>, heard: &[Heard], say: &mut Vec<Message>) -> Command {
        for message in heard {
            self.hear(senses.now, message);
        }
        self.sense(senses);
        self.find_silent(senses);
        self.lead(senses, say);
        self.fend_for_itself(senses);
        let berth_m = DEAD_BERTH * self.params.safety.safe_distance_m;
        self.way.update(&self.ledger, senses.position, &self.silent, berth_m);
        for set in self.ledger.sets().iter().filter(|set| senses.position.x >= set.routes.exit_x_m()) {
            self.obstacles.note_passed(self.params.me, &set.ids);
        }
        let places = self.way.places(senses.position);
        let wanted = self.wanted_velocity(senses, &places);
        let slow_mps = self.params.guidance.speed_mps - self.params.guidance.speed_change_mps;
        let patience_s = if self.way.is_open() { PATIENCE_ON_THE_WAY_S } else { PATIENCE_IN_FORMATION_S };
        let wanted = self.escape.steer(senses.now, senses.velocity, wanted, patience_s, slow_mps);
        self.find_neighbours(senses, &places);
        let safe = self.accelerate(wanted, senses);
        self.delayed.push_back(safe);
        let acceleration = self.delayed.pop_front().unwrap_or(safe);
        let command = self.command(acceleration, &places);
        self.talk.speak(
            senses,
            &crate::talk::Topics {
                obeyed: command.obeyed,
                group: command.group,
                leads: command.leads.is_some(),
                places,
                ledger: &self.ledger,
                obstacles: &self.obstacles,
                peers: &self.peers,
                ballot: self.election.obeyed(),
            },
            say,
        );
        command
    }

    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>) {
        ages.clear();
        ages.extend(self.peers.living(now).map(|(_, pose)| now.since(pose.stamp)));
    }
}
