//! The stage of a rehearsal: understudies of all members, flown step by step in their leader's mind.

use crate::guidance::anchor;
use crate::params::PilotParams;
use crate::pilot::{Heard, Pilot};
use crate::safety::RANGING;
use crate::swarm_pilot::SwarmPilot;
use skein_leader::geometry::nearest;
use skein_leader::ledger::Ledger;
use skein_leader::member::Member;
use skein_leader::params::{Destination, Objective, PlannerParams, Strategy};
use skein_leader::plan_bundle::PlanBundle;
use skein_protocol::downlink::{SensedNeighbour, SensedObstacle, SensedShape, Senses};
use skein_protocol::energy::{CHEAPEST_MPS, power_w};
use skein_protocol::{DroneId, Message, Phase, PlanStamp, SimTime, Vec2};

/// A rehearsal that takes longer has failed, s.
const HORIZON_S: f64 = 200.0;
/// Obstacles farther away are not sensed, m.
const OBSTACLE_REACH_M: f64 = 90.0;
/// A formation that is held moves no faster, m/s.
const HOLD_SPEED_MPS: f64 = 1.0;

/// What became of one alternative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Whether all got there and kept their distances.
    pub good: bool,
    /// By the objective, until the mission's end.
    pub cost: f64,
    /// Of all members, from the decision until the mission's end, J.
    pub energy_j: f64,
    /// From the decision until the mission's end, s.
    pub end_s: f64,
    /// From the decision until the last drone passed the gate, s.
    pub pass_s: f64,
    /// Way to the gate in free flight, s: a mean over the drones.
    pub way_s: f64,
}

/// Understudies and their bodies.
#[derive(Clone, Debug)]
pub struct Stage {
    params: PilotParams,
    step_s: f64,
    start: SimTime,
    now: SimTime,
    tick: u64,
    /// Steps until the decision.
    thinking: u64,
    gate_x_m: f64,
    pilots: Vec<SwarmPilot>,
    bodies: Vec<(Vec2, Vec2)>,
    said: Vec<(DroneId, Message)>,
    energy_j: f64,
    pass_s: Option<f64>,
    way_s: f64,
    safe: bool,
}

impl Stage {
    /// A crew as a leader knows it, all of them one group that it leads, flying by these orders. `(tick, now, step_s)`:
    /// number and time of the first step and the length of all, s; `thinking`: steps until the decision.
    #[must_use]
    pub fn new(
        leader: &SwarmPilot,
        crew: &[Member],
        bundle: &PlanBundle,
        (tick, now, step_s): (u64, SimTime, f64),
        thinking: u64,
    ) -> Self {
        let ledger = leader.leading.united_ledger(now);
        let rollout_pilot = |member: &Member| leader.rollout_pilot(member.id, now, step_s, &ledger);
        let mut stage = Self {
            params: leader.params.clone(),
            step_s,
            start: now,
            now,
            tick,
            thinking,
            gate_x_m: f64::NEG_INFINITY,
            pilots: crew.iter().map(rollout_pilot).collect(),
            bodies: crew.iter().map(|member| (member.position, member.velocity)).collect(),
            said: Vec::new(),
            energy_j: 0.0,
            pass_s: None,
            way_s: 0.0,
            safe: true,
        };
        stage.obey(bundle);
        let sets = stage.pilots.iter().flat_map(|pilot| pilot.leading.planned_sets());
        stage.gate_x_m = sets.map(|set| set.routes.gate_x_m()).fold(f64::NEG_INFINITY, f64::max);
        stage
    }

    /// All obey these orders at once: what is on the air for a tick or two makes no difference.
    fn obey(&mut self, bundle: &PlanBundle) {
        let newest = self.pilots.iter().map(|pilot| pilot.leading.newest_stamp()).max().unwrap_or_default();
        let mut bundle = bundle.clone();
        bundle.plan.stamp = self.now;
        bundle.unite(PlanStamp { epoch: newest.epoch.saturating_add(1), ..newest });
        for pilot in &mut self.pilots {
            pilot.leading.obey(self.now, bundle.clone());
        }
    }

    /// Whether the decision is still to come.
    #[must_use]
    pub fn is_thinking(&self) -> bool {
        self.thinking > 0
    }

    /// The same at the decision, for these orders.
    #[must_use]
    pub fn under(&self, bundle: &PlanBundle) -> Self {
        let mut stage = Self { start: self.now, energy_j: 0.0, ..self.clone() };
        stage.way_s = bundle.parts.iter().map(|part| part.arrival_s).sum::<f64>() / bundle.parts.len().max(1) as f64;
        stage.obey(bundle);
        stage
    }

    /// One step of all drones.
    pub fn step(&mut self, shapes: &[SensedShape]) {
        self.thinking = self.thinking.saturating_sub(1);
        let mut accelerations = Vec::with_capacity(self.pilots.len());
        let mut said = Vec::new();
        let mut words: Vec<Message> = Vec::new();
        let before = std::mem::take(&mut self.said);
        let heard: Vec<Heard<'_>> =
            before.iter().map(|(source, message)| Heard { source: *source, message: message.into() }).collect();
        for i in 0..self.pilots.len() {
            let (obstacles, neighbours) = self.surroundings(i, shapes);
            let senses = Senses::new((self.tick, self.now), self.bodies[i], &obstacles, &neighbours, shapes);
            let source = self.pilots[i].params.me;
            words.clear();
            // Nobody minds to hear itself.
            accelerations.push(self.pilots[i].step(&senses, &heard, &mut words).acceleration);
            said.extend(words.iter().map(|&message| (source, message)));
        }
        self.said = said;
        self.fly(&accelerations);
    }

    fn surroundings(&mut self, i: usize, shapes: &[SensedShape]) -> (Vec<SensedObstacle>, Vec<SensedNeighbour>) {
        let (position, velocity) = self.bodies[i];
        let safety = self.params.safety;
        let mut obstacles = Vec::new();
        for (shape, entry) in shapes.iter().zip(0..) {
            let core: Vec<Vec2> = shape.shape.vertices().collect();
            let to_core = nearest(&core, position) - position;
            let distance_m = to_core.norm() - shape.shape.radius_m;
            self.safe &= distance_m >= safety.clearance_m;
            if distance_m < OBSTACLE_REACH_M {
                let nearest_m = position + to_core * (distance_m / to_core.norm().max(1e-9));
                obstacles.push(SensedObstacle { nearest_m: nearest_m.into(), distance_m, shape: entry, reserved: 0 });
            }
        }
        let mut neighbours = Vec::new();
        for (j, &(other, speed)) in self.bodies.iter().enumerate().filter(|(j, _)| *j != i) {
            let offset = other - position;
            self.safe &= offset.norm() >= safety.safe_distance_m;
            if offset.norm() <= RANGING * safety.safe_distance_m {
                let drone = self.pilots[j].params.me;
                let velocity_mps = (speed - velocity).into();
                neighbours.push(SensedNeighbour { position_m: offset.into(), velocity_mps, drone, reserved: 0 });
            }
        }
        (obstacles, neighbours)
    }

    fn fly(&mut self, accelerations: &[Vec2]) {
        for ((position, velocity), &wanted) in self.bodies.iter_mut().zip(accelerations) {
            let most = self.params.safety.acceleration_max_mps2;
            let acceleration = if wanted.norm() > most { wanted * (most / wanted.norm()) } else { wanted };
            self.energy_j += power_w(velocity.norm()) * self.step_s;
            let next = *velocity + acceleration * self.step_s;
            *position += (*velocity + next) * (self.step_s / 2.0);
            *velocity = next;
        }
        self.now = self.now.after(self.step_s);
        self.tick += 1;
    }

    /// The forecast, once the formation is closed, or never will be, or costs more than `limit` already.
    pub fn judge(&mut self, objective: &Objective, limit: f64) -> Option<Forecast> {
        let elapsed_s = self.now.since(self.start);
        if self.pass_s.is_none() && self.bodies.iter().all(|(position, _)| position.x >= self.gate_x_m) {
            self.pass_s = Some(elapsed_s);
        }
        let cruise_s = self.pass_s.and_then(|_| self.closed());
        let (rest_s, count) = (cruise_s.unwrap_or(0.0), self.bodies.len() as f64);
        let energy_j = self.energy_j + count * power_w(self.params.guidance.speed_mps) * rest_s;
        let end_s = elapsed_s + rest_s;
        let cost = objective.cost(energy_j, end_s);
        let good = cruise_s.is_some() && self.safe;
        let pass_s = self.pass_s.unwrap_or(elapsed_s);
        let least_s = self.least_rest_s();
        let least = objective.cost(self.energy_j + count * power_w(CHEAPEST_MPS) * least_s, elapsed_s + least_s);
        let over = cruise_s.is_some() || elapsed_s >= HORIZON_S || least > limit;
        over.then_some(Forecast { good, cost, energy_j, end_s, pass_s, way_s: self.way_s })
    }

    /// The swarm cannot be where its mission ends before so long, s: so far has its middle still to go.
    fn least_rest_s(&self) -> f64 {
        let planner = &self.params.planner;
        let fastest_mps = planner.speed_mps.max(self.params.guidance.reform_speed_max_mps);
        let middle_m = |xs: &mut dyn Iterator<Item = f64>| xs.sum::<f64>() / self.bodies.len().max(1) as f64;
        let end_m = middle_m(&mut end_slots(planner, self.bodies.len()).into_iter());
        let here_m = middle_m(&mut self.bodies.iter().map(|(position, _)| position.x));
        (end_m - here_m).max(0.0) / fastest_mps
    }

    /// Once all are in their slots, how long the formation still cruises to where the mission ends, s.
    fn closed(&self) -> Option<f64> {
        let bundle = self.pilots.first()?.leading.obeyed().filter(|bundle| bundle.plan.phase() != Phase::Avoid)?;
        let (place, velocity) = anchor(&bundle.plan, self.now);
        let error_m = self.params.planner.arrival_error_m;
        let holds = matches!(self.params.planner.destination, Destination::Hold { .. });
        let in_slot = |(pilot, (position, speed)): (&SwarmPilot, &(Vec2, Vec2))| {
            let slot = pilot.leading.part().map(|part| place + Vec2::from(part.slot_m));
            let still = !holds || (speed - velocity).norm() <= HOLD_SPEED_MPS;
            pilot.leading.stamp() == bundle.plan.id && still && slot.is_some_and(|s| (s - position).norm() <= error_m)
        };
        let all = self.pilots.iter().zip(&self.bodies).all(in_slot);
        let rest_m = if velocity.x > 0.0 { (bundle.plan.anchor_stop_x_m - place.x).max(0.0) } else { 0.0 };
        all.then(|| rest_m / velocity.x.max(1e-9))
    }
}

/// Abscissas of the slots in which so many drones end a mission, m.
pub(crate) fn end_slots(planner: &PlannerParams, drones: usize) -> Vec<f64> {
    let front_m = match planner.destination {
        Destination::Hold { stop_x_m } => stop_x_m,
        Destination::Goal { front_m } => front_m.x,
    };
    planner.shape.slots(drones, planner.spacing_m).iter().map(|slot| front_m + slot.x).collect()
}

impl SwarmPilot {
    /// A drone as this leader knows it, to be stepped every `dt_s`.
    fn rollout_pilot(&self, me: DroneId, now: SimTime, dt_s: f64, ledger: &Ledger) -> Self {
        let mut params = PilotParams { me, start: now, dt_s, ..self.params.clone() };
        params.safety.dt_s = dt_s;
        params.beacon_period_s = dt_s.max(self.params.beacon_period_s);
        // In the mind nothing is rehearsed again.
        params.planner.strategy = Strategy::PaperRule;
        let leading = self.leading.rollout_member(&params.leading(), now, ledger.of_member(me));
        let mut study = Self::new(params);
        study.leading = leading;
        study
    }
}
