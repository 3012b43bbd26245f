//! The paper's drone: detect, obey, avoid, queue, re-form; plan for all while it leads. Paper, Algorithm 1.

use crate::danger::Detection;
use crate::escape::Escape;
use crate::foresight::Foresight;
use crate::guidance::anchor;
use crate::params::PilotParams;
use crate::pilot::{Command, Heard, Pilot};
use crate::queue::{Ahead, ahead_of, queue_speed};
use crate::reaction::Reaction;
use crate::rollout::{MAX_MEMBERS, Rollout, Start};
use crate::safety::{NearObstacle, Neighbour, Safety};
use crate::stray::Stray;
use crate::way::{OwnWay, Way};
use skein_leader::cost::{Flight, shortest, trips};
use skein_leader::leading::{Leading, Own};
use skein_leader::params::Strategy;
use skein_leader::plan_bundle::PlanBundle;
use skein_leader::routes::{Body, Routes};
use skein_protocol::downlink::Senses;
use skein_protocol::payload::{MAX_PLACES, QueuePlace, set_tag};
use skein_protocol::{Message, Phase, SimTime, Vec2};

/// A drone that hangs dead in the air is given a wider berth than the safe distance, as a factor.
const DEAD_BERTH: f64 = 1.1;

/// A drone that does not get on waits so long before it gives way, s; in formation the leader opens ranks before.
const PATIENCE_ON_THE_WAY_S: f64 = 3.0;
const PATIENCE_IN_FORMATION_S: f64 = 8.0;

/// A formation of another term than the leader's is given up after so long, s.
const OLD_FORMATION_S: f64 = 5.0;

/// Out of a gap that a body bars a drone flies back at this part of its speed.
const CORNERED: f64 = 0.5;

/// One drone's mind, and what it remembers.
#[derive(Clone, Debug)]
pub struct SwarmPilot {
    pub(crate) params: PilotParams,
    pub(crate) leading: Leading,
    pub(crate) way: Way,
    safety: Safety,
    reaction: Reaction,
    foresight: Foresight,
    escape: Escape,
    stray: Stray,
    /// Since when it obeys a formation of another term than its leader's.
    old_formation: Option<SimTime>,
    /// Apart: only a leader that thinks has one, and all others would carry the room for it through every tick.
    rollout: Option<Box<Rollout>>,
    silent: Vec<Vec2>,
    ahead: Vec<Ahead>,
    pub(crate) neighbours: Vec<Neighbour>,
}

impl SwarmPilot {
    /// A drone that has just started and knows nothing but its parameters.
    #[must_use]
    pub fn new(params: PilotParams) -> Self {
        Self {
            leading: Leading::new(&params.leading()),
            way: Way::new(params.me, params.planner.course_y_m),
            safety: Safety::new(params.safety),
            reaction: Reaction::new(params.braking.reaction_time_s, params.dt_s),
            foresight: Foresight::default(),
            escape: Escape::default(),
            stray: Stray::default(),
            old_formation: None,
            rollout: None,
            silent: Vec::new(),
            ahead: Vec::new(),
            neighbours: Vec::new(),
            params,
        }
    }

    /// Algorithm 2: an obstacle in detection range is sensed whole, and told.
    fn sense(&mut self, senses: &Senses<'_>) {
        for shape in senses.obstacles.iter().filter_map(|entry| senses.shape(entry)) {
            self.leading.sense(senses.now, shape.id, shape.shape);
        }
    }

    /// Elections, and planning while it leads.
    fn lead(&mut self, senses: &Senses<'_>, own: &Own, say: &mut Vec<Message>) {
        self.leading.elect(senses.now, own, say);
        if self.leading.is_leader() {
            self.plan(senses.now, own, say);
        } else {
            self.rollout = None;
        }
    }

    fn plan(&mut self, now: SimTime, own: &Own, say: &mut Vec<Message>) {
        self.leading.refresh_members(now, own);
        if let Some(mut rollout) = self.rollout.take() {
            // What became known meanwhile is planned for in the next tick.
            let over = match rollout.still_holds(self.leading.members(), self.leading.obstacles().iter().count()) {
                true => rollout.work(own.tick),
                false => Some(rollout.choose()),
            };
            match over {
                Some(bundle) => self.leading.adopt(now, bundle),
                None => self.rollout = Some(rollout),
            }
            return;
        }
        let alternatives = self.leading.decide(now, &self.silent, say);
        match self.params.planner.strategy {
            Strategy::LookAhead(objective) if alternatives.len() > 1 && self.leading.living().len() <= MAX_MEMBERS => {
                self.rehearse(Start { tick: own.tick, now, objective }, alternatives);
            }
            // Too many for a rehearsal: the rule's.
            _ => alternatives.into_iter().take(2).next_back().into_iter().for_each(|o| self.leading.adopt(now, o)),
        }
    }

    /// Sends all on the ways to fly meanwhile, in the groups they have, and begins to rehearse what else could be done.
    fn rehearse(&mut self, start: Start, alternatives: Vec<PlanBundle>) {
        let (members, scope) = (self.leading.members(), self.leading.scope());
        let mut first = alternatives[self.leading.interim()].clone();
        first.unsplit(members, scope);
        first.parts.retain(|id| members.iter().any(|m| m.id == id));
        self.rollout = Some(Box::new(Rollout::new(self, start, alternatives)));
        self.leading.adopt(start.now, first);
    }

    /// Where drones that say nothing hang by now: those ranged, where they are, heard before or not; of the others the last
    /// beacon, and how far they took to stop.
    fn find_silent(&mut self, senses: &Senses<'_>) {
        let braking = 2.0 * self.params.safety.acceleration_max_mps2;
        let peers = self.leading.peers();
        let mute = senses.neighbours.iter().filter(|n| !peers.is_living(n.drone, senses.now));
        self.silent.clear();
        self.silent.extend(mute.map(|n| senses.position + Vec2::from(n.position_m)));
        for (_, pose) in peers.silent(senses.now).filter(|(id, _)| !senses.neighbours.iter().any(|n| n.drone == *id)) {
            let velocity = Vec2::from(pose.velocity_mps);
            self.silent.push(Vec2::from(pose.position_m) + velocity * (velocity.norm() / braking));
        }
    }

    /// Nobody said anything about an obstacle, and it is dangerously near: go round it by the nearest way.
    fn emergency_avoidance(&mut self, senses: &Senses<'_>) {
        let clearance_m = self.params.safety.clearance_m;
        let detect = |o| self.params.braking.detect(senses.position, senses.velocity, o, clearance_m);
        let near = senses.obstacles.iter().filter_map(|o| Some((detect(o), senses.shape(o)?.id)));
        let planned =
            |id| self.leading.planned_sets().iter().any(|s| s.ids.contains(&id) && s.parts.contains(self.params.me));
        let past = |id| self.leading.obstacles().has_passed(self.params.me, id);
        let urgent = near.filter(|(detection, id)| detection.danger && !planned(*id) && !past(*id));
        let sooner = |a: &(Detection, _), b: &(Detection, _)| a.0.time_to_impact_s.total_cmp(&b.0.time_to_impact_s);
        let Some((_, id)) = urgent.min_by(sooner) else { return };
        let Some(set) = self.leading.obstacles().sets().iter().find(|set| set.contains(&id)) else { return };
        let tag = set_tag(set);
        if self.way.own.as_ref().is_some_and(|own| own.tag == tag) {
            return;
        }
        let Some(shapes) = self.leading.obstacles().shapes(set) else { return };
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
        if self.way.is_cornered() {
            return Vec2::new(-CORNERED * guidance.speed_mps, 0.0);
        }
        if let Some(pull) = self.way.pull(senses.position) {
            return pull.direction * self.queue_speed(senses.now, places);
        }
        let (shape, spacing_m) = (&self.params.planner.shape, self.params.planner.spacing_m);
        let unfollowed = self.leading.is_unfollowed(senses.now);
        if let Some((slot, velocity)) = self.stray.slot(senses.now, unfollowed, shape, spacing_m) {
            return self.on_sight(guidance.to_slot(slot - senses.position, velocity), senses.now);
        }
        let over = self.is_formation_over(senses.now);
        match (self.leading.obeyed(), self.leading.part()) {
            (Some(bundle), Some(part)) if bundle.plan.phase() != Phase::Avoid && !over => {
                let (anchor, velocity) = anchor(&bundle.plan, senses.now);
                let wanted = guidance.to_slot(anchor + Vec2::from(part.slot_m) - senses.position, velocity);
                self.on_sight(wanted, senses.now)
            }
            _ => cruise,
        }
    }

    /// Whether the formation it obeys was one of another term than that of its leader, who for long has made no new one: the
    /// others are still on their way, and a drone that kept its slot might bar it.
    fn is_formation_over(&mut self, now: SimTime) -> bool {
        let term = self.leading.term();
        let bundle = self.leading.obeyed();
        let old = bundle.is_some_and(|bundle| bundle.plan.phase() == Phase::Reform && bundle.plan.id.ballot != term);
        self.old_formation = old.then(|| self.old_formation.unwrap_or(now));
        self.old_formation.is_some_and(|since| now.since(since) >= OLD_FORMATION_S)
    }

    /// No faster than on sight while somebody who may still fly is not heard: it may come the other way.
    fn on_sight(&self, wanted: Vec2, now: SimTime) -> Vec2 {
        if self.leading.peers().silent(now).next().is_none() {
            return wanted;
        }
        let (speed, limit) = (wanted.norm(), self.safety.params().speed_on_sight_mps());
        if speed > limit { wanted * (limit / speed) } else { wanted }
    }

    fn queue_speed(&mut self, now: SimTime, places: &[QueuePlace; MAX_PLACES]) -> f64 {
        let guidance = self.params.guidance;
        let mut speed = guidance.speed_mps;
        if !self.params.queue {
            return speed;
        }
        for place in places.iter().filter(|place| place.set != 0 && self.way.is_open_set(place.set)) {
            ahead_of(*place, self.leading.peers(), now, &mut self.ahead);
            let headway_s = self.params.planner.headway_s;
            let here =
                queue_speed(&self.ahead, place.remaining_m, headway_s, guidance.speed_mps, guidance.speed_change_mps);
            speed = speed.min(here);
        }
        speed
    }

    /// Acceleration towards a velocity, made safe, m/s².
    fn accelerate(&mut self, wanted: Vec2, senses: &Senses<'_>) -> Vec2 {
        let gain = self.params.velocity_gain_per_s;
        let obstacles = senses
            .obstacles
            .iter()
            .map(|o| NearObstacle { nearest_m: Vec2::from(o.nearest_m) - senses.position, distance_m: o.distance_m });
        let neighbours = self.neighbours.iter().copied();
        self.safety.filter((wanted - senses.velocity) * gain, senses.velocity, obstacles, neighbours)
    }

    /// The acceleration to command now, m/s²: for the moment at which it takes effect.
    fn steer(&mut self, senses: &Senses<'_>, places: &[QueuePlace; MAX_PLACES]) -> Vec2 {
        let mut foresight = std::mem::take(&mut self.foresight);
        let then = match self.reaction.span_s() {
            span_s if span_s > 0.0 => {
                foresight.look(senses, span_s, self.reaction.foresee(senses.velocity));
                foresight.senses(senses)
            }
            _ => *senses,
        };
        let wanted = self.wanted_velocity(&then, places);
        let slow_mps = self.params.guidance.speed_mps - self.params.guidance.speed_change_mps;
        let patience_s = if self.way.is_open() { PATIENCE_ON_THE_WAY_S } else { PATIENCE_IN_FORMATION_S };
        let wanted = self.escape.steer(then.now, then.velocity, wanted, patience_s, slow_mps);
        self.find_neighbours(senses.now, &then, places);
        let safe = self.accelerate(wanted, &then);
        self.foresight = foresight;
        safe
    }

    fn command(&self, acceleration: Vec2, places: &[QueuePlace; MAX_PLACES]) -> Command {
        let open = places.iter().find(|place| place.set != 0 && self.way.is_open_set(place.set));
        Command {
            acceleration,
            obeyed: self.leading.stamp(),
            part_hash: self.leading.part_hash(),
            group: self.leading.group(),
            leads: self.leading.is_leader().then(|| self.leading.scope()),
            term: self.leading.term(),
            phase: self.leading.obeyed().map_or(Phase::Cruise, |bundle| bundle.plan.phase()),
            place: open.map(|place| (place.route, place.rank)),
        }
    }
}

impl Pilot for SwarmPilot {
    fn step(&mut self, senses: &Senses<'_>, heard: &[Heard<'_>], say: &mut Vec<Message>) -> Command {
        self.params.braking.reaction_time_s = self.reaction.slow_down(senses.extra_reaction_s);
        self.safety.set_reaction_time(self.reaction.span_s());
        let own = Own { tick: senses.tick, position: senses.position, velocity: senses.velocity };
        for &Heard { source, message } in heard {
            self.leading.hear(senses.now, source, message, say);
            self.stray.hear(message);
        }
        self.leading.set_impaired(senses.broken.any());
        self.sense(senses);
        self.find_silent(senses);
        self.lead(senses, &own, say);
        self.emergency_avoidance(senses);
        let radius_m = DEAD_BERTH * self.params.safety.safe_distance_m;
        let bodies: Vec<Body> = self.silent.iter().map(|&centre_m| Body { centre_m, radius_m }).collect();
        self.way.update(self.leading.ledger(), senses.position, &bodies);
        self.leading.note_passed(senses.position);
        let places = self.way.places(senses.position);
        let safe = self.steer(senses, &places);
        let acceleration = self.reaction.delay(safe);
        let command = self.command(acceleration, &places);
        self.leading.speak(senses.now, &own, &places, say);
        command
    }

    fn pose_ages_s(&self, now: SimTime, ages: &mut Vec<f64>) {
        ages.clear();
        ages.extend(self.leading.peers().living(now).map(|(_, pose)| now.since(pose.stamp)));
    }
}
