//! A grouping of the members over the routes past an obstacle set, and the plan that it makes.

use crate::draft::draft;
use crate::member::{Member, group_leaders};
use crate::params::Between;
use crate::plan_bundle::PlanBundle;
use crate::routes::Routes;
use crate::set_place::SetPlace;
use crate::situation::Situation;
use crate::split::ArrivalTable;
use crate::survey::Survey;
use skein_protocol::payload::{Assignment, Plan};
use skein_protocol::{GroupId, ObstacleId, Phase, Vec2};
use std::collections::BTreeMap;

/// The route of each member and its place in the queue there. Lists are in the order of the members.
pub(crate) struct Grouping {
    /// Route of each member, 0 = rightmost.
    pub(crate) chosen: Vec<usize>,
    /// Place of each member in the queue of its route, 0 = first.
    pub(crate) ranks: Vec<u16>,
    /// When the last drone passes the gate, s from now.
    pub(crate) predicted_s: f64,
}

impl Grouping {
    /// The plan and the assignments of this grouping. `replan`: the set was planned for before.
    pub(crate) fn bundle(
        &self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        survey: &Survey<'_>,
        replan: bool,
    ) -> PlanBundle {
        let Self { chosen, ranks, predicted_s } = self;
        let groups = groups(s, chosen, survey.kept(), replan);
        let leaders = group_leaders(s.members, &groups, &s.params.destination);
        let plan = Plan {
            predicted_s: *predicted_s,
            routes: survey.routes().count() as u32,
            ..draft(s, Phase::Avoid, set, Vec2::new(f64::INFINITY, 0.0))
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
                arrival_s: survey.arrival_s(s, i, chosen[i]),
                route: chosen[i] as u16,
                rank: ranks[i],
                reserved: 0,
            }
        };
        PlanBundle { plan, parts: s.members.iter().enumerate().map(part).collect() }
    }
}

/// The table of these arrivals (s, by drone and route). `None` only if an arrival is not a number, which finite positions
/// exclude.
pub(crate) fn arrival_table(s: &Situation<'_>, arrivals: &[Vec<f64>], routes: &Routes) -> Option<ArrivalTable> {
    ArrivalTable::new(arrivals, &turns_s(s, routes)).ok()
}

/// The least time between two drones on each route, s.
fn turns_s(s: &Situation<'_>, routes: &Routes) -> Vec<f64> {
    (0..routes.count()).map(|route| s.params.turn_s(routes.is_between(route), s.delay_s)).collect()
}

/// Whether no drone has to wait for another one on any route. Then it makes no difference to a drone which routes others fly.
pub(crate) fn is_without_queues(s: &Situation<'_>, routes: &Routes) -> bool {
    turns_s(s, routes).iter().all(|turn_s| *turn_s <= 0.0)
}

/// Place of each drone in the queue of its route. Drones that have a place already keep their order; the others follow by
/// arrival.
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

/// The group of each member: a part of the group it is in, numbered from the left by the routes that the members of that
/// group take. A member of no part of the scope counts as one of the scope itself.
///
/// If the set was planned for before, or if groups go on between sets, a group that stays on one route is not split. A member that joins a queue that is
/// already flying joins the group in that queue: a group is split as a whole or not at all.
fn groups(s: &Situation<'_>, chosen: &[usize], kept: &[Option<&SetPlace>], replan: bool) -> Vec<GroupId> {
    let parents: Vec<GroupId> =
        s.members.iter().map(|m| if s.scope.contains(m.group) { m.group } else { s.scope }).collect();
    let keeps = |i: usize| kept[i].map(|part| part.group).filter(|group| s.scope.contains(*group));
    let child = |i: usize| {
        let mut taken: Vec<usize> =
            (0..chosen.len()).filter(|&j| parents[j] == parents[i]).map(|j| chosen[j]).collect();
        taken.sort_unstable_by(|a, b| b.cmp(a));
        taken.dedup();
        let goes_on = s.params.between == Between::GoOn && parents[i] != GroupId::ALL;
        if (replan || goes_on) && taken.len() == 1 {
            return parents[i];
        }
        let number = taken.iter().position(|&route| route == chosen[i]).unwrap_or(0) + 1;
        parents[i].child(u8::try_from(number).unwrap_or(u8::MAX))
    };
    let joins = |i: usize| {
        let flying = (0..chosen.len()).filter_map(|j| Some((chosen[j] != chosen[i], keeps(j)?)));
        let related = flying.filter(|(_, group)| parents[i].contains(*group));
        related.filter(|(elsewhere, group)| !elsewhere || *group == parents[i]).min().map(|(_, group)| group)
    };
    (0..chosen.len()).map(|i| keeps(i).or_else(|| joins(i)).unwrap_or_else(|| child(i))).collect()
}
