//! Look-ahead: a leader flies each alternative ahead in its mind, with the drones' own guidance, on what it knows, and
//! takes the best.
//!
//! While it thinks the swarm is already on its shortest ways (or, if groups meet and it saves much, the rule's), and when
//! it decides is fixed beforehand: that is the paper's t_c, and all alternatives are rehearsed from where the swarm will be
//! by then. A fixed number of steps a tick, so that the outcome does not depend on the machine. The shortest ways are taken
//! unless something else is clearly better.

use crate::stage::{Forecast, Stage, end_slots};
use crate::swarm_pilot::SwarmPilot;
use skein_leader::member::Member;
use skein_leader::params::Objective;
use skein_leader::plan_bundle::PlanBundle;
use skein_protocol::downlink::SensedShape;
use skein_protocol::{DroneId, SimTime};

/// How long a leader thinks, s.
const THINKING_S: f64 = 1.0;
/// Length of a rehearsed step, s; never shorter than a tick.
const STEP_S: f64 = 0.1;
/// Drone-steps rehearsed in a second, the same share of them in each tick.
const STEPS_A_SECOND: f64 = 120_000.0;
/// Larger swarms are not rehearsed: the neighbours of all drones are looked for pair by pair.
pub const MAX_MEMBERS: usize = 32;
/// A grouping has to cost less than the shortest ways by this share of their cost. …
const WORTH: f64 = 0.03;
/// … While there is room for obstacles that nobody has seen yet, it has to cost less by this share, …
const WORTH_UNSEEN: f64 = 0.2;
/// … or to be past those that are seen in less time by this one: what unseen ones undo, and whether they leave the time
/// that is won, is not foreseen. …
const SOONER_UNSEEN: f64 = 0.185;
/// … Where no way grows, nothing can be undone: then it is enough to cost no more and to be past in less time by this
/// share.
const SOONER_AS_LONG: f64 = 0.09;
/// Ways are as long as others but for what is rounded, by this share.
const ROUNDING: f64 = 1e-6;
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
pub struct Rollout {
    members: Vec<DroneId>,
    /// Steps of all drones in a tick.
    steps_a_tick: usize,
    shapes: Vec<SensedShape>,
    objective: Objective,
    decision_tick: u64,
    /// Whether there is no room left for obstacles that nobody has seen yet.
    sees_the_end: bool,
    /// Which of the alternatives is flown while the leader thinks.
    meanwhile: usize,
    /// The shortest ways first, the rule's second.
    alternatives: Vec<PlanBundle>,
    forecasts: Vec<Forecast>,
    /// The swarm while the leader thinks, then as it will be at the decision.
    thinking: Stage,
    stage: Option<Stage>,
}

impl Rollout {
    /// A rehearsal of these alternatives by their leader, before it obeys one of them.
    #[must_use]
    pub fn new(leader: &SwarmPilot, start: Start, all: Vec<PlanBundle>) -> Self {
        let dt_s = leader.params.dt_s;
        let ticks = ((STEP_S / dt_s).round() as u64).max(1);
        let step_s = dt_s * ticks as f64;
        let steps = (THINKING_S / step_s).ceil() as u64;
        let shape =
            |(id, known): (_, &skein_leader::obstacles::Known)| SensedShape { shape: known.shape, id, reserved: 0 };
        let crew = leader.leading.living();
        let meanwhile = leader.leading.interim();
        let thinking = Stage::new(leader, &crew, &all[meanwhile], (start.tick / ticks, start.now, step_s), steps);
        let decision = start.now.after(step_s * steps as f64);
        let most = STEPS_A_SECOND * dt_s / crew.len().max(1) as f64;
        Self {
            members: leader.leading.members().iter().map(|member| member.id).collect(),
            steps_a_tick: (most as usize).max(1),
            shapes: leader.leading.obstacles().iter().map(shape).collect(),
            objective: start.objective,
            sees_the_end: leader.sees_the_end(crew.len()),
            decision_tick: start.tick + ticks * steps,
            meanwhile,
            alternatives: all.into_iter().map(|bundle| restamped(bundle, decision)).collect(),
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
    pub fn work(&mut self, tick: u64) -> Option<PlanBundle> {
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

    /// What is dearer than this is not worth being flown to its end: it will not be taken.
    fn limit(&self) -> f64 {
        let best = self.forecasts.get(best(&self.forecasts, self.sees_the_end));
        best.filter(|best| best.good).map_or(f64::INFINITY, |best| best.cost)
    }

    /// What was found to be best by now; what is flown already if nothing was found yet.
    #[must_use]
    pub fn choose(&self) -> PlanBundle {
        let best = if self.forecasts.is_empty() { self.meanwhile } else { best(&self.forecasts, self.sees_the_end) };
        let mut bundle = self.alternatives[best].clone();
        bundle.plan.candidates = self.forecasts.len() as u32;
        if let Some(forecast) = self.forecasts.get(best).filter(|forecast| forecast.good) {
            bundle.plan.predicted_s = forecast.pass_s;
        }
        bundle
    }
}

/// Whether a forecast is good enough to leave the shortest ways.
fn undercuts(forecast: &Forecast, shortest: &Forecast, sees_the_end: bool) -> bool {
    let cheaper = |share: f64| forecast.cost <= (1.0 - share) * shortest.cost;
    let sooner = |share: f64| forecast.pass_s <= (1.0 - share) * shortest.pass_s;
    let as_long = forecast.way_s - shortest.way_s <= ROUNDING * shortest.way_s.abs();
    if !shortest.good {
        return true;
    }
    match sees_the_end {
        true => cheaper(WORTH),
        false => {
            let well = cheaper(WORTH_UNSEEN) || (cheaper(WORTH) && sooner(SOONER_UNSEEN));
            well || (as_long && cheaper(0.0) && sooner(SOONER_AS_LONG))
        }
    }
}

/// The best of those that are good, if it undercuts the first, the shortest ways; else these. The second, the rule's, is
/// taken before what is hardly better: a forecast is not more exact than that.
fn best(forecasts: &[Forecast], sees_the_end: bool) -> usize {
    let order = |a: &usize, b: &usize| {
        let (a, b) = (&forecasts[*a], &forecasts[*b]);
        a.cost.total_cmp(&b.cost).then(a.energy_j.total_cmp(&b.energy_j)).then(a.end_s.total_cmp(&b.end_s))
    };
    let worth = |&i: &usize| forecasts[i].good && (i == 0 || undercuts(&forecasts[i], &forecasts[0], sees_the_end));
    let worthy: Vec<usize> = (0..forecasts.len()).filter(worth).collect();
    let Some(best) = worthy.iter().copied().min_by(order) else { return 0 };
    let as_good = |rule: &Forecast| (1.0 - WORTH) * rule.cost <= forecasts[best].cost;
    if best > 0 && worthy.contains(&1) && as_good(&forecasts[1]) { 1 } else { best }
}

impl SwarmPilot {
    /// Whether no other obstacle set fits between those known and where the last of so many drones will be at the
    /// mission's end.
    fn sees_the_end(&self, members: usize) -> bool {
        let planner = &self.params.planner;
        let last_x_m = end_slots(planner, members).into_iter().fold(f64::INFINITY, f64::min);
        let known = self.leading.obstacles().iter().map(|(_, known)| known.shape.bounds().1.x);
        last_x_m - known.fold(f64::NEG_INFINITY, f64::max) <= ROOM * planner.routes.planning_distance_m
    }
}

/// Orders that replace those which the swarm obeys while the leader thinks.
fn restamped(mut bundle: PlanBundle, decision: SimTime) -> PlanBundle {
    let id = &mut bundle.plan.id;
    id.epoch = id.epoch.saturating_add(1);
    let id = *id;
    bundle.plan.stamp = decision;
    bundle.parts.iter_mut().for_each(|part| part.id = id);
    bundle
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forecast(good: bool, cost: f64, end_s: f64) -> Forecast {
        Forecast { good, cost, energy_j: 1000.0 * cost, end_s, pass_s: 10.0, way_s: 10.0 }
    }

    #[test]
    fn the_shortest_ways_stay_unless_something_is_clearly_better() {
        let of = |costs: &[f64]| costs.iter().map(|&cost| forecast(true, cost, 30.0)).collect::<Vec<_>>();
        assert_eq!(best(&of(&[60.0, 58.3, 61.0]), true), 0);
        assert_eq!(best(&of(&[60.0, 58.1, 54.0]), true), 2);
        assert_eq!(best(&of(&[60.0, 58.1, 48.5]), false), 0);
        assert_eq!(best(&[], true), 0);
    }

    #[test]
    fn before_what_nobody_has_seen_time_counts_as_well() {
        let shortest = Forecast { pass_s: 20.0, ..forecast(true, 60.0, 30.0) };
        let other = |cost: f64, pass_s: f64| Forecast { pass_s, way_s: 11.0, ..forecast(true, cost, 30.0) };
        let as_long = |cost: f64, pass_s: f64| Forecast { way_s: 10.0, ..other(cost, pass_s) };
        assert_eq!(best(&[shortest, other(58.0, 16.4)], false), 0);
        assert_eq!(best(&[shortest, other(58.0, 16.2)], false), 1);
        assert_eq!(best(&[shortest, other(58.5, 12.0)], false), 0, "hardly cheaper");
        assert_eq!(best(&[shortest, other(47.9, 20.0)], false), 1);
        assert_eq!(best(&[shortest, other(57.0, 17.5), other(58.0, 16.2)], false), 2);
        assert_eq!(best(&[shortest, as_long(59.9, 18.1)], false), 1, "no way is longer");
        assert_eq!(best(&[shortest, as_long(59.9, 18.3)], false), 0);
        assert_eq!(best(&[shortest, as_long(60.1, 15.0)], false), 0);
        assert_eq!(best(&[shortest, other(58.0, 20.0)], true), 1);
    }

    #[test]
    fn the_rule_is_followed_where_something_else_is_hardly_better() {
        let of = |costs: &[f64]| costs.iter().map(|&cost| forecast(true, cost, 30.0)).collect::<Vec<_>>();
        assert_eq!(best(&of(&[60.0, 55.0, 54.6]), true), 1);
        assert_eq!(best(&of(&[60.0, 55.0, 53.0]), true), 2);
        assert_eq!(best(&of(&[60.0, 58.6, 57.9]), true), 2, "but not if it is hardly better than the shortest ways");
        assert_eq!(best(&[of(&[60.0])[0], forecast(false, 50.0, 30.0), of(&[50.2])[0]], true), 2);
    }

    #[test]
    fn what_does_not_keep_its_distances_is_not_taken_and_ties_go_to_the_earlier_end() {
        let shortest = forecast(true, 60.0, 30.0);
        assert_eq!(best(&[shortest, forecast(false, 50.0, 28.0)], true), 0);
        let (jams, late, early) = (forecast(false, 50.0, 28.0), forecast(true, 50.0, 29.0), forecast(true, 50.0, 28.0));
        assert_eq!(best(&[shortest, jams, late, early], true), 3);
        // Jammed on the shortest ways: anything that gets through.
        assert_eq!(best(&[forecast(false, 20.0, 200.0), forecast(true, 90.0, 40.0)], true), 1);
    }
}
