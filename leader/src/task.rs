//! What a leader has to decide next.

use crate::member::Member;
use crate::planned_set::PlannedSet;
use crate::situation::Situation;
use crate::tuning::{ASSIGNMENTS_DUE_S, FAR_REPEATS};
use skein_protocol::{ObstacleId, SimTime};

/// What a leader has to decide next.
#[derive(Debug, PartialEq)]
pub(crate) enum Task {
    /// Plan the routes past this obstacle set.
    Avoid(Vec<ObstacleId>),
    /// Nothing: the group is on its way past a set.
    Wait,
    /// Nothing is ahead. Assign slots, if that is not done yet.
    Form,
}

impl Task {
    /// The first set, in flight order, that some member still has to pass and that is not planned for in this term. Once a
    /// group is split, the leaders of its parts plan the next set, except for members of no part.
    pub(crate) fn next(s: &Situation<'_>) -> Self {
        let split = s.members.iter().any(|m| m.group != s.scope && s.scope.contains(m.group));
        let unplaced = |m: &&Member| !s.scope.contains(m.group) || (split && m.group == s.scope);
        let mut task = Self::Form;
        for set in s.obstacles.to_be_passed() {
            let exit_x_m = s.exit_x_m(set);
            let past = |m: &Member| m.settled || s.obstacles.is_past(m.id, m.position.x, set, exit_x_m);
            if s.members.iter().all(past) {
                continue;
            }
            let planned = s.ledger.sets().iter().find(|p| p.ids == *set && counts(p, s));
            // A member of no part takes part in a planned set even if it is past it.
            let joins = |m: &&Member| planned.is_some() && unplaced(m);
            let waiting: Vec<&Member> = s.members.iter().filter(|m| !past(m) || joins(m)).collect();
            let has_part = |m: &&Member| planned.is_some_and(|p| p.parts.contains(m.id)) && !unplaced(m);
            let others_wait =
                if planned.is_some() { !waiting.iter().any(unplaced) } else { !waiting.iter().all(unplaced) };
            let left_to_parts = split && others_wait;
            if !left_to_parts && !waiting.iter().all(has_part) && !planned.is_some_and(|p| is_awaited(p, s)) {
                return Self::Avoid(set.clone());
            }
            task = Self::Wait;
        }
        task
    }
}

/// When the newest obstacle of a set was learnt that no plan covers yet. The start of the mission if all are covered and
/// only the term or the members changed.
pub(crate) fn learnt(s: &Situation<'_>, set: &[ObstacleId]) -> SimTime {
    let planned = |id: &ObstacleId| s.ledger.sets().iter().any(|p| p.ids.contains(id));
    let new = set.iter().filter(|id| !planned(id)).filter_map(|&id| s.obstacles.get(id));
    new.map(|known| known.since).max().unwrap_or(SimTime::ZERO)
}

/// Whether assignments of an earlier leader's plan may still be under way to this leader. New ones would then change the
/// order of a queue that others already fly in.
fn is_awaited(planned: &PlannedSet, s: &Situation<'_>) -> bool {
    let age_s = s.now.since(planned.made);
    // A leader repeats the assignments of drones that it does not hear itself less often.
    let due_s = ASSIGNMENTS_DUE_S * if s.wide { f64::from(FAR_REPEATS) } else { 1.0 };
    planned.stamp.ballot != s.ballot
        && planned.parts.len() < planned.members as usize
        && (0.0..due_s + 2.0 * s.delay_s).contains(&age_s)
}

/// Whether the plan for a set was made in this term, or by the leader of the group that this one was split from.
fn counts(planned: &PlannedSet, s: &Situation<'_>) -> bool {
    planned.stamp.ballot == s.ballot || (planned.scope != s.scope && planned.scope.contains(s.scope))
}
