//! What a leader decides: when to plan, and for whom. Paper, Algorithms 1, 3 and 5. Everything it knows came by its own
//! senses or by messages.

use crate::joint::Joint;
use crate::member::Member;
use crate::obstacles::{Obstacles, set_array};
use crate::params::PlannerParams;
use crate::plan_bundle::PlanBundle;
use crate::plan_exchange::PlanExchange;
use crate::planned_set::PlannedSet;
use crate::reform::Reform;
use crate::situation::Situation;
use skein_protocol::payload::{Arrivals, Plan};
use skein_protocol::{DroneId, GroupId, ObstacleId, Phase, PlanStamp, SimTime, Vec2};

/// The parts of a plan, said and repeated, are heard within so long, s; the air's delay comes on top, both ways.
const AWAITED_S: f64 = 1.0;

/// The deciding part of a drone; idle unless the drone leads.
#[derive(Clone, Debug)]
pub struct Planner {
    pub(crate) params: PlannerParams,
    pub(crate) reform: Reform,
    pub(crate) plan_exchange: PlanExchange,
    pub(crate) joint: Option<Joint>,
    /// Which of the alternatives decided on last is flown while a leader thinks.
    pub(crate) meanwhile: usize,
}

/// What is to be decided.
enum Need {
    /// The ways past this set.
    Plan(Vec<ObstacleId>),
    /// Nothing: the group is on its way past a set.
    Wait,
    /// Slots, if they are not given already.
    Formation,
}

impl Planner {
    /// A planner that has decided nothing yet, in a swarm of `drones`; questions are repeated every `repeat_s`.
    #[must_use]
    pub fn new(params: PlannerParams, drones: u32, repeat_s: f64) -> Self {
        Self {
            params,
            reform: Reform::default(),
            plan_exchange: PlanExchange::new(drones, repeat_s),
            joint: None,
            meanwhile: 0,
        }
    }

    /// Hears when a drone of another group can be where.
    pub fn hear(&mut self, now: SimTime, row: &Arrivals) {
        self.plan_exchange.hear(now, row);
    }

    /// New orders, if there is something to decide: one, or alternatives to rehearse, the shortest ways first,
    /// the paper's rule second.
    /// What other leaders are to be asked or told goes into `say`.
    pub fn decide(&mut self, s: &Situation<'_>, say: &mut Vec<Arrivals>) -> Vec<PlanBundle> {
        if let Some(planned) =
            self.plan_exchange.asked(s.now).and_then(|tag| s.ledger.sets().iter().find(|p| p.tag == tag))
        {
            say.extend(self.standing(s, planned));
        }
        self.plan_exchange.repeat(s.now, say);
        if let Some(bundle) = self.chosen(s) {
            return vec![bundle];
        }
        match self.need(s) {
            Need::Plan(set) => {
                let since = self.learnt(s, &set);
                let due = s.now.since(since) >= self.params.debounce_s;
                due.then(|| self.avoid(s, &set, say)).flatten().unwrap_or_default()
            }
            Need::Formation if s.scope == GroupId::ALL => self.formation(s).into_iter().collect(),
            Need::Wait | Need::Formation => Vec::new(),
        }
    }

    /// Whether some of these drones still have an obstacle set to pass.
    pub fn has_ahead(&self, obstacles: &Obstacles, drones: impl Iterator<Item = Member> + Clone) -> bool {
        obstacles.sets().iter().any(|set| {
            let exit_x_m = self.exit_x_m(obstacles, set);
            drones.clone().any(|m| !obstacles.is_past(m.id, m.position.x, set, exit_x_m))
        })
    }

    /// The first set, in flight order, that somebody still has to pass and that is not planned for in this term. A group
    /// that is split leaves that to the leaders of its parts, but for members of no part.
    fn need(&self, s: &Situation<'_>) -> Need {
        let split = s.members.iter().any(|m| m.group != s.scope && s.scope.contains(m.group));
        let homeless = |m: &&Member| !s.scope.contains(m.group) || (split && m.group == s.scope);
        let mut need = Need::Formation;
        for set in s.obstacles.sets() {
            let exit_x_m = self.exit_x_m(s.obstacles, set);
            let past = |m: &Member| s.obstacles.is_past(m.id, m.position.x, set, exit_x_m);
            if s.members.iter().all(past) {
                continue;
            }
            let planned = s.ledger.sets().iter().find(|p| p.ids == *set && holds(p, s));
            // Who is past it all the same joins those who are not.
            let joins = |m: &&Member| planned.is_some() && homeless(m);
            let waiting: Vec<&Member> = s.members.iter().filter(|m| !past(m) || joins(m)).collect();
            let has_part = |m: &&Member| planned.is_some_and(|p| p.parts.contains(m.id)) && !homeless(m);
            let others_wait =
                if planned.is_some() { !waiting.iter().any(homeless) } else { !waiting.iter().all(homeless) };
            let left_to_parts = split && others_wait;
            if !left_to_parts && !waiting.iter().all(has_part) && !planned.is_some_and(|p| is_awaited(p, s)) {
                return Need::Plan(set.clone());
            }
            need = Need::Wait;
        }
        need
    }

    pub(crate) fn exit_x_m(&self, obstacles: &Obstacles, set: &[ObstacleId]) -> f64 {
        obstacles.exit_x_m(set, self.params.routes.planning_distance_m)
    }

    /// Drones of other groups that still have to pass a set.
    pub(crate) fn others_before(&self, s: &Situation<'_>, set: &[ObstacleId]) -> Vec<DroneId> {
        let exit_x_m = self.exit_x_m(s.obstacles, set);
        let before = |m: &&Member| !s.obstacles.is_past(m.id, m.position.x, set, exit_x_m);
        s.others.iter().filter(before).map(|m| m.id).collect()
    }

    /// When the newest obstacle of a set was learnt that no plan holds yet; the start if all are planned for already
    /// and only the term or the members changed.
    fn learnt(&self, s: &Situation<'_>, set: &[ObstacleId]) -> SimTime {
        let planned = |id: &ObstacleId| s.ledger.sets().iter().any(|p| p.ids.contains(id));
        let new = set.iter().filter(|id| !planned(id)).filter_map(|&id| s.obstacles.get(id));
        new.map(|known| known.since).max().unwrap_or(SimTime::ZERO)
    }

    /// The plan's common part. An anchor that is already where it stops does not move.
    pub(crate) fn plan(&self, s: &Situation<'_>, phase: Phase, set: &[ObstacleId], anchor: Vec2) -> Plan {
        let stop_x_m = self.params.destination.stop_x_m();
        let moving = phase != Phase::Avoid && anchor.x < stop_x_m;
        let newest = s.ledger.newest();
        let epoch = if newest.ballot == s.ballot { newest.epoch.saturating_add(1) } else { 1 };
        let (set, set_count) = set_array(set);
        Plan {
            stamp: s.now,
            id: PlanStamp { ballot: s.ballot, epoch },
            group: s.scope,
            phase: phase.to_wire(),
            members: s.members.len() as u32,
            anchor_m: if phase == Phase::Avoid { [0.0; 2] } else { anchor.into() },
            anchor_mps: [if moving { self.params.speed_mps } else { 0.0 }, 0.0],
            anchor_stop_x_m: stop_x_m,
            predicted_s: f64::NAN,
            candidates: 0,
            routes: 0,
            set_count,
            set,
            reserved: 0,
        }
    }
}

/// Whether some parts of a plan may still be on the air, from its leader to this one: to give them anew would undo the order
/// of a queue that others already fly in.
fn is_awaited(planned: &PlannedSet, s: &Situation<'_>) -> bool {
    let age_s = s.now.since(planned.made);
    planned.stamp.ballot != s.ballot
        && planned.parts.len() < planned.members as usize
        && (0.0..AWAITED_S + 2.0 * s.delay_s).contains(&age_s)
}

/// Whether a plan for a set was made in this term, or by the leader of the group that this one was split from.
fn holds(planned: &PlannedSet, s: &Situation<'_>) -> bool {
    planned.stamp.ballot == s.ballot || (planned.scope != s.scope && planned.scope.contains(s.scope))
}
