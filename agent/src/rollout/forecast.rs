//! The result of simulating one alternative, and the choice between several results.

use crate::tuning::{MIN_SAVING, MIN_SAVING_UNSEEN, MIN_TIME_SAVING_SAME_LENGTH, MIN_TIME_SAVING_UNSEEN};

/// Two paths count as equally long if they differ by no more than this share.
const ROUNDING: f64 = 1e-6;

/// What one alternative leads to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forecast {
    /// Whether all drones arrived, kept their distances and flew the plan as it was ordered.
    pub good: bool,
    /// Cost by the objective, until the mission's end.
    pub cost: f64,
    /// Energy of all drones from the decision until the mission's end, J.
    pub energy_j: f64,
    /// Time from the decision until the mission's end, s.
    pub end_s: f64,
    /// Time from the decision until the last drone passes the gate, s.
    pub pass_s: f64,
    /// Time to the gate in free flight, s: the mean over the drones.
    pub path_s: f64,
}

impl Forecast {
    /// Whether this forecast is good enough to leave the shortest paths. `sees_the_end`: no unknown obstacle set fits in
    /// before the mission's end.
    fn undercuts(&self, shortest: &Self, sees_the_end: bool) -> bool {
        if !shortest.good {
            return true;
        }
        let cheaper = |share: f64| self.cost <= (1.0 - share) * shortest.cost;
        if sees_the_end {
            return cheaper(MIN_SAVING);
        }
        let sooner = |share: f64| self.pass_s <= (1.0 - share) * shortest.pass_s;
        let same_length = self.path_s - shortest.path_s <= ROUNDING * shortest.path_s.abs();
        cheaper(MIN_SAVING_UNSEEN)
            || (cheaper(MIN_SAVING) && sooner(MIN_TIME_SAVING_UNSEEN))
            || (same_length && cheaper(0.0) && sooner(MIN_TIME_SAVING_SAME_LENGTH))
    }
}

/// Index of the forecast to follow. The first is that of the shortest paths, the second that of the paper's rule.
///
/// It is the cheapest good one that undercuts the shortest paths, or else the shortest paths. The paper's rule is preferred
/// to an alternative that is hardly cheaper, because a forecast is not more exact than that.
pub(crate) fn best(forecasts: &[Forecast], sees_the_end: bool) -> usize {
    let order = |a: &usize, b: &usize| {
        let (a, b) = (&forecasts[*a], &forecasts[*b]);
        a.cost.total_cmp(&b.cost).then(a.energy_j.total_cmp(&b.energy_j)).then(a.end_s.total_cmp(&b.end_s))
    };
    let eligible = |&i: &usize| forecasts[i].good && (i == 0 || forecasts[i].undercuts(&forecasts[0], sees_the_end));
    let candidates: Vec<usize> = (0..forecasts.len()).filter(eligible).collect();
    let Some(best) = candidates.iter().copied().min_by(order) else { return 0 };
    let as_good = |rule: &Forecast| (1.0 - MIN_SAVING) * rule.cost <= forecasts[best].cost;
    if best > 0 && candidates.contains(&1) && as_good(&forecasts[1]) { 1 } else { best }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forecast(good: bool, cost: f64, end_s: f64) -> Forecast {
        Forecast { good, cost, energy_j: 1000.0 * cost, end_s, pass_s: 10.0, path_s: 10.0 }
    }

    #[test]
    fn the_shortest_paths_stay_unless_an_alternative_is_clearly_better() {
        let of = |costs: &[f64]| costs.iter().map(|&cost| forecast(true, cost, 30.0)).collect::<Vec<_>>();
        assert_eq!(best(&of(&[60.0, 58.3, 61.0]), true), 0);
        assert_eq!(best(&of(&[60.0, 58.1, 54.0]), true), 2);
        assert_eq!(best(&of(&[60.0, 58.1, 48.5]), false), 0);
        assert_eq!(best(&[], true), 0);
    }

    #[test]
    fn time_counts_as_well_while_unknown_obstacles_may_come() {
        let shortest = Forecast { pass_s: 20.0, ..forecast(true, 60.0, 30.0) };
        let other = |cost: f64, pass_s: f64| Forecast { pass_s, path_s: 11.0, ..forecast(true, cost, 30.0) };
        let same_length = |cost: f64, pass_s: f64| Forecast { path_s: 10.0, ..other(cost, pass_s) };
        assert_eq!(best(&[shortest, other(58.0, 16.4)], false), 0);
        assert_eq!(best(&[shortest, other(58.0, 16.2)], false), 1);
        assert_eq!(best(&[shortest, other(58.5, 12.0)], false), 0, "hardly cheaper");
        assert_eq!(best(&[shortest, other(47.9, 20.0)], false), 1);
        assert_eq!(best(&[shortest, other(57.0, 17.5), other(58.0, 16.2)], false), 2);
        assert_eq!(best(&[shortest, same_length(59.9, 18.1)], false), 1, "no path is longer");
        assert_eq!(best(&[shortest, same_length(59.9, 18.3)], false), 0);
        assert_eq!(best(&[shortest, same_length(60.1, 15.0)], false), 0);
        assert_eq!(best(&[shortest, other(58.0, 20.0)], true), 1);
    }

    #[test]
    fn the_papers_rule_is_preferred_to_an_alternative_that_is_hardly_better() {
        let of = |costs: &[f64]| costs.iter().map(|&cost| forecast(true, cost, 30.0)).collect::<Vec<_>>();
        assert_eq!(best(&of(&[60.0, 55.0, 54.6]), true), 1);
        assert_eq!(best(&of(&[60.0, 55.0, 53.0]), true), 2);
        assert_eq!(best(&of(&[60.0, 58.6, 57.9]), true), 2, "the rule is hardly better than the shortest paths");
        assert_eq!(best(&[of(&[60.0])[0], forecast(false, 50.0, 30.0), of(&[50.2])[0]], true), 2);
    }

    #[test]
    fn unsafe_alternatives_are_not_taken_and_ties_go_to_the_earlier_end() {
        let shortest = forecast(true, 60.0, 30.0);
        assert_eq!(best(&[shortest, forecast(false, 50.0, 28.0)], true), 0);
        let (jams, late, early) = (forecast(false, 50.0, 28.0), forecast(true, 50.0, 29.0), forecast(true, 50.0, 28.0));
        assert_eq!(best(&[shortest, jams, late, early], true), 3);
        // If the shortest paths jam, anything that gets through is better.
        assert_eq!(best(&[forecast(false, 20.0, 200.0), forecast(true, 90.0, 40.0)], true), 1);
    }
}
