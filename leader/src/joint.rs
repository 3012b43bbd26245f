//! Several groups before one obstacle set. Their leaders split one table, so that their queues are one. To rehearse takes
//! one mind: the leader of the oldest term thinks for all. The others fly on and wait for what it chose; if they do not hear
//! of it, they stay on the ways they fly.

use crate::avoid::{Grouping, Survey, ranks};
use crate::candidates::candidates;
use crate::params::Strategy;
use crate::plan_bundle::PlanBundle;
use crate::plan_exchange::{self, arrivals_s};
use crate::planner::Planner;
use crate::situation::Situation;
use crate::split::RouteAssignment;
use skein_protocol::payload::{Arrivals, Assignment, set_tag};
use skein_protocol::{ArrivalsKind, Ballot, DroneId, ObstacleId, SimTime};
use std::collections::BTreeMap;

/// While one thinks, all fly their shortest ways, or the rule's if those save this share of the last drone's time: groups
/// meet before the same set when they are near it, and then a second on the wrong way cannot be made up for.
const WORTH_UNREHEARSED: f64 = 0.2;
/// What another leader chose is waited for so long, s; the air's delay comes on top, both ways. It thinks for a second.
const PATIENCE_S: f64 = 2.0;

/// What is waited for: a choice among the groupings of one table.
#[derive(Clone, Debug)]
pub(crate) struct Joint {
    set: Vec<ObstacleId>,
    ballot: Ballot,
    since: SimTime,
    /// Who thinks.
    thinker: DroneId,
    table: Vec<Arrivals>,
    /// The parts of members from before, and whether the set was planned for.
    kept: BTreeMap<DroneId, Assignment>,
    replan: bool,
}

impl Planner {
    /// The groupings of all drones in `table`, or what of them this leader needs to know: what it is to fly until the one
    /// who thinks for all has chosen. Every leader that knows the same rows comes to the same.
    pub(crate) fn together(
        &mut self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        table: Vec<Arrivals>,
        survey: &Survey<'_>,
    ) -> Option<Vec<PlanBundle>> {
        let arrivals: Vec<Vec<f64>> = table.iter().map(arrivals_s).collect();
        let union = self.table(&arrivals, survey.routes.count())?;
        let thinker = thinker(&table)?;
        let start_s = table.iter().map(|row| row.stamp.since(SimTime::ZERO)).fold(f64::INFINITY, f64::min);
        let (shortest, rule) = (union.shortest(), union.split());
        let saves = rule.makespan_s - start_s <= (1.0 - WORTH_UNREHEARSED) * (shortest.makespan_s - start_s);
        let splits = match self.params.strategy {
            Strategy::ShortestPath => vec![shortest],
            Strategy::LookAhead(_) if thinker == s.ballot.claimant => {
                let all = || s.members.iter().chain(s.others);
                let lateral_m = |row: &Arrivals| all().find(|m| m.id == row.drone).map_or(0.0, |m| m.position.y);
                candidates(&union, &table.iter().map(lateral_m).collect::<Vec<_>>(), survey.routes.count())
            }
            Strategy::LookAhead(_) if !saves => vec![shortest],
            Strategy::LookAhead(_) | Strategy::PaperRule | Strategy::Fixed { .. } => vec![rule],
        };
        let rehearsed = matches!(self.params.strategy, Strategy::LookAhead(_));
        let replan = s.ledger.sets().iter().any(|p| p.ids.iter().any(|id| set.contains(id)));
        let bundle = |split: &RouteAssignment| {
            let grouping = joint_grouping(s, &table, survey, split);
            let mut bundle = self.bundle(s, set, survey, &grouping, replan);
            if rehearsed && thinker == s.ballot.claimant {
                add_others(&mut bundle, s, &table, survey, split);
            } else if rehearsed {
                bundle.unsplit(s.members, s.scope);
            }
            bundle
        };
        let all: Vec<PlanBundle> = splits.iter().map(bundle).collect();
        self.meanwhile = usize::from(saves && all.len() > 1);
        let kept = s.members.iter().zip(&survey.kept).filter_map(|(m, part)| Some((m.id, *(*part)?))).collect();
        let waits = rehearsed && thinker != s.ballot.claimant;
        let joint = Joint { set: set.to_vec(), ballot: s.ballot, since: s.now, thinker, table, kept, replan };
        self.joint = waits.then_some(joint);
        Some(all)
    }

    /// What the one who thinks for all chose for the members, once all of it was heard.
    pub(crate) fn chosen(&mut self, s: &Situation<'_>) -> Option<PlanBundle> {
        let joint = self.joint.take()?;
        if joint.ballot != s.ballot || s.now.since(joint.since) > PATIENCE_S + 2.0 * s.delay_s {
            return None;
        }
        // Who has but one way left needs no choice, and who thinks may not have asked about it.
        let choice = |row: &Arrivals| {
            let heard = self.plan_exchange.chosen(row.drone, set_tag(&joint.set), joint.thinker, joint.since);
            heard.or_else(|| only_route(row))
        };
        let Some(routes) = joint.table.iter().map(choice).collect::<Option<Vec<usize>>>() else {
            self.joint = Some(joint);
            return None;
        };
        let mut survey = self.survey(s, &joint.set)?;
        survey.kept = s.members.iter().map(|m| joint.kept.get(&m.id)).collect();
        let arrivals: Vec<Vec<f64>> = joint.table.iter().map(arrivals_s).collect();
        let split = self.table(&arrivals, survey.routes.count())?.assigned(&routes).ok()?;
        let grouping = joint_grouping(s, &joint.table, &survey, &split);
        Some(self.bundle(s, &joint.set, &survey, &grouping, joint.replan))
    }

    /// Keeps of orders what is about the members; the others' leaders are told what was chosen for all.
    pub(crate) fn tell_chosen(&mut self, now: SimTime, bundle: &mut PlanBundle, own: impl Fn(DroneId) -> bool) {
        if bundle.parts.iter().all(|part| own(part.drone)) {
            return;
        }
        let (plan, set) = (bundle.plan, crate::obstacles::set_ids(&bundle.plan.set, bundle.plan.set_count));
        let row = |part: &Assignment| {
            let mut gate_s = vec![f64::INFINITY; plan.routes as usize];
            gate_s.iter_mut().skip(usize::from(part.route)).take(1).for_each(|s| *s = part.arrival_s);
            let row = plan_exchange::row(now, plan.id.ballot, plan.group, part.drone, set_tag(set), &gate_s);
            Arrivals { kind: ArrivalsKind::Decision.to_wire(), ..row }
        };
        self.plan_exchange.announce(now, bundle.parts.iter().map(row).collect());
        bundle.parts.retain(own);
    }
}

/// The leader who thinks for all: that of the oldest term. Two leaders may both count a drone as theirs, and each knows
/// its own row of it; the terms in the table are the same for all.
fn thinker(table: &[Arrivals]) -> Option<DroneId> {
    table.iter().map(|row| row.ballot).min().map(|ballot| ballot.claimant)
}

/// The route of a drone that has no choice.
fn only_route(row: &Arrivals) -> Option<usize> {
    let finite = row.gate_s.iter().take(row.routes as usize).enumerate().filter(|(_, s)| s.is_finite());
    let mut open = finite.map(|(route, _)| route);
    open.next().filter(|_| open.next().is_none())
}

/// Of a split of the table the part that is about the members.
fn joint_grouping(s: &Situation<'_>, table: &[Arrivals], survey: &Survey<'_>, split: &RouteAssignment) -> Grouping {
    let places = places(s, table, survey, split);
    let (mut chosen, mut ranks) = (vec![0; s.members.len()], vec![0; s.members.len()]);
    for (row, (route, rank)) in table.iter().zip(split.routes.iter().zip(places)) {
        if let Ok(i) = s.members.binary_search_by_key(&row.drone, |m| m.id) {
            (chosen[i], ranks[i]) = (*route, rank);
        }
    }
    Grouping { chosen, ranks, predicted_s: split.makespan_s - s.now.since(SimTime::ZERO) }
}

/// The place in its queue of each drone in the table.
fn places(s: &Situation<'_>, table: &[Arrivals], survey: &Survey<'_>, split: &RouteAssignment) -> Vec<u16> {
    let arrivals: Vec<Vec<f64>> = table.iter().map(arrivals_s).collect();
    let own = |drone: DroneId| s.members.binary_search_by_key(&drone, |m| m.id).ok();
    let kept: Vec<Option<u16>> =
        table.iter().map(|row| own(row.drone).and_then(|i| survey.kept[i]).map(|part| part.rank)).collect();
    ranks(&split.routes, &arrivals, &kept)
}

/// The parts of other groups' drones, for a rehearsal and for their leaders.
fn add_others(
    bundle: &mut PlanBundle,
    s: &Situation<'_>,
    table: &[Arrivals],
    survey: &Survey<'_>,
    split: &RouteAssignment,
) {
    let (plan, now_s) = (bundle.plan, s.now.since(SimTime::ZERO));
    for (row, (&route, rank)) in table.iter().zip(split.routes.iter().zip(places(s, table, survey, split))) {
        bundle.parts.add(Assignment {
            id: plan.id,
            scope: s.scope,
            group: row.group,
            drone: row.drone,
            leader: DroneId::NONE,
            slot_m: [0.0; 2],
            arrival_s: arrivals_s(row)[route] - now_s,
            route: route as u16,
            rank,
            reserved: 0,
        });
    }
}
