//! Which drone flies which route past an obstacle set, if no other group has the set ahead, or if no drone has to wait for another one
//! (paper, Algorithm 3). Has no state: the groupings follow from the situation alone.

use crate::candidates::{candidates, shortest_and_rule};
use crate::grouping::{Grouping, arrival_table, ranks};
use crate::params::Strategy;
use crate::plan_bundle::PlanBundle;
use crate::situation::Situation;
use crate::split::{ArrivalTable, RouteAssignment};
use crate::survey::Survey;
use skein_protocol::ObstacleId;

/// One plan, or with [`Strategy::LookAhead`] several to choose among by rollouts: the shortest paths first, the paper's
/// rule second. Members that already fly a route past the set, or are past its gate, stay on it.
pub(crate) fn alternatives(s: &Situation<'_>, set: &[ObstacleId], survey: &Survey<'_>) -> Option<Vec<PlanBundle>> {
    let replan = s.was_planned(set);
    let groupings = groupings(s, survey)?;
    Some(groupings.iter().map(|grouping| grouping.bundle(s, set, survey, replan)).collect())
}

fn groupings(s: &Situation<'_>, survey: &Survey<'_>) -> Option<Vec<Grouping>> {
    let members = s.members;
    let settled = |i: usize| survey.settled(members, i);
    let arrivals = survey.arrivals_s();
    let free: Vec<usize> = (0..members.len()).filter(|&i| settled(i).is_none()).collect();
    let free_arrivals: Vec<Vec<f64>> = free.iter().map(|&i| arrivals[i].clone()).collect();
    let table = arrival_table(s, &free_arrivals, survey.routes())?;
    let splits = splits(s, survey, &free, &table)?;
    let all = arrival_table(s, &arrivals, survey.routes())?;
    let grouping = |split: RouteAssignment| {
        let mut chosen: Vec<usize> = (0..members.len()).map(|i| settled(i).unwrap_or(0)).collect();
        for (&i, route) in free.iter().zip(split.routes) {
            chosen[i] = route;
        }
        let ranks = ranks(&chosen, &arrivals, &survey.kept_ranks());
        let predicted_s = all.assigned(&chosen).ok()?.makespan_s;
        Some(Grouping { chosen, ranks, predicted_s })
    };
    splits.into_iter().map(grouping).collect()
}

/// The splits of the free members that the strategy gives; `table`: their arrivals.
fn splits(
    s: &Situation<'_>,
    survey: &Survey<'_>,
    free: &[usize],
    table: &ArrivalTable,
) -> Option<Vec<RouteAssignment>> {
    let routes = survey.routes().count();
    Some(match s.params.strategy {
        Strategy::LookAhead(_) if !s.is_within_rollout() => shortest_and_rule(table),
        Strategy::LookAhead(_) => {
            let lateral_m: Vec<f64> = free.iter().map(|&i| s.members[i].position.y).collect();
            candidates(table, &lateral_m, routes)
        }
        Strategy::PaperRule => vec![table.split()],
        Strategy::Fixed { left, right } if routes == 2 && left + right == free.len() => {
            vec![table.fixed(&[right, left]).ok()?]
        }
        Strategy::ShortestPath | Strategy::Fixed { .. } => vec![table.shortest()],
    })
}
