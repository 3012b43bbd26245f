//! The groupings that are handed to a rollout: a pure function of arrival times and positions.

use crate::split::{ArrivalTable, RouteAssignment};
use crate::tuning::MAX_CANDIDATES;

pub use crate::tuning::MAX_ROLLOUT_DRONES;

/// The candidates, no two alike, at most 16: the shortest paths first, the paper's rule second. Then, by makespan, the best
/// groupings with other numbers of drones on the routes. For each of these numbers there is the exact optimum, and the one
/// in lateral order, in which no paths cross. `lateral_m`: ordinate of each drone, m, in the order of the table's rows.
#[must_use]
pub fn candidates(table: &ArrivalTable, lateral_m: &[f64], routes: usize) -> Vec<RouteAssignment> {
    let rule = table.split();
    let mut counts: Vec<usize> = vec![0; routes];
    for &route in &rule.routes {
        counts[route] += 1;
    }
    let numbers = neighbouring(&counts, lateral_m.len());
    let in_order = |counts: &Vec<usize>| in_lateral_order(table, lateral_m, counts);
    let mut others: Vec<RouteAssignment> = numbers.iter().chain([&counts]).filter_map(in_order).collect();
    others.extend(numbers.iter().filter_map(|counts| table.fixed(counts).ok()));
    others.sort_by(|a, b| a.makespan_s.total_cmp(&b.makespan_s).then(a.total_s.total_cmp(&b.total_s)));
    distinct([table.shortest(), rule].into_iter().chain(others))
}

/// The first two of the [`candidates`]: what a leader chooses from if the swarm is too large for a rollout. The others take
/// as many exact splits as there are drones.
#[must_use]
pub fn shortest_and_rule(table: &ArrivalTable) -> Vec<RouteAssignment> {
    distinct([table.shortest(), table.split()].into_iter())
}

fn distinct(splits: impl Iterator<Item = RouteAssignment>) -> Vec<RouteAssignment> {
    let mut kept: Vec<RouteAssignment> = Vec::new();
    for split in splits {
        if kept.len() < MAX_CANDIDATES && !kept.iter().any(|other| other.routes == split.routes) {
            kept.push(split);
        }
    }
    kept
}

/// Fills the routes from right to left with the drones in lateral order, `counts[route]` drones each.
fn in_lateral_order(table: &ArrivalTable, lateral_m: &[f64], counts: &[usize]) -> Option<RouteAssignment> {
    let mut from_right: Vec<usize> = (0..lateral_m.len()).collect();
    from_right.sort_by(|&a, &b| lateral_m[a].total_cmp(&lateral_m[b]).then(a.cmp(&b)));
    let mut chosen = vec![0; from_right.len()];
    let routes = counts.iter().enumerate().flat_map(|(route, &count)| std::iter::repeat_n(route, count));
    for (&drone, route) in from_right.iter().zip(routes) {
        chosen[drone] = route;
    }
    table.assigned(&chosen).ok()
}

/// Other numbers of drones on the routes: all combinations for two routes, otherwise those that move one or two drones.
fn neighbouring(counts: &[usize], drones: usize) -> Vec<Vec<usize>> {
    if counts.len() == 2 {
        return (0..=drones).map(|right| vec![right, drones - right]).collect();
    }
    let mut all = Vec::new();
    for from in 0..counts.len() {
        for to in (0..counts.len()).filter(|&to| to != from) {
            for moved in 1..=counts[from].min(2) {
                let mut next = counts.to_vec();
                next[from] -= moved;
                next[to] += moved;
                all.push(next);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_paths_and_the_rule_come_first_and_no_candidate_comes_twice() {
        // Six drones close to the right route; the left one is two seconds longer.
        let arrivals: Vec<Vec<f64>> = (0..6).map(|i| vec![10.0 + f64::from(i), 12.0 + f64::from(i)]).collect();
        let table = ArrivalTable::new(&arrivals, &[4.0, 4.0]).expect("a table of numbers");
        let lateral_m: Vec<f64> = (0..6).map(|i| f64::from(i % 3)).collect();
        let found = candidates(&table, &lateral_m, 2);
        assert_eq!(found[0].routes, vec![0; 6]);
        assert_eq!(found[1].routes, table.split().routes);
        assert!(found.len() > 6 && found.len() <= MAX_CANDIDATES);
        assert_eq!(shortest_and_rule(&table), found[..2]);
        assert!(found.iter().enumerate().all(|(i, a)| found[..i].iter().all(|b| a.routes != b.routes)));
        assert!(found[2..].is_sorted_by_key(|split| split.makespan_s));
        // Three on the left: the leftmost drones, so that no paths cross.
        assert!(found.iter().any(|split| split.routes == [0, 0, 1, 0, 1, 1] || split.routes == [0, 1, 1, 0, 0, 1]));
    }

    #[test]
    fn a_single_route_has_a_single_candidate() {
        let table = ArrivalTable::new(&[vec![3.0]], &[4.0]).expect("a table of numbers");
        assert_eq!(candidates(&table, &[0.0], 1).len(), 1);
    }
}
