//! Who flies which way past an obstacle set (paper, Algorithm 3).

use crate::candidates::candidates;
use crate::cost::{Flight, Trip, shortest, trips};
use crate::ledger::Ledger;
use crate::member::{Member, group_leaders};
use crate::params::Strategy;
use crate::plan_bundle::PlanBundle;
use crate::plan_exchange;
use crate::planned_set::PlannedSet;
use crate::planner::Planner;
use crate::routes::Routes;
use crate::situation::Situation;
use crate::split::{ArrivalTable, RouteAssignment};
use skein_protocol::payload::{Arrivals, Assignment, Plan, set_tag};
use skein_protocol::{GroupId, ObstacleId, Phase, Vec2};
use std::collections::BTreeMap;

/// What a plan for a set is made of.
pub(crate) struct Survey<'a> {
    pub routes: Routes,
    /// The ways of each member, one a route.
    ways: Vec<Vec<Trip>>,
    /// The parts of members who have one already.
    pub kept: Vec<Option<&'a Assignment>>,
}

impl Survey<'_> {
    /// The route of a member that has no choice: who flies one already, or is past the gate, or joins a queue that is
    /// already flying.
    fn settled(&self, members: &[Member], i: usize) -> Option<usize> {
        match self.kept[i] {
            Some(part) if usize::from(part.route) < self.routes.count() => Some(usize::from(part.route)),
            _ if members[i].position.x >= self.routes.gate_x_m() => Some(shortest(&self.ways[i])),
            _ if self.kept.iter().any(Option::is_some) => Some(shortest(&self.ways[i])),
            _ => None,
        }
    }

    /// Arrivals of a member, s from now; with a settled route, that alone.
    fn arrivals_s(&self, members: &[Member], i: usize) -> Vec<f64> {
        let settled = self.settled(members, i);
        let open = |route: usize| settled.is_none_or(|settled| settled == route);
        self.ways[i]
            .iter()
            .enumerate()
            .map(|(route, way)| if open(route) { way.arrival_s } else { f64::INFINITY })
            .collect()
    }
}

/// A grouping of the members: the route of each and its place in the queue there, and when the last one passes.
pub(crate) struct Grouping {
    pub chosen: Vec<usize>,
    pub ranks: Vec<u16>,
    pub predicted_s: f64,
}

impl Planner {
    /// Divides the members over the routes past a set. Those who fly it already, or are past its gate, keep their way.
    /// One grouping, or the few that are worth a rehearsal, the shortest ways first, the rule's second; with other groups
    /// before the same set groupings of all of them, once their leaders have said what they know.
    pub(crate) fn avoid(
        &mut self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        say: &mut Vec<Arrivals>,
    ) -> Option<Vec<PlanBundle>> {
        let survey = self.survey(s, set)?;
        let others = self.others_before(s, set);
        self.meanwhile = 0;
        if others.is_empty() {
            let replan = s.ledger.sets().iter().any(|p| p.ids.iter().any(|id| set.contains(id)));
            let groupings = self.choose(s.members, &survey)?;
            return Some(groupings.iter().map(|grouping| self.bundle(s, set, &survey, grouping, replan)).collect());
        }
        let tag = set_tag(set);
        let rows = || (0..s.members.len()).map(|i| row(s, &survey, tag, i)).collect();
        self.plan_exchange.ask(s.now, tag, rows, say);
        let table = self.plan_exchange.answer(s.now, &others, survey.routes.count(), s.delay_s)?;
        self.plan_exchange.close(s.now, say);
        self.together(s, set, table, &survey)
    }

    pub(crate) fn survey<'a>(&self, s: &Situation<'a>, set: &[ObstacleId]) -> Option<Survey<'a>> {
        let routes = Routes::new(&s.obstacles.shapes(set)?, &self.params.routes);
        let before = s.ledger.sets().iter().find(|p| p.ids == *set);
        let flight = Flight { speed_mps: self.params.speed_mps, course_y_m: self.params.course_y_m };
        let ways = |m: &Member| trips(&earlier_legs(s.ledger, m, &routes), &routes, m.position, &flight);
        let ways: Vec<Vec<Trip>> = s.members.iter().map(ways).collect();
        let kept = s.members.iter().map(|m| before.and_then(|p| p.parts.get(m.id))).collect();
        Some(Survey { routes, ways, kept })
    }

    /// The rows of a set that is planned for: what its members do.
    pub(crate) fn standing(&self, s: &Situation<'_>, planned: &PlannedSet) -> Vec<Arrivals> {
        let Some(survey) = self.survey(s, &planned.ids) else { return Vec::new() };
        (0..s.members.len()).map(|i| row(s, &survey, planned.tag, i)).collect()
    }

    /// Orders for the members; `replan`: the set was planned for before.
    pub(crate) fn bundle(
        &self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        survey: &Survey<'_>,
        grouping: &Grouping,
        replan: bool,
    ) -> PlanBundle {
        let Grouping { chosen, ranks, predicted_s } = grouping;
        let groups = groups(s, chosen, &survey.kept, replan);
        let leaders = group_leaders(s.members, &groups, &self.params.destination);
        let plan = Plan {
            predicted_s: *predicted_s,
            routes: survey.routes.count() as u32,
            ..self.plan(s, Phase::Avoid, set, Vec2::new(f64::INFINITY, 0.0))
        };
        let part = |(i, m): (usize, &Member)| {
            let mine = s.ledger.obeyed().and_then(|bundle| bundle.parts.get(m.id));
            Assignment {
                id: plan.id,
                scope: s.scope,
                group: groups[i],
                drone: m.id,
                leader: leaders[i],
                slot_m: mine.map_or([0.0; 2], |part| part.slot_m),
                arrival_s: survey.ways[i][chosen[i]].arrival_s,
                route: chosen[i] as u16,
                rank: ranks[i],
                reserved: 0,
            }
        };
        PlanBundle { plan, parts: s.members.iter().enumerate().map(part).collect() }
    }

    /// One or several groupings of the members alone.
    fn choose(&self, members: &[Member], survey: &Survey<'_>) -> Option<Vec<Grouping>> {
        let (routes, ways) = (&survey.routes, &survey.ways);
        let settled = |i: usize| survey.settled(members, i);
        let arrivals: Vec<Vec<f64>> = ways.iter().map(|row| row.iter().map(|way| way.arrival_s).collect()).collect();
        let free: Vec<usize> = (0..members.len()).filter(|&i| settled(i).is_none()).collect();
        let rows: Vec<Vec<f64>> = free.iter().map(|&i| arrivals[i].clone()).collect();
        let table = self.table(&rows, routes.count())?;
        let splits = match self.params.strategy {
            Strategy::LookAhead(_) => {
                let lateral_m: Vec<f64> = free.iter().map(|&i| members[i].position.y).collect();
                candidates(&table, &lateral_m, routes.count())
            }
            Strategy::PaperRule => vec![table.split()],
            Strategy::Fixed { left, right } if routes.count() == 2 && left + right == free.len() => {
                vec![table.fixed(&[right, left]).ok()?]
            }
            Strategy::ShortestPath | Strategy::Fixed { .. } => vec![table.shortest()],
        };
        let all = self.table(&arrivals, routes.count())?;
        let grouping = |split: RouteAssignment| {
            let mut chosen: Vec<usize> = (0..members.len()).map(|i| settled(i).unwrap_or(0)).collect();
            free.iter().zip(split.routes).for_each(|(&i, route)| chosen[i] = route);
            let kept: Vec<Option<u16>> = survey.kept.iter().map(|part| part.map(|part| part.rank)).collect();
            let ranks = ranks(&chosen, &arrivals, &kept);
            Some(Grouping { predicted_s: all.assigned(&chosen).ok()?.makespan_s, chosen, ranks })
        };
        splits.into_iter().map(grouping).collect()
    }

    /// `None` only for arrivals that are no numbers, which finite positions do not have.
    pub(crate) fn table(&self, arrivals: &[Vec<f64>], routes: usize) -> Option<ArrivalTable> {
        ArrivalTable::new(arrivals, &vec![self.params.headway_s; routes]).ok()
    }
}

/// What other leaders are told of a member.
fn row(s: &Situation<'_>, survey: &Survey<'_>, tag: u32, i: usize) -> Arrivals {
    let arrivals_s = survey.arrivals_s(s.members, i);
    plan_exchange::row(s.now, s.ballot, s.scope, s.members[i].id, tag, &arrivals_s)
}

/// The sets before `routes` that a member has still to leave, with its route past each.
fn earlier_legs<'a>(ledger: &'a Ledger, member: &Member, routes: &Routes) -> Vec<(&'a Routes, usize)> {
    let leg = |p: &'a PlannedSet| {
        let route = usize::from(p.parts.get(member.id)?.route);
        let ahead = p.routes.gate_x_m() < routes.gate_x_m() && member.position.x < p.routes.exit_x_m();
        (ahead && route < p.routes.count()).then_some((&p.routes, route))
    };
    ledger.sets().iter().filter_map(leg).collect()
}

/// Place of each member in the queue of its route: those with a place keep their order, the others follow by arrival.
pub(crate) fn ranks(chosen: &[usize], arrivals: &[Vec<f64>], kept: &[Option<u16>]) -> Vec<u16> {
    let mut order: Vec<usize> = (0..chosen.len()).collect();
    let place = |i: usize| kept[i].unwrap_or(u16::MAX);
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

/// The group of each member: its own, split by which of the routes its kin take, counted from the left. Whoever is of no
/// part of the scope joins it. A plan that replaces another one splits nobody who stays on one route with all its kin,
/// and who joins a queue that is already flying joins the group there: a group is split as a whole, or not at all.
fn groups(s: &Situation<'_>, chosen: &[usize], kept: &[Option<&Assignment>], replan: bool) -> Vec<GroupId> {
    let parents: Vec<GroupId> =
        s.members.iter().map(|m| if s.scope.contains(m.group) { m.group } else { s.scope }).collect();
    let keeps = |i: usize| kept[i].map(|part| part.group).filter(|group| s.scope.contains(*group));
    let child = |i: usize| {
        let mut taken: Vec<usize> =
            (0..chosen.len()).filter(|&j| parents[j] == parents[i]).map(|j| chosen[j]).collect();
        taken.sort_unstable_by(|a, b| b.cmp(a));
        taken.dedup();
        if replan && taken.len() == 1 {
            return parents[i];
        }
        let number = taken.iter().position(|&route| route == chosen[i]).unwrap_or(0) + 1;
        parents[i].child(u8::try_from(number).unwrap_or(u8::MAX))
    };
    let joins = |i: usize| {
        let flying = (0..chosen.len()).filter_map(|j| Some((chosen[j] != chosen[i], keeps(j)?)));
        let kin = flying.filter(|(_, group)| parents[i].contains(*group));
        kin.filter(|(elsewhere, group)| !elsewhere || *group == parents[i]).min().map(|(_, group)| group)
    };
    (0..chosen.len()).map(|i| keeps(i).or_else(|| joins(i)).unwrap_or_else(|| child(i))).collect()
}
