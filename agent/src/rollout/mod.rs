//! Look-ahead: a leader simulates each alternative plan on what it knows, with the drones' own pilots, and takes the best.
//!
//! Meanwhile the swarm flies an interim plan: the shortest paths, or the paper's rule where groups meet and the rule saves
//! much time. The tick of the decision is fixed beforehand; this delay is the paper's t_c. The leader first simulates the
//! interim plan up to the decision, and then every alternative from there. Each tick has a fixed number of drone-steps, so
//! that the result does not depend on the machine.
//!
//! The module knows pilots only by the trait [`RolloutPilot`].

mod forecast;
mod params;
mod pilot;
mod swarm;

pub use forecast::Forecast;
pub use params::RolloutParams;
pub use pilot::RolloutPilot;
pub use swarm::RolloutDrone;

use crate::rollout::forecast::best;
use crate::rollout::swarm::{RolloutSwarm, SwarmStart};
use crate::tuning::{DELIBERATION_S, DRONE_STEPS_PER_S, ROOM_FOR_A_SET};
use skein_leader::member::Member;
use skein_leader::params::Objective;
use skein_leader::plan_bundle::PlanBundle;
use skein_protocol::downlink::SensedShape;
use skein_protocol::{DroneId, SimTime};

/// What a leader simulates, and from when on.
#[derive(Clone, Debug)]
pub struct RolloutInput<P> {
    /// The current tick.
    pub tick: u64,
    /// Its time.
    pub now: SimTime,
    /// What is minimised.
    pub objective: Objective,
    /// The members of the leader's group.
    pub members: Vec<DroneId>,
    /// The known obstacles.
    pub obstacles: Vec<SensedShape>,
    /// All living drones that the leader knows, each with a pilot that is stepped every [`RolloutParams::step_s`].
    pub drones: Vec<RolloutDrone<P>>,
    /// The alternatives: the shortest paths first, the paper's rule second.
    pub alternatives: Vec<PlanBundle>,
    /// Index of the alternative that the swarm flies until the decision.
    pub interim: usize,
}

/// A look-ahead in progress.
#[derive(Clone, Debug)]
pub struct Rollout<P> {
    members: Vec<DroneId>,
    obstacles: Vec<SensedShape>,
    objective: Objective,
    /// Steps of the whole swarm in a tick.
    steps_per_tick: usize,
    decision_tick: u64,
    /// Whether there is no room left for an obstacle set that no drone has seen yet.
    sees_the_end: bool,
    interim: usize,
    alternatives: Vec<PlanBundle>,
    /// One per alternative that is finished.
    forecasts: Vec<Forecast>,
    /// The swarm under the interim plan, up to the decision.
    trunk: RolloutSwarm<P>,
    /// The swarm under the alternative that is being simulated.
    branch: Option<RolloutSwarm<P>>,
}

impl<P: RolloutPilot> Rollout<P> {
    /// Begins a look-ahead.
    #[must_use]
    pub fn new(params: RolloutParams, input: RolloutInput<P>) -> Self {
        let (ticks, step_s) = (params.step_ticks(), params.step_s());
        let steps = (DELIBERATION_S / step_s).ceil() as u64;
        let decision = input.now.after(step_s * steps as f64);
        let steps_per_tick = DRONE_STEPS_PER_S * params.dt_s / input.drones.len().max(1) as f64;
        let sees_the_end = sees_the_end(&params, &input.obstacles, input.drones.len());
        let start = SwarmStart { step: input.tick / ticks, now: input.now, steps_to_decision: steps };
        let trunk = RolloutSwarm::new(params, input.drones, &input.alternatives[input.interim], start);
        Self {
            members: input.members,
            obstacles: input.obstacles,
            objective: input.objective,
            steps_per_tick: (steps_per_tick as usize).max(1),
            decision_tick: input.tick + ticks * steps,
            sees_the_end,
            interim: input.interim,
            alternatives: input.alternatives.into_iter().map(|bundle| superseding(bundle, decision)).collect(),
            forecasts: Vec::new(),
            trunk,
            branch: None,
        }
    }

    /// Whether its assumptions still hold: the same members, and as many obstacles.
    #[must_use]
    pub fn is_current(&self, members: &[Member], obstacles: usize) -> bool {
        obstacles == self.obstacles.len() && members.iter().map(|member| &member.id).eq(&self.members)
    }

    /// Simulates for one tick; returns the chosen plan in the tick of the decision.
    pub fn advance(&mut self, tick: u64) -> Option<PlanBundle> {
        if tick >= self.decision_tick {
            return Some(self.choose());
        }
        let mut left = self.steps_per_tick;
        while left > 0 && self.forecasts.len() < self.alternatives.len() {
            left -= 1;
            if self.trunk.is_before_decision() {
                self.trunk.advance(&self.obstacles);
                continue;
            }
            let (limit, next) = (self.cost_limit(), &self.alternatives[self.forecasts.len()]);
            let branch = self.branch.get_or_insert_with(|| self.trunk.branch(next));
            branch.advance(&self.obstacles);
            if let Some(forecast) = branch.forecast(&self.objective, limit) {
                self.forecasts.push(forecast);
                self.branch = None;
            }
        }
        None
    }

    /// Cost above which an alternative is not simulated to its end, because it will not be chosen.
    fn cost_limit(&self) -> f64 {
        let best = self.forecasts.get(best(&self.forecasts, self.sees_the_end));
        best.filter(|best| best.good).map_or(f64::INFINITY, |best| best.cost)
    }

    /// The best alternative found so far; the interim plan if none is finished.
    #[must_use]
    pub fn choose(&self) -> PlanBundle {
        let best = if self.forecasts.is_empty() { self.interim } else { best(&self.forecasts, self.sees_the_end) };
        let mut bundle = self.alternatives[best].clone();
        bundle.plan.candidates = self.forecasts.len() as u32;
        if let Some(forecast) = self.forecasts.get(best).filter(|forecast| forecast.good) {
            bundle.plan.predicted_s = forecast.pass_s;
        }
        bundle
    }
}

/// Whether no other obstacle set fits between the known obstacles and the last slot of this many drones at the mission's
/// end.
fn sees_the_end(params: &RolloutParams, obstacles: &[SensedShape], drones: usize) -> bool {
    let last_x_m = params.end_slots(drones).into_iter().fold(f64::INFINITY, f64::min);
    let known = obstacles.iter().map(|known| known.shape.bounds().1.x);
    let room_m = last_x_m - known.fold(f64::NEG_INFINITY, f64::max);
    room_m <= ROOM_FOR_A_SET * params.planner.routes.planning_distance_m
}

/// The plan with the next epoch, so that it supersedes the interim plan.
fn superseding(mut bundle: PlanBundle, decision: SimTime) -> PlanBundle {
    let id = &mut bundle.plan.id;
    id.epoch = id.epoch.saturating_add(1);
    let id = *id;
    bundle.plan.stamp = decision;
    bundle.parts.change_all(|part| part.id = id);
    bundle
}

#[cfg(test)]
mod tests;
