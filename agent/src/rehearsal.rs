//! Look-ahead: a leader flies each alternative ahead in its mind, with the drones' own guidance, on what it knows, and
//! takes the cheapest. A fixed number of steps a tick, so that the outcome does not depend on the machine; the ticks it
//! takes are the paper's t_c.

use crate::guidance::anchor;
use crate::params::PilotParams;
use crate::pilot::{Heard, Pilot};
use crate::swarm_pilot::SwarmPilot;
use skein_leader::geometry::nearest;
use skein_leader::ledger::Orders;
use skein_leader::planner::{Member, Strategy};
use skein_protocol::downlink::{SensedNeighbour, SensedObstacle, SensedShape, Senses};
use skein_protocol::energy::power_w;
use skein_protocol::payload::PHASE_AVOID;
use skein_protocol::{DroneId, Message, SimTime, Vec2};

/// Length of a rehearsed step, s.
const STEP_S: f64 = 0.1;
/// A rehearsal that takes longer has failed, s.
const HORIZON_S: f64 = 150.0;
/// Drone-steps rehearsed in a tick.
const STEPS_A_TICK: usize = 1200;
/// Larger groups are not rehearsed: the neighbours of all drones are looked for pair by pair.
pub const MOST_MEMBERS: usize = 32;
/// Obstacles farther away are not sensed, m.
const OBSTACLE_REACH_M: f64 = 90.0;
/// Neighbours within so many safe distances are sensed.
const RANGING: f64 = 2.0;

/// What became of one alternative.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Forecast {
    /// Whether all got there and kept their distances.
    good: bool,
    energy_j: f64,
    /// Until the formation was closed, s.
    end_s: f64,
    /// Until the last drone passed the gate, s.
    pass_s: f64,
}

/// A rehearsal under way.
#[derive(Clone, Debug)]
pub struct Rehearsal {
    leader: Box<SwarmPilot>,
    members: Vec<Member>,
    shapes: Vec<SensedShape>,
    start: SimTime,
    alternatives: Vec<Orders>,
    forecasts: Vec<Forecast>,
    stage: Option<Stage>,
}

impl Rehearsal {
    /// A rehearsal of these alternatives by their leader.
    #[must_use]
    pub fn new(leader: SwarmPilot, members: Vec<Member>, start: SimTime, alternatives: Vec<Orders>) -> Self {
        let shape =
            |(id, known): (_, &skein_leader::obstacles::Known)| SensedShape { shape: known.shape, id, reserved: 0 };
        let shapes = leader.leading.obstacles.iter().map(shape).collect();
        let leader = Box::new(leader);
        Self { leader, members, shapes, start, alternatives, forecasts: Vec::new(), stage: None }
    }

    /// Whether what it rests on still holds: the same members, and no further obstacle.
    #[must_use]
    pub fn still_holds(&self, members: &[Member], obstacles: usize) -> bool {
        let ids = |members: &[Member]| members.iter().map(|member| member.id).collect::<Vec<_>>();
        obstacles == self.shapes.len() && ids(members) == ids(&self.members)
    }

    /// Goes on for one tick; the chosen orders once all alternatives are rehearsed.
    pub fn work(&mut self) -> Option<Orders> {
        let mut left = STEPS_A_TICK / self.members.len().max(1);
        while left > 0 && self.forecasts.len() < self.alternatives.len() {
            let stage = match &mut self.stage {
                Some(stage) => stage,
                None => {
                    let orders = &self.alternatives[self.forecasts.len()];
                    self.stage.insert(Stage::new(&self.leader, &self.members, self.start, orders))
                }
            };
            left -= 1;
            if let Some(forecast) = stage.step(&self.shapes) {
                self.forecasts.push(forecast);
                self.stage = None;
            }
        }
        (self.forecasts.len() == self.alternatives.len()).then(|| self.choose())
    }

    /// The cheapest of those that are good; ties: the faster. If none is, the rule's own.
    fn choose(&self) -> Orders {
        let good = (0..self.forecasts.len()).filter(|&i| self.forecasts[i].good);
        let order = |a: &usize, b: &usize| {
            let (a, b) = (&self.forecasts[*a], &self.forecasts[*b]);
            a.energy_j.total_cmp(&b.energy_j).then(a.end_s.total_cmp(&b.end_s))
        };
        let best = good.min_by(order);
        let mut orders = self.alternatives[best.unwrap_or(0)].clone();
        orders.plan.candidates = self.alternatives.len() as u32;
        if let Some(best) = best {
            orders.plan.predicted_s = self.forecasts[best].pass_s;
        }
        orders
    }
}

/// One alternative on stage.
#[derive(Clone, Debug)]
struct Stage {
    params: PilotParams,
    start: SimTime,
    now: SimTime,
    tick: u64,
    gate_x_m: f64,
    pilots: Vec<SwarmPilot>,
    bodies: Vec<(Vec2, Vec2)>,
    said: Vec<Heard>,
    energy_j: f64,
    pass_s: Option<f64>,
    safe: bool,
}

impl Stage {
    fn new(leader: &SwarmPilot, members: &[Member], start: SimTime, orders: &Orders) -> Self {
        let pilots: Vec<SwarmPilot> =
            members.iter().map(|member| leader.understudy(member.id, start, STEP_S, orders)).collect();
        let gate_x_m =
            pilots.first().and_then(|pilot| pilot.leading.ledger.sets().last().map(|set| set.routes.gate_x_m()));
        Self {
            params: leader.params.clone(),
            start,
            now: start,
            tick: 0,
            gate_x_m: gate_x_m.unwrap_or(f64::NEG_INFINITY),
            pilots,
            bodies: members.iter().map(|member| (member.position, member.velocity)).collect(),
            said: Vec::new(),
            energy_j: 0.0,
            pass_s: None,
            safe: true,
        }
    }

    /// One step of all drones; the forecast once the formation is closed, or never will be.
    fn step(&mut self, shapes: &[SensedShape]) -> Option<Forecast> {
        let mut accelerations = Vec::with_capacity(self.pilots.len());
        let mut said = Vec::new();
        let mut words: Vec<Message> = Vec::new();
        for i in 0..self.pilots.len() {
            let (obstacles, neighbours) = self.surroundings(i, shapes);
            let senses = Senses::new((self.tick, self.now), self.bodies[i], &obstacles, &neighbours, shapes);
            let source = self.pilots[i].params.me;
            let heard: Vec<Heard> = self.said.iter().filter(|heard| heard.source != source).copied().collect();
            words.clear();
            accelerations.push(self.pilots[i].step(&senses, &heard, &mut words).acceleration);
            said.extend(words.iter().map(|&message| Heard { source, message }));
        }
        self.said = said;
        self.fly(&accelerations);
        self.judge()
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
            self.energy_j += power_w(velocity.norm()) * STEP_S;
            let next = *velocity + acceleration * STEP_S;
            *position += (*velocity + next) * (STEP_S / 2.0);
            *velocity = next;
        }
        self.now = self.now.after(STEP_S);
        self.tick += 1;
    }

    fn judge(&mut self) -> Option<Forecast> {
        let elapsed_s = self.now.since(self.start);
        if self.pass_s.is_none() && self.bodies.iter().all(|(position, _)| position.x >= self.gate_x_m) {
            self.pass_s = Some(elapsed_s);
        }
        let closed = self.pass_s.is_some() && (0..self.pilots.len()).all(|i| self.in_slot(i));
        (closed || elapsed_s >= HORIZON_S).then(|| Forecast {
            good: closed && self.safe,
            energy_j: self.energy_j,
            end_s: elapsed_s,
            pass_s: self.pass_s.unwrap_or(elapsed_s),
        })
    }

    fn in_slot(&self, i: usize) -> bool {
        let ledger = &self.pilots[i].leading.ledger;
        let (Some(orders), Some(part)) = (ledger.obeyed(), ledger.part()) else { return false };
        let slot = anchor(&orders.plan, self.now).0 + Vec2::from(part.slot_m);
        let error_m = self.params.planner.arrival_error_m;
        orders.plan.phase != PHASE_AVOID && (slot - self.bodies[i].0).norm() <= error_m
    }
}

impl SwarmPilot {
    /// A member of this leader's group as the leader knows it, under `orders`, to be stepped every `dt_s`.
    fn understudy(&self, me: DroneId, now: SimTime, dt_s: f64, orders: &Orders) -> Self {
        let mut params = PilotParams { me, start: now, dt_s, ..self.params.clone() };
        params.safety.dt_s = dt_s;
        params.beacon_period_s = dt_s;
        // In the mind nothing is rehearsed again.
        params.planner.strategy = Strategy::CongestionAware;
        let leading = self.leading.of_member(&params.leading(), now, orders);
        let mut study = Self::new(params);
        study.leading = leading;
        study
    }
}
