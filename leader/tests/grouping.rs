//! The exact grouping and the slot assignment against brute force.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use proptest::prelude::*;
use skein_leader::slots::{TooFewSlots, assign};
use skein_leader::split::{ArrivalTable, RouteAssignment, SplitError};
use skein_protocol::Vec2;
use std::collections::BTreeSet;

/// Every assignment of drones to routes, one after the other.
fn assignments(drones: usize, routes: usize) -> impl Iterator<Item = Vec<usize>> {
    (0..routes.pow(drones as u32)).map(move |code| (0..drones).map(|i| code / routes.pow(i as u32) % routes).collect())
}

fn micros(seconds: f64) -> i64 {
    (seconds * 1e6).round() as i64
}

fn counts(routes: &[usize], number: usize) -> Vec<usize> {
    (0..number).map(|route| routes.iter().filter(|&&r| r == route).count()).collect()
}

/// The makespan by its definition, µs: the queue of each route, drone after drone.
fn makespan(arrivals: &[Vec<f64>], headway_s: &[f64], routes: &[usize]) -> i64 {
    let last = |route: usize| {
        let mut queue: Vec<i64> =
            arrivals.iter().zip(routes).filter(|(_, r)| **r == route).map(|(row, _)| micros(row[route])).collect();
        queue.sort_unstable();
        queue.into_iter().reduce(|last, arrival| arrival.max(last + micros(headway_s[route])))
    };
    (0..headway_s.len()).filter_map(last).max().unwrap_or(0)
}

/// Least (makespan, total arrival) in µs, and the numbers of drones for each route that reach it.
type Optimum = ((i64, i64), BTreeSet<Vec<usize>>);

fn brute_force(arrivals: &[Vec<f64>], headway_s: &[f64], wanted: Option<&[usize]>) -> Option<Optimum> {
    let mut best: Option<Optimum> = None;
    for routes in assignments(arrivals.len(), headway_s.len()) {
        let own = || arrivals.iter().zip(&routes).map(|(row, &route)| row[route]);
        let counts = counts(&routes, headway_s.len());
        if own().any(f64::is_infinite) || wanted.is_some_and(|wanted| wanted != counts) {
            continue;
        }
        let value = (makespan(arrivals, headway_s, &routes), own().map(micros).sum::<i64>());
        match &mut best {
            Some((least, _)) if value > *least => {}
            Some((least, all)) if value == *least => drop(all.insert(counts)),
            _ => best = Some((value, BTreeSet::from([counts]))),
        }
    }
    best
}

fn value(split: &RouteAssignment) -> (i64, i64) {
    (micros(split.makespan_s), micros(split.total_s))
}

/// Continuous times, or coarse ones with many ties. Some routes are not usable.
fn arrival() -> impl Strategy<Value = f64> {
    prop_oneof![4 => 0.0..20.0, 4 => (0..12i32).prop_map(f64::from), 1 => Just(f64::INFINITY), 1 => -5.0..0.0]
}

fn instance(drones: usize, routes: usize) -> impl Strategy<Value = (Vec<Vec<f64>>, Vec<f64>)> {
    let row = move || {
        prop::collection::vec(arrival(), routes).prop_map(|mut row| {
            // The first route is open to all drones.
            row[0] = if row[0].is_finite() { row[0] } else { 7.0 };
            row
        })
    };
    let headway = prop_oneof![0.3..4.0, (0..4i32).prop_map(f64::from)];
    (prop::collection::vec(row(), drones), prop::collection::vec(headway, routes))
}

fn any_instance() -> impl Strategy<Value = (Vec<Vec<f64>>, Vec<f64>)> {
    let size = prop_oneof![4 => (1..=7usize, 1..=3usize), 1 => (8..=11usize, Just(2usize))];
    size.prop_flat_map(|(drones, routes)| instance(drones, routes))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_split_is_the_best_of_all_assignments((arrivals, headway_s) in any_instance()) {
        let split = ArrivalTable::new(&arrivals, &headway_s).unwrap().split();
        let (best, all) = brute_force(&arrivals, &headway_s, None).unwrap();
        prop_assert_eq!(value(&split), best);
        prop_assert_eq!(micros(split.makespan_s), makespan(&arrivals, &headway_s, &split.routes));
        prop_assert!(all.contains(&counts(&split.routes, headway_s.len())));
    }

    #[test]
    fn identical_drones_are_split_optimally(
        row in prop::collection::vec((0..9i32).prop_map(f64::from), 1..4), drones in 1..8usize, headway in 0.5..3.0,
    ) {
        let (arrivals, headway_s) = (vec![row.clone(); drones], vec![headway; row.len()]);
        let split = ArrivalTable::new(&arrivals, &headway_s).unwrap().split();
        prop_assert_eq!(value(&split), brute_force(&arrivals, &headway_s, None).unwrap().0);
    }

    #[test]
    fn a_fixed_split_is_the_best_with_its_counts((arrivals, headway_s) in any_instance(), pick in any::<prop::sample::Index>()) {
        let routes = headway_s.len();
        let code = pick.index(routes.pow(arrivals.len() as u32));
        let wanted = counts(&assignments(arrivals.len(), routes).nth(code).unwrap(), routes);
        let fixed = ArrivalTable::new(&arrivals, &headway_s).unwrap().fixed(&wanted);
        match brute_force(&arrivals, &headway_s, Some(&wanted)) {
            Some((best, _)) => {
                let fixed = fixed.unwrap();
                prop_assert_eq!(value(&fixed), best);
                prop_assert_eq!(counts(&fixed.routes, routes), wanted);
            }
            None => prop_assert_eq!(fixed, Err(SplitError::Counts { drones: arrivals.len() })),
        }
    }

    #[test]
    fn mirrored_arrivals_give_mirrored_counts((mut arrivals, mut headway_s) in any_instance()) {
        let split = ArrivalTable::new(&arrivals, &headway_s).unwrap().split();
        let (_, all) = brute_force(&arrivals, &headway_s, None).unwrap();
        arrivals.iter_mut().for_each(|row| row.reverse());
        headway_s.reverse();
        let mirrored = ArrivalTable::new(&arrivals, &headway_s).unwrap().split();
        prop_assert_eq!(value(&split), value(&mirrored));
        let mut back = counts(&mirrored.routes, headway_s.len());
        back.reverse();
        // Where several splits are best, the mirror image may be another one of them.
        prop_assert!(all.contains(&back), "{:?} is not among {:?}", back, all);
    }

    #[test]
    fn pass_times_follow_the_queue((arrivals, headway_s) in any_instance()) {
        let split = ArrivalTable::new(&arrivals, &headway_s).unwrap().split();
        let mut seen = vec![false; arrivals.len()];
        for (route, queue) in split.queues.iter().enumerate() {
            for (k, &drone) in queue.iter().enumerate() {
                prop_assert_eq!(split.routes[drone], route);
                seen[drone] = true;
                let free = micros(arrivals[drone][route]);
                let behind = k.checked_sub(1).map(|k| micros(split.pass_s[queue[k]]) + micros(headway_s[route]));
                prop_assert_eq!(micros(split.pass_s[drone]), behind.map_or(free, |behind| behind.max(free)));
                let order = |k: usize| (micros(arrivals[queue[k]][route]), queue[k]);
                prop_assert!(k == 0 || order(k - 1) < order(k));
            }
        }
        prop_assert!(seen.into_iter().all(|seen| seen));
    }

    #[test]
    fn the_slot_assignment_is_the_best_permutation(
        positions in prop::collection::vec((-9..9i32, -9..9i32), 0..=6usize),
        slots in prop::collection::vec((-9.0..9.0, -9.0..9.0), 6..=7usize),
    ) {
        let positions: Vec<Vec2> = positions.iter().map(|&(x, y)| Vec2::new(x.into(), y.into())).collect();
        let slots: Vec<Vec2> = slots.iter().map(|&(x, y)| Vec2::new(x, y)).collect();
        let taken = assign(&positions, &slots).unwrap();
        prop_assert_eq!(taken.iter().collect::<BTreeSet<_>>().len(), positions.len());
        let total: f64 = taken.iter().zip(&positions).map(|(&slot, p)| (slots[slot] - p).norm_squared()).sum();
        let least = least_total(&positions, &slots, &mut vec![true; slots.len()]);
        prop_assert!((total - least).abs() < 1e-9, "{} is not {}", total, least);
    }
}

fn least_total(positions: &[Vec2], slots: &[Vec2], free: &mut Vec<bool>) -> f64 {
    let Some((first, rest)) = positions.split_first() else { return 0.0 };
    let mut least = f64::INFINITY;
    for slot in 0..slots.len() {
        if free[slot] {
            free[slot] = false;
            least = least.min((slots[slot] - first).norm_squared() + least_total(rest, slots, free));
            free[slot] = true;
        }
    }
    least
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_move_and_no_swap_improves_a_large_split(
        (arrivals, headway_s) in (20..50usize, 2..=4usize).prop_flat_map(|(drones, routes)| instance(drones, routes)),
    ) {
        let table = ArrivalTable::new(&arrivals, &headway_s).unwrap();
        let split = table.split();
        let improves = |routes: &[usize]| table.assigned(routes).is_ok_and(|other| value(&other) < value(&split));
        for i in 0..arrivals.len() {
            for route in 0..headway_s.len() {
                let mut moved = split.routes.clone();
                moved[i] = route;
                prop_assert!(!improves(&moved), "drone {} to route {}", i, route);
            }
            for j in 0..i {
                let mut swapped = split.routes.clone();
                swapped.swap(i, j);
                prop_assert!(!improves(&swapped), "drones {} and {}", i, j);
            }
        }
    }
}

#[test]
fn a_bad_table_is_refused_with_its_reason() {
    let new = |rows: &[Vec<f64>], headways: &[f64]| ArrivalTable::new(rows, headways).unwrap_err();
    let columns = SplitError::Columns { drone: 1, found: 1, expected: 2 };
    assert_eq!(new(&[vec![1.0, 2.0], vec![1.0]], &[1.0, 1.0]), columns);
    assert_eq!(new(&[vec![1.0]], &[-1.0]), SplitError::Headway { route: 0, headway_s: -1.0 });
    assert_eq!(new(&[vec![f64::INFINITY]], &[1.0]), SplitError::NoRoute { drone: 0 });
    assert_eq!(new(&[vec![f64::NAN]], &[1.0]), SplitError::Arrival { drone: 0, route: 0 });
    assert!(matches!(new(&[vec![1.0]], &[f64::NAN]), SplitError::Headway { route: 0, .. }));
    let table = ArrivalTable::new(&[vec![1.0, f64::INFINITY]], &[1.0, 1.0]).unwrap();
    assert_eq!(table.assigned(&[1]), Err(SplitError::Assignment { drones: 1 }));
    assert_eq!(table.assigned(&[9]), Err(SplitError::Assignment { drones: 1 }));
    assert_eq!(table.fixed(&[0, 1]), Err(SplitError::Counts { drones: 1 }));
    assert_eq!(table.fixed(&[usize::MAX, 2]), Err(SplitError::Counts { drones: 1 }));
}

#[test]
fn no_drones_give_an_empty_split() {
    let split = ArrivalTable::new(&[], &[1.0, 1.0]).unwrap().split();
    assert_eq!((split.makespan_s, split.queues.len()), (0.0, 2));
    assert_eq!(ArrivalTable::new(&[], &[1.0, 1.0]).unwrap().least_makespan_s(), 0.0);
    assert!(assign(&[], &[]).unwrap().is_empty());
    assert_eq!(assign(&[Vec2::zeros()], &[]), Err(TooFewSlots { drones: 1, slots: 0 }));
}

#[test]
fn a_thousand_drones_are_split_exactly() {
    let row = |i: usize| (0..4).map(|r| ((i * 7919 + r * 104_729) % 4001) as f64 / 10.0 + 3.0 * r as f64).collect();
    let rows: Vec<Vec<f64>> = (0..1000).map(row).collect();
    let split = ArrivalTable::new(&rows, &[3.0; 4]).unwrap().split();
    let shortest = ArrivalTable::new(&rows, &[3.0; 4]).unwrap().shortest();
    assert_eq!(ArrivalTable::new(&rows, &[3.0; 4]).unwrap().least_makespan_s(), split.makespan_s);
    assert!(split.makespan_s < shortest.makespan_s && split.total_s >= shortest.total_s);
    // A thousand passes over four routes, three seconds apart, starting with the earliest arrival of all.
    assert!(split.makespan_s >= 249.0 * 3.0);
    assert_eq!(split.queues.iter().map(Vec::len).sum::<usize>(), 1000);
}
