//! Who flies which way past an obstacle set (paper, Algorithm 3).

use crate::candidates::candidates;
use crate::cost::{Flight, Trip, shortest, trips};
use crate::ledger::{Ledger, Orders, PlannedSet};
use crate::planner::{Member, Planner, Situation, Strategy, front};
use crate::routes::Routes;
use crate::split::{Split, Table};
use skein_protocol::payload::{Assignment, PHASE_AVOID, Plan};
use skein_protocol::{GroupId, ObstacleId, Vec2};
use std::collections::BTreeMap;

impl Planner {
    /// Divides the members over the routes past a set. Those who fly it already, or are past its gate, keep their way.
    /// One grouping, or the few that are worth a rehearsal: the shortest ways first, the rule's second.
    pub(crate) fn avoid(&self, s: &Situation<'_>, set: &[ObstacleId]) -> Option<Vec<Orders>> {
        let routes = Routes::new(&s.obstacles.shapes(set)?, &self.params.routes);
        let before = s.ledger.sets().iter().find(|p| p.ids == *set);
        let flight = Flight { speed_mps: self.params.speed_mps, course_y_m: self.params.course_y_m };
        let ways = |m: &Member| trips(&earlier_legs(s.ledger, m, &routes), &routes, m.position, &flight);
        let ways: Vec<Vec<Trip>> = s.members.iter().map(ways).collect();
        let arrivals: Vec<Vec<f64>> = ways.iter().map(|row| row.iter().map(|way| way.arrival_s).collect()).collect();
        let kept: Vec<Option<&Assignment>> =
            s.members.iter().map(|m| before.and_then(|p| p.parts.get(&m.id))).collect();
        let groupings = self.choose(s.members, &routes, &ways, &kept)?;
        groupings.iter().map(|chosen| self.orders(s, set, &routes, &arrivals, &kept, chosen)).collect()
    }

    fn orders(
        &self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        routes: &Routes,
        arrivals: &[Vec<f64>],
        kept: &[Option<&Assignment>],
        chosen: &[usize],
    ) -> Option<Orders> {
        let ranks = ranks(chosen, arrivals, kept);
        let groups = groups(s, chosen, kept, &overlapping(s.ledger, set));
        let predicted_s = self.table(arrivals, routes.count())?.assigned(chosen).ok()?.makespan_s;
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

    /// The route of each member, in one or several groupings.
    fn choose(
        &self,
        members: &[Member],
        routes: &Routes,
        ways: &[Vec<Trip>],
        kept: &[Option<&Assignment>],
    ) -> Option<Vec<Vec<usize>>> {
        let settled = |i: usize| match kept[i] {
            Some(part) if usize::from(part.route) < routes.count() => Some(usize::from(part.route)),
            _ if members[i].position.x >= routes.gate_x_m() => Some(shortest(&ways[i])),
            // Whoever joins a queue that is already flying takes its own shortest way.
            _ if kept.iter().any(Option::is_some) => Some(shortest(&ways[i])),
            _ => None,
        };
        let free: Vec<usize> = (0..members.len()).filter(|&i| settled(i).is_none()).collect();
        let rows: Vec<Vec<f64>> = free.iter().map(|&i| ways[i].iter().map(|way| way.arrival_s).collect()).collect();
        let table = self.table(&rows, routes.count())?;
        let splits = match self.params.strategy {
            Strategy::Rehearsed(_) => {
                let lateral_m: Vec<f64> = free.iter().map(|&i| members[i].position.y).collect();
                candidates(&table, &lateral_m, routes.count())
            }
            Strategy::CongestionAware => vec![table.split()],
            Strategy::Fixed { left, right } if routes.count() == 2 && left + right == free.len() => {
                vec![table.fixed(&[right, left]).ok()?]
            }
            Strategy::ShortestPath | Strategy::Fixed { .. } => vec![table.shortest()],
        };
        let grouping = |split: Split| {
            let mut chosen: Vec<usize> = (0..members.len()).map(|i| settled(i).unwrap_or(0)).collect();
            free.iter().zip(split.routes).for_each(|(&i, route)| chosen[i] = route);
            chosen
        };
        Some(splits.into_iter().map(grouping).collect())
    }

    /// `None` only for arrivals that are no numbers, which finite positions do not have.
    fn table(&self, arrivals: &[Vec<f64>], routes: usize) -> Option<Table> {
        Table::new(arrivals, &vec![self.params.headway_s; routes]).ok()
    }
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
