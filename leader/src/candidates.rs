//! The groupings that are worth a rehearsal: a pure function of arrival times and of where the drones are.

use crate::split::{ArrivalTable, RouteAssignment};

/// Most groupings, the shortest ways and the rule's among them.
const MOST: usize = 16;

/// The shortest ways first, the rule's grouping second, then the best of those with other numbers of drones on the
/// routes, by makespan: exact, or in lateral order, where no lanes cross. No two alike. `lateral_m` is each drone's
/// ordinate, the rows of the table.
#[must_use]
pub fn candidates(table: &ArrivalTable, lateral_m: &[f64], routes: usize) -> Vec<RouteAssignment> {
    let rule = table.split();
    let mut counts: Vec<usize> = vec![0; routes];
    rule.routes.iter().for_each(|&route| counts[route] += 1);
    let numbers = neighbouring(&counts, lateral_m.len());
    let in_order = |counts: &Vec<usize>| in_lateral_order(table, lateral_m, counts);
    let mut others: Vec<RouteAssignment> = numbers.iter().chain([&counts]).filter_map(in_order).collect();
    others.extend(numbers.iter().filter_map(|counts| table.fixed(counts).ok()));
    others.sort_by(|a, b| a.makespan_s.total_cmp(&b.makespan_s).then(a.total_s.total_cmp(&b.total_s)));
    let mut kept: Vec<RouteAssignment> = Vec::new();
    for split in [table.shortest(), rule].into_iter().chain(others) {
        if kept.len() < MOST && !kept.iter().any(|other| other.routes == split.routes) {
            kept.push(split);
        }
    }
    kept
}

/// The drones dealt out to the routes from right to left, so many to each.
fn in_lateral_order(table: &ArrivalTable, lateral_m: &[f64], counts: &[usize]) -> Option<RouteAssignment> {
    let mut from_right: Vec<usize> = (0..lateral_m.len()).collect();
    from_right.sort_by(|&a, &b| lateral_m[a].total_cmp(&lateral_m[b]).then(a.cmp(&b)));
    let mut chosen = vec![0; from_right.len()];
    let lanes = counts.iter().enumerate().flat_map(|(route, &count)| std::iter::repeat_n(route, count));
    from_right.iter().zip(lanes).for_each(|(&drone, route)| chosen[drone] = route);
    table.assigned(&chosen).ok()
}

/// Numbers of drones on the routes: all of them for two routes, else those that move one or two drones over.
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
    fn the_shortest_ways_and_the_rule_come_first_and_none_twice() {
        // Six drones close to the right route; the left one is two seconds longer.
        let arrivals: Vec<Vec<f64>> = (0..6).map(|i| vec![10.0 + f64::from(i), 12.0 + f64::from(i)]).collect();
        let table = ArrivalTable::new(&arrivals, &[4.0, 4.0]).expect("a table of numbers");
        let lateral_m: Vec<f64> = (0..6).map(|i| f64::from(i % 3)).collect();
        let found = candidates(&table, &lateral_m, 2);
        assert_eq!(found[0].routes, vec![0; 6]);
        assert_eq!(found[1].routes, table.split().routes);
        assert!(found.len() > 6 && found.len() <= MOST);
        assert!(found.iter().enumerate().all(|(i, a)| found[..i].iter().all(|b| a.routes != b.routes)));
        assert!(found[2..].is_sorted_by_key(|split| split.makespan_s));
        // Three on the left: the leftmost ones, without a lane that crosses another.
        assert!(found.iter().any(|split| split.routes == [0, 0, 1, 0, 1, 1] || split.routes == [0, 1, 1, 0, 0, 1]));
    }

    #[test]
    fn where_all_agree_there_is_one() {
        let table = ArrivalTable::new(&[vec![3.0]], &[4.0]).expect("a table of numbers");
        assert_eq!(candidates(&table, &[0.0], 1).len(), 1);
    }
}
