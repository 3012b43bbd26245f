//! Look-ahead: a leader flies each alternative ahead in its mind, with the drones' own guidance, on what it knows, and
//! takes the best.
//!
//! While it thinks the swarm is already on its shortest ways, and when it decides is fixed beforehand: that is the
//! paper's t_c, and all alternatives are rehearsed from where the swarm will be by then. A fixed number of steps a tick,
//! so that the outcome does not depend on the machine. The shortest ways stay unless something else is clearly better:
//! then the flight is the one that it would have been without a rehearsal.

use crate::stage::{Forecast, Stage};
use crate::swarm_pilot::SwarmPilot;
use skein_leader::ledger::Orders;
use skein_leader::planner::{Destination, Member, Objective};
use skein_protocol::downlink::SensedShape;
use skein_protocol::{DroneId, SimTime};

/// How long a leader thinks, s.
const THINKING_S: f64 = 1.0;
/// Length of a rehearsed step, s; never shorter than a tick.
const STEP_S: f64 = 0.1;
/// Drone-steps rehearsed in a second, the same share of them in each tick.
const STEPS_A_SECOND: f64 = 60_000.0;
/// Larger swarms are not rehearsed: the neighbours of all drones are looked for pair by pair.
pub const MOST_MEMBERS: usize = 32;
/// A grouping has to cost less than the shortest ways by this share of their cost, …
const WORTH: f64 = 0.01;
/// … and by this one while there is room for obstacles that nobody has seen yet: what they undo is not foreseen.
const WORTH_UNSEEN: f64 = 0.1;
/// An obstacle set that is told apart from the one before takes so many planning distances at least.
const ROOM: f64 = 3.0;

/// When a rehearsal begins, and how it goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Tick.
    pub tick: u64,
    /// Time of that tick.
    pub now: SimTime,
    /// What is to be least.
    pub objective: Objective,
}

/// A rehearsal under way.
#[derive(Clone, Debug)]
pub struct Rehearsal {
    members: Vec<DroneId>,
    /// Steps of all drones in a tick.
    steps_a_tick: usize,
    shapes: Vec<SensedShape>,
    objective: Objective,
    decision_tick: u64,
    /// By which share of their cost the shortest ways have to be undercut.
    worth: f64,
    /// The shortest ways first: what the swarm does already.
    alternatives: Vec<Orders>,
    forecasts: Vec<Forecast>,
    /// The swarm while the leader thinks, then as it will be at the decision.
    thinking: Stage,
    stage: Option<Stage>,
}

impl Rehearsal {
    /// A rehearsal of these alternatives by their leader, before it obeys the first of them.
    #[must_use]
    pub fn new(leader: &SwarmPilot, start: Start, all: Vec<Orders>) -> Self {
        let dt_s = leader.params.dt_s;
        let ticks = ((STEP_S / dt_s).round() as u64).max(1);
        let step_s = dt_s * ticks as f64;
        let steps = (THINKING_S / step_s).ceil() as u64;
        let shape =
            |(id, known): (_, &skein_leader::obstacles::Known)| SensedShape { shape: known.shape, id, reserved: 0 };
        let crew = leader.leading.living();
        let thinking = Stage::new(leader, &crew, &all[0], (start.tick / ticks, start.now, step_s), steps);
        let decision = start.now.after(step_s * steps as f64);
        let most = STEPS_A_SECOND * dt_s / crew.len().max(1) as f64;
        Self {
            members: leader.leading.members().iter().map(|member| member.id).collect(),
            steps_a_tick: (most as usize).max(1),
            shapes: leader.leading.obstacles.iter().map(shape).collect(),
            objective: start.objective,
            worth: if leader.sees_the_end(crew.len()) { WORTH } else { WORTH_UNSEEN },
            decision_tick: start.tick + ticks * steps,
            alternatives: all.into_iter().map(|orders| restamped(orders, decision)).collect(),
            forecasts: Vec::new(),
            thinking,
            stage: None,
        }
    }

    /// Whether what it rests on still holds: the same members, and no further obstacle.
    #[must_use]
    pub fn still_holds(&self, members: &[Member], obstacles: usize) -> bool {
        obstacles == self.shapes.len() && members.iter().map(|member| &member.id).eq(&self.members)
    }

    /// Goes on for one tick; the chosen orders once it is time.
    pub fn work(&mut self, tick: u64) -> Option<Orders> {
        if tick >= self.decision_tick {
            return Some(self.choose());
        }
        let mut left = self.steps_a_tick;
        while left > 0 && self.forecasts.len() < self.alternatives.len() {
            left -= 1;
            if self.thinking.is_thinking() {
                self.thinking.step(&self.shapes);
                continue;
            }
            let (limit, next) = (self.limit(), &self.alternatives[self.forecasts.len()]);
            let stage = self.stage.get_or_insert_with(|| self.thinking.under(next));
            stage.step(&self.shapes);
            if let Some(forecast) = stage.judge(&self.objective, limit) {
                self.forecasts.push(forecast);
                self.stage = None;
            }
        }
        None
    }

    /// What is dearer than this is not worth being flown to its end.
    fn limit(&self) -> f64 {
        let good = self.forecasts.iter().filter(|forecast| forecast.good);
        good.map(|forecast| forecast.cost).fold(f64::INFINITY, f64::min)
    }

    /// What was found to be best by now.
    #[must_use]
    pub fn choose(&self) -> Orders {
        let best = best(&self.forecasts, self.worth);
        let mut orders = self.alternatives[best].clone();
        orders.plan.candidates = self.forecasts.len() as u32;
        if let Some(forecast) = self.forecasts.get(best).filter(|forecast| forecast.good) {
            orders.plan.predicted_s = forecast.pass_s;
        }
        orders
    }
}

/// The best of those that are good, if it undercuts the first, the shortest ways, by this share of its cost; else these.
/// The second, the rule's, is taken before what is hardly better: a forecast is not more exact than that.
fn best(forecasts: &[Forecast], worth: f64) -> usize {
    let order = |a: &usize, b: &usize| {
        let (a, b) = (&forecasts[*a], &forecasts[*b]);
        a.cost.total_cmp(&b.cost).then(a.energy_j.total_cmp(&b.energy_j)).then(a.end_s.total_cmp(&b.end_s))
    };
    let enough = match forecasts.first() {
        Some(shortest) if shortest.good => (1.0 - worth) * shortest.cost,
        _ => f64::INFINITY,
    };
    let good = (0..forecasts.len()).filter(|&i| forecasts[i].good);
    let Some(best) = good.min_by(order).filter(|&best| forecasts[best].cost <= enough) else { return 0 };
    let as_good = |rule: &&Forecast| rule.good && (1.0 - WORTH) * rule.cost <= forecasts[best].cost;
    let rule = forecasts.get(1).filter(as_good).filter(|rule| rule.cost <= enough);
    if best > 0 && rule.is_some() { 1 } else { best }
}

impl SwarmPilot {
    /// Whether no other obstacle set fits between those known and where the last of so many drones will be at the
    /// mission's end.
    fn sees_the_end(&self, members: usize) -> bool {
        let planner = &self.params.planner;
        let stop_x_m = match planner.destination {
            Destination::Hold { stop_x_m } => stop_x_m,
            Destination::Goal { front_m } => front_m.x,
        };
        let slots = planner.shape.slots(members, planner.spacing_m);
        let last_x_m = stop_x_m + slots.iter().map(|slot| slot.x).fold(0.0, f64::min);
        let known = self.leading.obstacles.iter().map(|(_, known)| known.shape.bounds().1.x);
        last_x_m - known.fold(f64::NEG_INFINITY, f64::max) <= ROOM * planner.routes.planning_distance_m
    }
}

/// Orders that replace those which the swarm obeys while the leader thinks.
fn restamped(mut orders: Orders, decision: SimTime) -> Orders {
    let id = &mut orders.plan.id;
    id.epoch = id.epoch.saturating_add(1);
    let id = *id;
    orders.plan.stamp = decision;
    orders.parts.values_mut().for_each(|part| part.id = id);
    orders
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forecast(good: bool, cost: f64, end_s: f64) -> Forecast {
        Forecast { good, cost, energy_j: 1000.0 * cost, end_s, pass_s: 10.0 }
    }

    #[test]
    fn the_shortest_ways_stay_unless_something_is_clearly_better() {
        let of = |costs: &[f64]| costs.iter().map(|&cost| forecast(true, cost, 30.0)).collect::<Vec<_>>();
        assert_eq!(best(&of(&[60.0, 59.5, 61.0]), 0.01), 0);
        assert_eq!(best(&of(&[60.0, 59.3, 54.0]), 0.01), 2);
        assert_eq!(best(&of(&[60.0, 59.3, 54.5]), 0.1), 0);
        assert_eq!(best(&[], 0.01), 0);
    }

    #[test]
    fn the_rule_is_followed_where_something_else_is_hardly_better() {
        let of = |costs: &[f64]| costs.iter().map(|&cost| forecast(true, cost, 30.0)).collect::<Vec<_>>();
        assert_eq!(best(&of(&[60.0, 55.0, 54.6]), 0.01), 1);
        assert_eq!(best(&of(&[60.0, 55.0, 54.0]), 0.01), 2);
        assert_eq!(best(&of(&[60.0, 59.6, 59.2]), 0.01), 2, "but not if it is hardly better than the shortest ways");
        assert_eq!(best(&[of(&[60.0])[0], forecast(false, 50.0, 30.0), of(&[50.2])[0]], 0.01), 2);
    }

    #[test]
    fn what_does_not_keep_its_distances_is_not_taken_and_ties_go_to_the_earlier_end() {
        let shortest = forecast(true, 60.0, 30.0);
        assert_eq!(best(&[shortest, forecast(false, 50.0, 28.0)], 0.01), 0);
        let (jams, late, early) = (forecast(false, 50.0, 28.0), forecast(true, 50.0, 29.0), forecast(true, 50.0, 28.0));
        assert_eq!(best(&[shortest, jams, late, early], 0.01), 3);
        // Jammed on the shortest ways: anything that gets through.
        assert_eq!(best(&[forecast(false, 20.0, 200.0), forecast(true, 90.0, 40.0)], 0.01), 1);
    }
}
