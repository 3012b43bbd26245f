//! A simulated swarm: the drones' own pilots and point-mass bodies, stepped together on what one leader knows.

use crate::guidance::anchor;
use crate::rollout::forecast::Forecast;
use crate::rollout::params::RolloutParams;
use crate::rollout::pilot::RolloutPilot;
use crate::tuning::ROLLOUT_HORIZON_S;
use skein_leader::geometry::nearest;
use skein_leader::obstacles::set_ids;
use skein_leader::params::{Destination, Objective};
use skein_leader::plan_bundle::PlanBundle;
use skein_pilot::{Heard, Inbox, Out};
use skein_protocol::downlink::{SensedNeighbour, SensedObstacle, SensedShape, Senses};
use skein_protocol::energy::{CHEAPEST_MPS, power_w};
use skein_protocol::formation::HOLD_SPEED_MPS;
use skein_protocol::payload::{Assignment, set_tag};
use skein_protocol::{DroneId, Message, Phase, PlanStamp, SimTime, Vec2, horizontal, raised};

/// One simulated drone.
#[derive(Clone, Debug)]
pub struct RolloutDrone<P> {
    /// Its pilot.
    pub pilot: P,
    /// World frame, m.
    pub position: Vec2,
    /// World frame, m/s.
    pub velocity: Vec2,
}

/// What the sensors of a simulated drone report.
#[derive(Default)]
struct Surroundings {
    obstacles: Vec<SensedObstacle>,
    neighbours: Vec<SensedNeighbour>,
}

/// The first step of a simulation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SwarmStart {
    /// Number of the step.
    pub(crate) step: u64,
    /// Its time.
    pub(crate) now: SimTime,
    /// Steps until the decision.
    pub(crate) steps_to_decision: u64,
}

/// A simulated swarm and its tallies.
#[derive(Clone, Debug)]
pub(crate) struct RolloutSwarm<P> {
    params: RolloutParams,
    step_s: f64,
    /// From when on energy and time count.
    start: SimTime,
    now: SimTime,
    step: u64,
    steps_to_decision: u64,
    gate_x_m: f64,
    drones: Vec<RolloutDrone<P>>,
    /// Messages of the step before, each with its sender.
    said: Vec<(DroneId, Message)>,
    energy_j: f64,
    pass_s: Option<f64>,
    path_s: f64,
    /// Whether all distances have been kept so far.
    safe: bool,
    /// The plan that this swarm was given, and whether it has been flown as given so far.
    ordered: Option<PlanBundle>,
    as_ordered: bool,
}

impl<P: RolloutPilot> RolloutSwarm<P> {
    /// A swarm that obeys `bundle`.
    pub(crate) fn new(
        params: RolloutParams,
        drones: Vec<RolloutDrone<P>>,
        bundle: &PlanBundle,
        start: SwarmStart,
    ) -> Self {
        let step_s = params.step_s();
        let mut swarm = Self {
            params,
            step_s,
            start: start.now,
            now: start.now,
            step: start.step,
            steps_to_decision: start.steps_to_decision,
            gate_x_m: f64::NEG_INFINITY,
            drones,
            said: Vec::new(),
            energy_j: 0.0,
            pass_s: None,
            path_s: 0.0,
            safe: true,
            ordered: None,
            as_ordered: true,
        };
        swarm.obey(bundle);
        let gates = swarm.drones.iter().map(|drone| drone.pilot.last_gate_x_m());
        swarm.gate_x_m = gates.fold(f64::NEG_INFINITY, f64::max);
        swarm
    }

    /// Lets all drones obey a plan at once. The tick or two that its messages would take make no difference. A drone that the plan
    /// leaves out, because another leader's plan has brought it past the set, keeps its route: a drone without a part would
    /// call an election, and the new leader would plan anew.
    fn obey(&mut self, bundle: &PlanBundle) {
        let newest = self.drones.iter().map(|drone| drone.pilot.newest_stamp()).max().unwrap_or_default();
        let mut bundle = bundle.clone();
        bundle.plan.stamp = self.now;
        if bundle.plan.phase() == Phase::Avoid {
            let left_out = self.drones.iter().filter(|drone| !bundle.parts.contains(drone.pilot.id()));
            let kept: Vec<Assignment> =
                left_out.map(|drone| drone.pilot.own_part(&bundle.plan, drone.position)).collect();
            for part in kept {
                bundle.parts.add(&part);
            }
        }
        bundle.unite(PlanStamp { epoch: newest.epoch.saturating_add(1), ..newest });
        for drone in &mut self.drones {
            drone.pilot.obey(self.now, bundle.clone());
        }
    }

    /// Whether the decision is still to come.
    pub(crate) fn is_before_decision(&self) -> bool {
        self.steps_to_decision > 0
    }

    /// A copy that obeys another plan from now on, with energy and time counted from now on.
    pub(crate) fn branch(&self, bundle: &PlanBundle) -> Self {
        let mut swarm = Self { start: self.now, energy_j: 0.0, ..self.clone() };
        swarm.path_s = bundle.parts.iter().map(|part| part.arrival_s).sum::<f64>() / bundle.parts.len().max(1) as f64;
        swarm.obey(bundle);
        swarm.ordered = (bundle.plan.phase() == Phase::Avoid).then(|| bundle.clone());
        swarm
    }

    /// Whether every drone that is still before the gate has the route that the plan ordered. If the simulated leaders plan
    /// anew, the forecast is not one of this plan.
    fn keeps_order(&self) -> bool {
        let Some(ordered) = &self.ordered else { return true };
        let tag = set_tag(set_ids(&ordered.plan.set, ordered.plan.set_count));
        self.drones.iter().filter(|drone| drone.position.x < self.gate_x_m).all(|drone| {
            let given = ordered.parts.get(drone.pilot.id()).map(|part| part.route);
            let flown = drone.pilot.part_past(tag).map(|part| part.route);
            given.is_none() || flown.is_none() || given == flown
        })
    }

    /// Simulates one step of all drones. `shapes`: the obstacles.
    pub(crate) fn advance(&mut self, shapes: &[SensedShape]) {
        self.steps_to_decision = self.steps_to_decision.saturating_sub(1);
        let mut accelerations = Vec::with_capacity(self.drones.len());
        let mut said = Vec::new();
        let mut out = Out::default();
        let before = std::mem::take(&mut self.said);
        // A pilot ignores its own messages.
        let heard: Vec<Heard<'_>> =
            before.iter().map(|(source, message)| Heard { source: *source, message: message.into() }).collect();
        for i in 0..self.drones.len() {
            let around = self.look_around(i, shapes);
            let drone = &mut self.drones[i];
            let body = (raised(drone.position, 0.0), raised(drone.velocity, 0.0));
            let senses = Senses::new((self.step, self.now), body, &around.obstacles, &around.neighbours, shapes);
            out.clear();
            let command = drone.pilot.step(&senses, &Inbox::new(&heard), &mut out);
            // A velocity is reached within a step.
            let acceleration_mps2 = command.acceleration_mps2(raised(drone.velocity, 0.0), 1.0 / self.step_s);
            accelerations.push(horizontal(acceleration_mps2));
            let source = drone.pilot.id();
            said.extend(out.messages().iter().map(|&message| (source, message)));
        }
        self.said = said;
        self.fly(&accelerations);
    }

    /// What drone `i` senses. Notes whether it keeps its distances.
    fn look_around(&mut self, i: usize, shapes: &[SensedShape]) -> Surroundings {
        let RolloutDrone { position, velocity, .. } = self.drones[i];
        let mut around = Surroundings::default();
        for (shape, entry) in shapes.iter().zip(0..) {
            let core: Vec<Vec2> = shape.shape.vertices().collect();
            let to_core = nearest(&core, position) - position;
            let distance_m = to_core.norm() - shape.shape.radius_m;
            self.safe &= distance_m >= self.params.clearance_m;
            if distance_m < self.params.detection_range_m {
                let nearest_m = raised(position + to_core * (distance_m / to_core.norm().max(1e-9)), 0.0);
                around.obstacles.push(SensedObstacle { nearest_m, distance_m, shape: entry, reserved: 0 });
            }
        }
        for other in self.drones.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, other)| other) {
            let offset = other.position - position;
            self.safe &= offset.norm() >= self.params.safe_distance_m;
            if offset.norm() <= self.params.ranging_m {
                let (drone, velocity_mps) = (other.pilot.id(), raised(other.velocity - velocity, 0.0));
                around.neighbours.push(SensedNeighbour {
                    position_m: raised(offset, 0.0),
                    velocity_mps,
                    drone,
                    reserved: 0,
                });
            }
        }
        around
    }

    fn fly(&mut self, accelerations: &[Vec2]) {
        let limit = self.params.acceleration_max_mps2;
        for (drone, &wanted) in self.drones.iter_mut().zip(accelerations) {
            let acceleration = if wanted.norm() > limit { wanted * (limit / wanted.norm()) } else { wanted };
            self.energy_j += power_w(drone.velocity.norm()) * self.step_s;
            let next = drone.velocity + acceleration * self.step_s;
            drone.position += (drone.velocity + next) * (self.step_s / 2.0);
            drone.velocity = next;
        }
        self.now = self.now.after(self.step_s);
        self.step += 1;
    }

    /// The forecast, once the simulation is over: the formation is closed, or the horizon is reached, or the cost must
    /// exceed `limit`.
    pub(crate) fn forecast(&mut self, objective: &Objective, limit: f64) -> Option<Forecast> {
        let elapsed_s = self.now.since(self.start);
        self.as_ordered &= self.pass_s.is_some() || self.keeps_order();
        if self.pass_s.is_none() && self.drones.iter().all(|drone| drone.position.x >= self.gate_x_m) {
            self.pass_s = Some(elapsed_s);
        }
        let cruise_s = self.pass_s.and_then(|_| self.remaining_cruise_s());
        let (rest_s, count) = (cruise_s.unwrap_or(0.0), self.drones.len() as f64);
        let energy_j = self.energy_j + count * power_w(self.params.speed_mps) * rest_s;
        let end_s = elapsed_s + rest_s;
        let cost = objective.cost(energy_j, end_s);
        let good = cruise_s.is_some() && self.safe && self.as_ordered;
        let pass_s = self.pass_s.unwrap_or(elapsed_s);
        let least_s = self.least_remaining_s();
        let least = objective.cost(self.energy_j + count * power_w(CHEAPEST_MPS) * least_s, elapsed_s + least_s);
        let over = cruise_s.is_some() || elapsed_s >= ROLLOUT_HORIZON_S || least > limit;
        over.then_some(Forecast { good, cost, energy_j, end_s, pass_s, path_s: self.path_s })
    }

    /// A lower bound on the time to the mission's end, s: the mean remaining distance at the highest speed.
    fn least_remaining_s(&self) -> f64 {
        let fastest_mps = self.params.planner.speed_mps.max(self.params.reform_speed_max_mps);
        let count = self.drones.len().max(1) as f64;
        let end_m = self.params.end_slots(self.drones.len()).into_iter().sum::<f64>() / count;
        let here_m = self.drones.iter().map(|drone| drone.position.x).sum::<f64>() / count;
        (end_m - here_m).max(0.0) / fastest_mps
    }

    /// Once all drones are in their slots: how long the formation cruises until the mission's end, s.
    fn remaining_cruise_s(&self) -> Option<f64> {
        let plan = self.drones.first()?.pilot.plan().filter(|plan| plan.phase() != Phase::Avoid)?;
        let (place, velocity) = anchor(plan, self.now);
        let error_m = self.params.planner.arrival_error_m;
        let holds = matches!(self.params.planner.destination, Destination::Hold { .. });
        let hold_mps = self.params.planner.routes.scale.speed(HOLD_SPEED_MPS);
        let in_slot = |drone: &RolloutDrone<P>| {
            let slot = drone.pilot.slot().map(|slot| place + slot);
            let still = !holds || (drone.velocity - velocity).norm() <= hold_mps;
            drone.pilot.stamp() == plan.id && still && slot.is_some_and(|s| (s - drone.position).norm() <= error_m)
        };
        let all = self.drones.iter().all(in_slot);
        let rest_m = if velocity.x > 0.0 { (plan.anchor_stop_x_m - place.x).max(0.0) } else { 0.0 };
        all.then(|| rest_m / velocity.x.max(1e-9))
    }
}
