//! What a leader decides: when to plan, and for whom. Paper, Algorithms 1, 3 and 5. Everything it knows came by its own
//! senses or by messages.

use crate::joint::Joint;
use crate::ledger::{Ledger, PlanBundle, PlannedSet};
use crate::obstacles::{Obstacles, set_array};
use crate::plan_exchange::PlanExchange;
use crate::reform::Reform;
use crate::routes::RouteParams;
use crate::slots::Reformation;
use skein_protocol::formation::Shape;
use skein_protocol::payload::{Arrivals, PHASE_AVOID, Plan};
use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp, SimTime, Vec2};
use std::collections::BTreeMap;

/// How a leader chooses among the groupings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Strategy {
    /// Least time of the last drone past the gate (paper, Algorithm 3).
    PaperRule,
    /// The best few groupings by that rule and the shortest ways, flown ahead in a rehearsal; the best wins.
    LookAhead(Objective),
    /// Each drone takes its own shortest way.
    ShortestPath,
    /// So many drones on the left and on the right of one obstacle, each side filled in the least time.
    Fixed {
        /// On the left route.
        left: usize,
        /// On the right route.
        right: usize,
    },
}

/// What a rehearsed mission costs: a weighted sum. Ties go to the lower energy, then to the earlier end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Objective {
    /// Weight of the energy of all drones until the mission's end, 1/kJ.
    pub energy_per_kj: f64,
    /// Weight of the time until the mission's end, 1/s.
    pub time_per_s: f64,
}

impl Objective {
    /// The cost of so much energy (J) and time (s).
    #[must_use]
    pub fn cost(&self, energy_j: f64, time_s: f64) -> f64 {
        self.energy_per_kj * energy_j / 1000.0 + self.time_per_s * time_s
    }
}

/// Where a mission ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Destination {
    /// In formation, at rest, once the front slot is this far along the flight, m.
    Hold {
        /// Abscissa at which a moving anchor stops, m.
        stop_x_m: f64,
    },
    /// In the slots of a formation whose front slot is here, m.
    Goal {
        /// The front slot.
        front_m: Vec2,
    },
}

/// The parts of a plan, said and repeated, are heard within so long, s; the air's delay comes on top, both ways.
const AWAITED_S: f64 = 1.0;

impl Destination {
    /// Distance that decides elections: the smaller, the closer to the destination. m.
    #[must_use]
    pub fn distance_m(&self, position: Vec2) -> f64 {
        match self {
            Self::Hold { .. } => -position.x,
            Self::Goal { front_m } => (front_m - position).norm(),
        }
    }
}

/// What planning needs to know of the mission.
#[derive(Clone, Debug)]
pub struct PlannerParams {
    /// How groupings are chosen.
    pub strategy: Strategy,
    /// Nominal speed, m/s.
    pub speed_mps: f64,
    /// Time between two drones on a route, s.
    pub headway_s: f64,
    /// Clearances of routes.
    pub routes: RouteParams,
    /// The formation.
    pub shape: Shape,
    /// Its spacing, m.
    pub spacing_m: f64,
    /// Who takes which slot.
    pub reformation: Reformation,
    /// A drone has arrived when it is as near as this to its slot, m.
    pub arrival_error_m: f64,
    /// Distance of slots from drones that hang dead in the air, m.
    pub safe_distance_m: f64,
    /// Ordinate of the course line, m.
    pub course_y_m: f64,
    /// Where the mission ends.
    pub destination: Destination,
    /// A new obstacle waits for others so long before it is planned for, and a changed membership before slots are, s.
    pub debounce_s: f64,
}

/// A living member of the group, as its leader knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// Who.
    pub id: DroneId,
    /// Where it is by now, m.
    pub position: Vec2,
    /// How fast it flies, m/s.
    pub speed_mps: f64,
    /// Its velocity, m/s.
    pub velocity: Vec2,
    /// The group it is in.
    pub group: GroupId,
    /// Whether its last beacon shows that it obeys this leader's term.
    pub follows: bool,
}

/// What a leader knows when it decides.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Now.
    pub now: SimTime,
    /// Its term.
    pub ballot: Ballot,
    /// The group that it leads.
    pub scope: GroupId,
    /// The living members, itself included, by id.
    pub members: &'a [Member],
    /// Living drones of other groups, by id.
    pub others: &'a [Member],
    /// How long a message is on the air, s.
    pub delay_s: f64,
    /// Where silent drones may hang in the air, m.
    pub silent: &'a [Vec2],
    /// Known obstacles.
    pub obstacles: &'a Obstacles,
    /// What was planned so far.
    pub ledger: &'a Ledger,
}

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
    pub(crate) fn plan(&self, s: &Situation<'_>, phase: u32, set: &[ObstacleId], anchor: Vec2) -> Plan {
        let stop_x_m = match self.params.destination {
            Destination::Hold { stop_x_m } => stop_x_m,
            Destination::Goal { front_m } => front_m.x,
        };
        let moving = phase != PHASE_AVOID && anchor.x < stop_x_m;
        let newest = s.ledger.newest();
        let epoch = if newest.ballot == s.ballot { newest.epoch.saturating_add(1) } else { 1 };
        let (set, set_count) = set_array(set);
        Plan {
            stamp: s.now,
            id: PlanStamp { ballot: s.ballot, epoch },
            group: s.scope,
            phase,
            members: s.members.len() as u32,
            anchor_m: if phase == PHASE_AVOID { [0.0; 2] } else { anchor.into() },
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

impl PlannerParams {
    /// Who leads the group of each member: the one of it that is closest to the destination; ties: the lower id.
    pub(crate) fn fronts(&self, members: &[Member], groups: &[GroupId]) -> Vec<DroneId> {
        let distance_m = |m: &Member| self.destination.distance_m(m.position);
        let mut first: BTreeMap<GroupId, &Member> = BTreeMap::new();
        for (member, &group) in members.iter().zip(groups) {
            let best = first.entry(group).or_insert(member);
            if distance_m(member) < distance_m(best) {
                *best = member;
            }
        }
        groups.iter().map(|group| first.get(group).map_or(DroneId::NONE, |m| m.id)).collect()
    }
}
