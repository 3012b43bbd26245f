//! What a leader decides: when to plan, and for whom. Paper, Algorithms 1, 3 and 5. Everything it knows came by its own
//! senses or by messages.

use crate::cost::{Flight, arrival_s};
use crate::ledger::{Ledger, Orders, PlannedSet};
use crate::obstacles::{Obstacles, set_array};
use crate::routes::{RouteParams, Routes};
use crate::slots;
use crate::split::Table;
use skein_protocol::formation::Shape;
use skein_protocol::payload::{Assignment, NO_ROUTE, PHASE_AVOID, PHASE_CRUISE, PHASE_REFORM, Plan};
use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp, SimTime, Vec2};
use std::collections::BTreeMap;

/// How a leader chooses among the groupings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Least time of the last drone past the gate (paper, Algorithm 3).
    CongestionAware,
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
}

/// What a leader knows when it decides.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// Now.
    pub now: SimTime,
    /// Its term.
    pub ballot: Ballot,
    /// The living members, itself included, by id.
    pub members: &'a [Member],
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
    params: PlannerParams,
    /// Since when the members are others than those planned for.
    changed: Option<SimTime>,
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

/// Slots within the safe distance of a dead drone: the anchor moves on in such steps, m.
const ANCHOR_STEP_M: f64 = 5.0;

impl Planner {
    /// A planner that has decided nothing yet.
    #[must_use]
    pub fn new(params: PlannerParams) -> Self {
        Self { params, changed: None }
    }

    /// New orders, if there is something to decide.
    pub fn decide(&mut self, s: &Situation<'_>) -> Option<Orders> {
        match self.need(s) {
            Need::Plan(set) => {
                let since = self.learnt(s, &set);
                (s.now.since(since) >= self.params.debounce_s).then(|| self.avoid(s, &set)).flatten()
            }
            Need::Wait => None,
            Need::Formation => self.formation(s),
        }
    }

    /// The first set, in flight order, that somebody still has to pass and that is not planned for in this term.
    fn need(&self, s: &Situation<'_>) -> Need {
        let mut need = Need::Formation;
        for set in s.obstacles.sets(2.0 * self.params.routes.planning_distance_m) {
            let exit_x_m = self.exit_x_m(s.obstacles, &set);
            let mut waiting = s.members.iter().filter(|m| !is_past(s.obstacles, &set, exit_x_m, m)).peekable();
            if waiting.peek().is_none() {
                continue;
            }
            let planned = s.ledger.sets().iter().find(|p| p.ids == set && p.stamp.ballot == s.ballot);
            if !planned.is_some_and(|p| waiting.all(|m| p.parts.contains_key(&m.id))) {
                return Need::Plan(set);
            }
            need = Need::Wait;
        }
        need
    }

    fn exit_x_m(&self, obstacles: &Obstacles, set: &[ObstacleId]) -> f64 {
        let rear = set.iter().filter_map(|&id| obstacles.get(id)).map(|known| known.shape.bounds().1.x);
        rear.fold(f64::NEG_INFINITY, f64::max) + self.params.routes.planning_distance_m
    }

    /// When the newest obstacle of a set was learnt that no plan holds yet; the start if all are planned for already
    /// and only the term or the members changed.
    fn learnt(&self, s: &Situation<'_>, set: &[ObstacleId]) -> SimTime {
        let planned = |id: &ObstacleId| s.ledger.sets().iter().any(|p| p.ids.contains(id));
        let new = set.iter().filter(|id| !planned(id)).filter_map(|&id| s.obstacles.get(id));
        new.map(|known| known.since).max().unwrap_or(SimTime::ZERO)
    }

    /// Divides the members over the routes past a set. Those who fly it already, or are past its gate, keep their way.
    fn avoid(&self, s: &Situation<'_>, set: &[ObstacleId]) -> Option<Orders> {
        let routes = Routes::new(&s.obstacles.shapes(set)?, &self.params.routes);
        let before = s.ledger.sets().iter().find(|p| p.ids == *set);
        let flight = Flight { speed_mps: self.params.speed_mps, course_y_m: self.params.course_y_m };
        let arrivals: Vec<Vec<f64>> = s
            .members
            .iter()
            .map(|m| {
                let earlier = earlier_legs(s.ledger, m, &routes);
                (0..routes.count()).map(|r| arrival_s(&earlier, &routes, r, m.position, &flight)).collect()
            })
            .collect();
        let kept: Vec<Option<&Assignment>> =
            s.members.iter().map(|m| before.and_then(|p| p.parts.get(&m.id))).collect();
        let chosen = self.choose(s.members, &routes, &arrivals, &kept)?;
        let ranks = ranks(&chosen, &arrivals, &kept);
        let groups = groups(s, &chosen, &kept, &overlapping(s.ledger, set));
        let predicted_s = self.table(&arrivals, routes.count())?.assigned(&chosen).ok()?.makespan_s;
        let plan = Plan {
            predicted_s,
            routes: routes.count() as u32,
            ..self.plan(s, PHASE_AVOID, set, Vec2::new(f64::INFINITY, 0.0))
        };
        let part = |(i, m): (usize, &Member)| {
            let mine = s.ledger.obeyed().and_then(|orders| orders.parts.get(&m.id));
            let assignment = Assignment {
                id: plan.id,
                group: groups[i],
                drone: m.id,
                leader: front(s.members, &groups, groups[i]),
                slot_m: mine.map_or([0.0; 2], |part| part.slot_m),
                arrival_s: arrivals[i][chosen[i]],
                route: chosen[i] as u16,
                rank: ranks[i],
                reserved: 0,
            };
            (m.id, assignment)
        };
        Some(Orders { plan, parts: s.members.iter().enumerate().map(part).collect() })
    }

    fn choose(
        &self,
        members: &[Member],
        routes: &Routes,
        arrivals: &[Vec<f64>],
        kept: &[Option<&Assignment>],
    ) -> Option<Vec<usize>> {
        let settled = |i: usize| match kept[i] {
            Some(part) if usize::from(part.route) < routes.count() => Some(usize::from(part.route)),
            _ if members[i].position.x >= routes.gate_x_m() => Some(nearest(&arrivals[i])),
            // Whoever joins a queue that is already flying takes its own shortest way.
            _ if kept.iter().any(Option::is_some) => Some(nearest(&arrivals[i])),
            _ => None,
        };
        let free: Vec<usize> = (0..members.len()).filter(|&i| settled(i).is_none()).collect();
        let rows: Vec<Vec<f64>> = free.iter().map(|&i| arrivals[i].clone()).collect();
        let table = self.table(&rows, routes.count())?;
        let split = match self.params.strategy {
            Strategy::CongestionAware => table.split(),
            Strategy::Fixed { left, right } if routes.count() == 2 && left + right == free.len() => {
                table.fixed(&[right, left]).ok()?
            }
            Strategy::ShortestPath | Strategy::Fixed { .. } => table.shortest(),
        };
        let mut chosen: Vec<usize> = (0..members.len()).map(|i| settled(i).unwrap_or(0)).collect();
        free.iter().zip(split.routes).for_each(|(&i, route)| chosen[i] = route);
        Some(chosen)
    }

    /// `None` only for arrivals that are no numbers, which finite positions do not have.
    fn table(&self, arrivals: &[Vec<f64>], routes: usize) -> Option<Table> {
        Table::new(arrivals, &vec![self.params.headway_s; routes]).ok()
    }

    /// Orders to fly in formation: once all are past everything, and whenever the members change.
    fn formation(&mut self, s: &Situation<'_>) -> Option<Orders> {
        let obeyed = s.ledger.obeyed().filter(|orders| orders.plan.id.ballot == s.ballot);
        let passed = !s.ledger.sets().is_empty();
        let same = obeyed.is_some_and(|orders| orders.parts.keys().eq(s.members.iter().map(|m| &m.id)));
        if !passed && same {
            self.changed = None;
            return None;
        }
        let changed = *self.changed.get_or_insert(s.now);
        if !passed && obeyed.is_some() && s.now.since(changed) < self.params.debounce_s {
            return None;
        }
        self.changed = None;
        let avoided = s.ledger.obeyed().is_some_and(|orders| orders.plan.phase != PHASE_CRUISE);
        self.slots(s, if passed || avoided { PHASE_REFORM } else { PHASE_CRUISE })
    }

    fn slots(&self, s: &Situation<'_>, phase: u32) -> Option<Orders> {
        let shape = self.params.shape.slots(s.members.len(), self.params.spacing_m);
        let anchor = self.anchor(s, &shape, phase);
        let places: Vec<Vec2> = shape.iter().map(|slot| slot + anchor).collect();
        let positions: Vec<Vec2> = s.members.iter().map(|m| m.position).collect();
        let taken = slots::assign(&positions, &places).ok()?;
        let plan = self.plan(s, phase, &[], anchor);
        let group = |id| s.ledger.obeyed().and_then(|o| o.parts.get(&id)).map_or(GroupId::ALL, |part| part.group);
        let groups: Vec<GroupId> = s.members.iter().map(|m| group(m.id)).collect();
        let part = |(i, m): (usize, &Member)| {
            let assignment = Assignment {
                id: plan.id,
                group: groups[i],
                drone: m.id,
                leader: front(s.members, &groups, groups[i]),
                slot_m: shape[taken[i]].into(),
                arrival_s: 0.0,
                route: NO_ROUTE,
                rank: 0,
                reserved: 0,
            };
            (m.id, assignment)
        };
        Some(Orders { plan, parts: s.members.iter().enumerate().map(part).collect() })
    }

    /// Where the front slot goes: the goal, or where the members are on average, clear of the dead.
    fn anchor(&self, s: &Situation<'_>, shape: &[Vec2], phase: u32) -> Vec2 {
        if let (Destination::Goal { front_m }, PHASE_REFORM) = (self.params.destination, phase) {
            return front_m;
        }
        let count = s.members.len().max(1) as f64;
        let mean = |points: &mut dyn Iterator<Item = f64>| points.sum::<f64>() / count;
        let x = mean(&mut s.members.iter().map(|m| m.position.x)) - mean(&mut shape.iter().map(|slot| slot.x));
        let mut anchor = Vec2::new(x, self.params.course_y_m);
        let keep_m = 1.05 * self.params.safe_distance_m;
        let blocked =
            |anchor: Vec2| s.silent.iter().any(|dead| shape.iter().any(|slot| (slot + anchor - dead).norm() < keep_m));
        while phase == PHASE_REFORM && blocked(anchor) {
            anchor.x += ANCHOR_STEP_M;
        }
        anchor
    }

    /// The plan's common part. An anchor that is already where it stops does not move.
    fn plan(&self, s: &Situation<'_>, phase: u32, set: &[ObstacleId], anchor: Vec2) -> Plan {
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
            group: GroupId::ALL,
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

fn nearest(arrivals: &[f64]) -> usize {
    let least = |a: &usize, b: &usize| arrivals[*a].total_cmp(&arrivals[*b]).then(a.cmp(b));
    (0..arrivals.len()).min_by(least).unwrap_or(0)
}

fn is_past(obstacles: &Obstacles, set: &[ObstacleId], exit_x_m: f64, member: &Member) -> bool {
    member.position.x >= exit_x_m || set.iter().all(|&id| obstacles.has_passed(member.id, id))
}

/// The sets before `routes` that a member has still to leave, with its route past each.
fn earlier_legs<'a>(ledger: &'a Ledger, member: &Member, routes: &Routes) -> Vec<(&'a Routes, usize)> {
    let leg = |p: &'a PlannedSet| {
        let route = usize::from(p.parts.get(&member.id)?.route);
        let ahead = p.routes.gate_x_m() < routes.gate_x_m() && member.position.x < p.routes.exit_x_m();
        (ahead && route < p.routes.count()).then_some((&p.routes, route))
    };
    ledger.sets().iter().filter_map(leg).collect()
}

/// Planned sets that share an obstacle with `set`: the parts that a new plan for it replaces.
fn overlapping<'a>(ledger: &'a Ledger, set: &[ObstacleId]) -> Vec<&'a PlannedSet> {
    ledger.sets().iter().filter(|p| p.ids.iter().any(|id| set.contains(id))).collect()
}

/// Place of each member in the queue of its route: those with a place keep their order, the others follow by arrival.
fn ranks(chosen: &[usize], arrivals: &[Vec<f64>], kept: &[Option<&Assignment>]) -> Vec<u16> {
    let mut order: Vec<usize> = (0..chosen.len()).collect();
    let place = |i: usize| kept[i].map_or(u16::MAX, |part| part.rank);
    let arrival = |i: usize| arrivals[i][chosen[i]];
    order.sort_by(|&a, &b| place(a).cmp(&place(b)).then(arrival(a).total_cmp(&arrival(b))).then(a.cmp(&b)));
    let mut next: BTreeMap<usize, u16> = BTreeMap::new();
    let mut ranks = vec![0; chosen.len()];
    for i in order {
        let rank = next.entry(chosen[i]).or_default();
        ranks[i] = *rank;
        *rank = rank.saturating_add(1);
    }
    ranks
}

/// The group of each member: what it was split from, and which of the routes that its kin take, counted from the left.
fn groups(s: &Situation<'_>, chosen: &[usize], kept: &[Option<&Assignment>], replaced: &[&PlannedSet]) -> Vec<GroupId> {
    let current = |id| s.ledger.obeyed().and_then(|o| o.parts.get(&id)).map_or(GroupId::ALL, |part| part.group);
    let parent = |m: &Member| match replaced.iter().find_map(|p| p.parts.get(&m.id)) {
        Some(part) => part.group.parent(),
        None => current(m.id),
    };
    let parents: Vec<GroupId> = s.members.iter().map(parent).collect();
    let child = |i: usize| {
        let mut taken: Vec<usize> =
            (0..chosen.len()).filter(|&j| parents[j] == parents[i]).map(|j| chosen[j]).collect();
        taken.sort_unstable_by(|a, b| b.cmp(a));
        taken.dedup();
        let number = taken.iter().position(|&route| route == chosen[i]).unwrap_or(0) + 1;
        parents[i].child(u8::try_from(number).unwrap_or(u8::MAX))
    };
    (0..chosen.len()).map(|i| kept[i].map_or_else(|| child(i), |part| part.group)).collect()
}

/// Who leads a group: its member closest to the destination; ties: the lower id.
fn front(members: &[Member], groups: &[GroupId], group: GroupId) -> DroneId {
    let of_group = members.iter().zip(groups).filter(|(_, g)| **g == group).map(|(m, _)| m);
    let first = of_group.reduce(|best, m| if m.position.x > best.position.x { m } else { best });
    first.map_or(DroneId::NONE, |m| m.id)
}
