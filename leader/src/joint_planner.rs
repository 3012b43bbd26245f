//! Several groups before one obstacle set. Their leaders exchange arrivals and split one common table, so that drones of
//! different groups share a route as one queue.
//!
//! Only one leader simulates: the holder of the oldest term is the coordinator and plans for all groups. The other
//! leaders fly on and wait for its choice. A leader that does not hear the choice keeps its members on their routes.

use crate::candidates::{candidates, shortest_and_rule};
use crate::grouping::{Grouping, arrival_table, ranks};
use crate::obstacles::set_ids;
use crate::params::{LeadingParams, Strategy};
use crate::plan_bundle::PlanBundle;
use crate::plan_exchange::{self, PlanExchange, arrivals_s};
use crate::set_place::SetPlace;
use crate::situation::Situation;
use crate::split::{ArrivalTable, RouteAssignment};
use crate::survey::Survey;
use crate::tuning::{CHOICE_TIMEOUT_S, INTERIM_RULE_SAVING};
use skein_protocol::payload::{Arrivals, Assignment, set_tag};
use skein_protocol::{ArrivalsKind, Ballot, DroneId, ObstacleId, SimTime};
use std::collections::BTreeMap;

/// Plans to choose among.
pub(crate) struct Alternatives {
    /// The plans, in the order of [`candidates`].
    pub(crate) bundles: Vec<PlanBundle>,
    /// Index of the plan to fly until the choice is made.
    pub(crate) interim: usize,
}

/// The joint planning of one leader: its exchange with other leaders, and the choice it waits for.
#[derive(Clone, Debug)]
pub(crate) struct JointPlanner {
    exchange: PlanExchange,
    awaited: Option<AwaitedChoice>,
}

/// A choice of the coordinator among the groupings of one table.
#[derive(Clone, Debug)]
struct AwaitedChoice {
    set: Vec<ObstacleId>,
    ballot: Ballot,
    since: SimTime,
    coordinator: DroneId,
    table: Vec<Arrivals>,
    /// The assignments that members had for the set when the wait began.
    kept: BTreeMap<DroneId, SetPlace>,
    /// Whether the set was planned for before.
    replan: bool,
}

impl JointPlanner {
    /// Nothing heard.
    pub(crate) fn new(params: &LeadingParams) -> Self {
        let row_s = params.leader_frame_s(size_of::<Arrivals>());
        Self { exchange: PlanExchange::new(params.drones, params.repeat_period_s, row_s), awaited: None }
    }

    /// Hears when a drone of another group can be where.
    pub(crate) fn hear(&mut self, now: SimTime, row: &Arrivals) {
        self.exchange.hear(now, row);
    }

    /// Answers the question of another leader about a set that is planned for already, and repeats a choice of this
    /// leader's own. Call once per decision.
    pub(crate) fn answer_others(&mut self, s: &Situation<'_>, say: &mut Vec<Arrivals>) {
        let asked = self.exchange.asked(s.now);
        if let Some(planned) = asked.and_then(|tag| s.ledger.sets().iter().find(|p| p.tag == tag))
            && let Some(survey) = Survey::new(s, &planned.ids)
        {
            let rows = survey.rows(s, planned.tag);
            self.exchange.note_said(s.now, rows.len());
            say.extend(rows);
        }
        self.exchange.repeat(s.now, say);
    }

    /// Whether [`Self::decide`] would only wait for the arrivals of these drones of other groups. A survey of many obstacles takes long, and a
    /// slow radio lets a leader wait for many ticks.
    pub(crate) fn waits(&self, s: &Situation<'_>, set: &[ObstacleId], others: &[DroneId]) -> bool {
        self.exchange.waits(s.now, (set_tag(set), s.ballot), s.members.iter().map(|m| m.id), others, s.delay_s)
    }

    /// Plans past a set that drones of other groups, `others`, have ahead too. `None` until their arrivals are known, or
    /// the wait for them is over.
    pub(crate) fn decide(
        &mut self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        others: &[DroneId],
        survey: &Survey<'_>,
        say: &mut Vec<Arrivals>,
    ) -> Option<Alternatives> {
        let tag = set_tag(set);
        let members = s.members.iter().map(|m| m.id);
        self.exchange.ask(s.now, (tag, s.ballot), members, || survey.rows(s, tag), say);
        let table = self.exchange.answer(s.now, others, survey.routes().count(), s.delay_s)?;
        self.exchange.close(s.now, say);
        self.split_jointly(s, set, table, survey)
    }

    /// The groupings of all drones in `table`, as far as this leader needs them: all candidates for the coordinator, the
    /// interim plan for the others. Leaders that know the same rows come to the same result.
    fn split_jointly(
        &mut self,
        s: &Situation<'_>,
        set: &[ObstacleId],
        table: Vec<Arrivals>,
        survey: &Survey<'_>,
    ) -> Option<Alternatives> {
        let arrivals: Vec<Vec<f64>> = table.iter().map(arrivals_s).collect();
        let union = arrival_table(s, &arrivals, survey.routes())?;
        let coordinator = coordinator(&table)?;
        let coordinates = coordinator == s.ballot.claimant;
        let looks_ahead = matches!(s.params.strategy, Strategy::LookAhead(_));
        let (splits, saves) = splits(s, survey, &table, &union, coordinates);
        let replan = s.was_planned(set);
        let bundle = |split: &RouteAssignment| {
            let mut bundle = own_grouping(s, &table, survey, split).bundle(s, set, survey, replan);
            if looks_ahead && coordinates {
                add_others(&mut bundle, s, &table, survey, split);
            } else if looks_ahead {
                bundle.unsplit(s.members, s.scope);
            }
            bundle
        };
        let bundles: Vec<PlanBundle> = splits.iter().map(bundle).collect();
        let interim = usize::from(saves && bundles.len() > 1);
        let kept = s.members.iter().zip(survey.kept()).filter_map(|(m, part)| Some((m.id, *(*part)?))).collect();
        let (set, ballot, since) = (set.to_vec(), s.ballot, s.now);
        let awaited = AwaitedChoice { set, ballot, since, coordinator, table, kept, replan };
        self.awaited = (looks_ahead && !coordinates).then_some(awaited);
        Some(Alternatives { bundles, interim })
    }

    /// The plan that the coordinator chose for the members, once its choice was heard for all drones of the table.
    pub(crate) fn chosen(&mut self, s: &Situation<'_>) -> Option<PlanBundle> {
        let awaited = self.awaited.take()?;
        if awaited.ballot != s.ballot || s.now.since(awaited.since) > CHOICE_TIMEOUT_S + 2.0 * s.delay_s {
            return None;
        }
        let Some(routes) = self.chosen_routes(&awaited) else {
            self.awaited = Some(awaited);
            return None;
        };
        let survey = Survey::with_kept(s, &awaited.set, &awaited.kept)?;
        let arrivals: Vec<Vec<f64>> = awaited.table.iter().map(arrivals_s).collect();
        let union = arrival_table(s, &arrivals, survey.routes())?;
        let grouping = own_grouping(s, &awaited.table, &survey, &union.assigned(&routes).ok()?);
        Some(grouping.bundle(s, &awaited.set, &survey, awaited.replan))
    }

    /// The chosen route of each drone in the table; `None` while one is missing. A drone with only one route left needs no
    /// choice, and the coordinator may not have asked about it.
    fn chosen_routes(&self, awaited: &AwaitedChoice) -> Option<Vec<usize>> {
        let tag = set_tag(&awaited.set);
        let choice = |row: &Arrivals| {
            let heard = self.exchange.chosen(row.drone, tag, awaited.coordinator, awaited.since);
            heard.or_else(|| only_route(row))
        };
        awaited.table.iter().map(choice).collect()
    }

    /// Announces the routes of a bundle to the leaders of other groups, if it assigns their drones too. Then reduces the
    /// bundle to this leader's own members.
    pub(crate) fn announce_choice(&mut self, now: SimTime, bundle: &mut PlanBundle, own: impl Fn(DroneId) -> bool) {
        if bundle.parts.iter().all(|part| own(part.drone)) {
            return;
        }
        let (plan, set) = (bundle.plan, set_ids(&bundle.plan.set, bundle.plan.set_count));
        let row = |part: Assignment| {
            let mut gate_s = vec![f64::INFINITY; plan.routes as usize];
            if let Some(arrival_s) = gate_s.get_mut(usize::from(part.route)) {
                *arrival_s = part.arrival_s;
            }
            let row = plan_exchange::row(now, plan.id.ballot, plan.group, part.drone, set_tag(set), &gate_s);
            Arrivals { kind: ArrivalsKind::Decision.to_wire(), ..row }
        };
        self.exchange.announce(now, bundle.parts.iter().map(row).collect());
        bundle.parts.retain(own);
    }
}

/// The splits of the common table that this leader needs, and whether the paper's rule saves enough time to be flown
/// until the choice is made.
fn splits(
    s: &Situation<'_>,
    survey: &Survey<'_>,
    table: &[Arrivals],
    union: &ArrivalTable,
    coordinates: bool,
) -> (Vec<RouteAssignment>, bool) {
    let start_s = table.iter().map(|row| row.stamp.since(SimTime::ZERO)).fold(f64::INFINITY, f64::min);
    let (shortest, rule) = (union.shortest(), union.split());
    let saves = rule.makespan_s - start_s <= (1.0 - INTERIM_RULE_SAVING) * (shortest.makespan_s - start_s);
    let splits = match s.params.strategy {
        Strategy::ShortestPath => vec![shortest],
        Strategy::LookAhead(_) if coordinates && !s.is_within_rollout() => shortest_and_rule(union),
        Strategy::LookAhead(_) if coordinates => {
            let all = || s.members.iter().chain(s.others);
            let lateral_m = |row: &Arrivals| all().find(|m| m.id == row.drone).map_or(0.0, |m| m.position.y);
            candidates(union, &table.iter().map(lateral_m).collect::<Vec<_>>(), survey.routes().count())
        }
        Strategy::LookAhead(_) if !saves => vec![shortest],
        Strategy::LookAhead(_) | Strategy::PaperRule | Strategy::Fixed { .. } => vec![rule],
    };
    (splits, saves)
}

/// The coordinator: the leader of the oldest term in the table. Two leaders may both count a drone as theirs, and each
/// knows only its own row of it. The terms in the table are the same for all.
fn coordinator(table: &[Arrivals]) -> Option<DroneId> {
    table.iter().map(|row| row.ballot).min().map(|ballot| ballot.claimant)
}

/// The route of a drone that has no choice.
fn only_route(row: &Arrivals) -> Option<usize> {
    let finite = row.gate_s.iter().take(row.routes as usize).enumerate().filter(|(_, s)| s.is_finite());
    let mut open = finite.map(|(route, _)| route);
    open.next().filter(|_| open.next().is_none())
}

/// The part of a split of the common table that is about the members. Members without a row came to the group after the table was made: they
/// are last on their shortest routes.
fn own_grouping(s: &Situation<'_>, table: &[Arrivals], survey: &Survey<'_>, split: &RouteAssignment) -> Grouping {
    let places = places(s, table, survey, split);
    let own_route = |i: usize| survey.settled(s.members, i).unwrap_or_else(|| survey.shortest(i));
    let mut chosen: Vec<usize> = (0..s.members.len()).map(own_route).collect();
    let mut ranks = survey.kept_ranks();
    for (row, (route, rank)) in table.iter().zip(split.routes.iter().zip(places)) {
        if let Ok(i) = s.members.binary_search_by_key(&row.drone, |m| m.id) {
            (chosen[i], ranks[i]) = (*route, Some(rank));
        }
    }
    let mut next: BTreeMap<usize, u16> = BTreeMap::new();
    for &route in &split.routes {
        *next.entry(route).or_default() += 1;
    }
    let mut last = |route: usize| {
        let next = next.entry(route).or_default();
        *next += 1;
        *next - 1
    };
    let ranks = chosen.iter().zip(ranks).map(|(&route, rank)| rank.unwrap_or_else(|| last(route))).collect();
    let now_s = s.now.since(SimTime::ZERO);
    Grouping { chosen, ranks, predicted_s: split.makespan_s - now_s }
}

/// The place in its queue of each drone in the table.
fn places(s: &Situation<'_>, table: &[Arrivals], survey: &Survey<'_>, split: &RouteAssignment) -> Vec<u16> {
    let arrivals: Vec<Vec<f64>> = table.iter().map(arrivals_s).collect();
    let own = |drone: DroneId| s.members.binary_search_by_key(&drone, |m| m.id).ok();
    let kept: Vec<Option<u16>> =
        table.iter().map(|row| own(row.drone).and_then(|i| survey.kept()[i]).map(|part| part.rank)).collect();
    ranks(&split.routes, &arrivals, &kept)
}

/// Adds the assignments of other groups' drones, for the rollout and for their leaders.
fn add_others(
    bundle: &mut PlanBundle,
    s: &Situation<'_>,
    table: &[Arrivals],
    survey: &Survey<'_>,
    split: &RouteAssignment,
) {
    let (plan, now_s) = (bundle.plan, s.now.since(SimTime::ZERO));
    for (row, (&route, rank)) in table.iter().zip(split.routes.iter().zip(places(s, table, survey, split))) {
        bundle.parts.add(&Assignment {
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
