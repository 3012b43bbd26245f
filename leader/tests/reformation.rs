//! Which drone takes which slot, by each method, and the bending energy of the thin-plate spline.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use proptest::prelude::*;
use skein_leader::slots::{Reformation, TooFewSlots, assign, assign_along, assign_by};
use skein_leader::tps;
use skein_protocol::Vec2;
use skein_protocol::formation::Shape;
use skein_protocol::thin_plate::bending_energy;

const METHODS: [Reformation; 5] = [
    Reformation::Optimal,
    Reformation::Tps { lambda_m2: 0.0 },
    Reformation::Tps { lambda_m2: 1000.0 },
    Reformation::Greedy,
    Reformation::Identity,
];

fn squares(positions: &[Vec2], slots: &[Vec2], taken: &[usize]) -> f64 {
    positions.iter().zip(taken).map(|(p, &slot)| (p - slots[slot]).norm_squared()).sum()
}

fn is_matching(taken: &[usize], drones: usize, slots: usize) -> bool {
    let mut sorted = taken.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    taken.len() == drones && sorted.len() == drones && sorted.iter().all(|&slot| slot < slots)
}

/// Some coordinates are on a coarse grid, so that points coincide or lie on a line.
fn points(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Vec2>> {
    let fine = (-200.0..200.0, -200.0..200.0);
    let coarse = (-2i32..2, -1i32..1).prop_map(|(x, y)| (f64::from(x) * 40.0, f64::from(y) * 40.0));
    let point = |(x, y)| Vec2::new(x, y);
    prop_oneof![
        prop::collection::vec(fine.prop_map(point), count.clone()),
        prop::collection::vec(coarse.prop_map(point), count)
    ]
}

proptest! {
    #[test]
    fn every_method_gives_each_drone_a_slot_of_its_own(
        drones in points(0..14),
        mut slots in points(0..14),
        spare in 0usize..3,
    ) {
        while slots.len() < drones.len() + spare {
            slots.push(Vec2::new(0.0, 10.0 * slots.len() as f64));
        }
        for method in METHODS {
            let taken = assign_by(method, &drones, &slots).unwrap();
            prop_assert!(is_matching(&taken, drones.len(), slots.len()), "{method:?}: {taken:?}");
            prop_assert_eq!(&taken, &assign_by(method, &drones, &slots).unwrap());
        }
        for lambda in [0.0, 1000.0] {
            let taken = tps::assign(&drones, &slots, lambda);
            prop_assert!(taken.is_some_and(|taken| is_matching(&taken, drones.len(), slots.len())), "λ = {lambda}");
        }
    }

    #[test]
    fn annealing_with_free_bending_is_as_good_as_optimal(
        drones in prop::collection::vec((-200.0..50.0, -150.0..150.0), 1..21),
    ) {
        let drones: Vec<Vec2> = drones.into_iter().map(|(x, y)| Vec2::new(x, y)).collect();
        let slots = Shape::NestedV.slots(drones.len(), 35.0);
        let least = squares(&drones, &slots, &assign(&drones, &slots).unwrap());
        let annealed = squares(&drones, &slots, &tps::assign(&drones, &slots, 0.0).unwrap());
        prop_assert!(annealed <= least * 1.01, "{annealed} instead of {least} m²");
    }

    #[test]
    fn an_affine_map_does_not_bend(
        drones in points(1..20),
        (a, b, c) in (-3.0..3.0, -3.0..3.0, -3.0..3.0),
        lambda in 0.0..1e6,
    ) {
        let map = |p: &Vec2| Vec2::new(a * p.x + b * p.y + 7.0, c * p.x - a * p.y - 3.0);
        let to: Vec<Vec2> = drones.iter().map(map).collect();
        let energy = bending_energy(&drones, &to, lambda).unwrap();
        prop_assert!(energy.data_m2 < 1e-6 && energy.bending < 1e-6, "{energy:?}");
    }

    #[test]
    fn the_energy_of_any_points_is_finite(
        (from, to) in (1usize..16).prop_flat_map(|n| (points(n..n + 1), points(n..n + 1))),
        lambda in 0.0..1e4,
    ) {
        let energy = bending_energy(&from, &to, lambda).unwrap();
        prop_assert!(energy.data_m2.is_finite() && energy.data_m2 >= 0.0, "{energy:?}");
        prop_assert!(energy.bending.is_finite() && energy.bending >= 0.0, "{energy:?}");
        let most: f64 = to.iter().map(|to| to.norm_squared()).sum();
        prop_assert!(energy.data_m2 <= most + 1e-6, "{energy:?} is worse than sending all to the origin, {most} m²");
    }
}

/// The formation turned, stretched and bent. Each drone still fits its own slot best if the order is kept.
fn disturbed(slots: &[Vec2]) -> Vec<Vec2> {
    let (sin, cos) = 0.7f64.sin_cos();
    let bend = |p: &Vec2| Vec2::new(1.2 * p.x + 0.002 * p.y * p.y, 0.8 * p.y);
    slots.iter().map(bend).map(|p| Vec2::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y)).collect()
}

#[test]
fn a_stiff_spline_keeps_the_formations_order_where_least_distance_breaks_it() {
    let slots = Shape::NestedV.slots(30, 35.0);
    let drones = disturbed(&slots);
    let own: Vec<usize> = (0..30).collect();
    assert_ne!(assign(&drones, &slots).unwrap(), own);
    assert_eq!(tps::assign(&drones, &slots, 1e4).unwrap(), own);
}

#[test]
fn bending_costs_energy_and_stiffness_trades_it_for_distance() {
    let slots = Shape::NestedV.slots(8, 35.0);
    let drones = disturbed(&slots);
    let [free, soft, stiff] = [0.0, 100.0, 1e9].map(|lambda| bending_energy(&drones, &slots, lambda).unwrap());
    assert!(free.data_m2 < 1e-6 && free.bending > 1e-3, "{free:?}");
    assert!(soft.data_m2 > free.data_m2 && soft.bending < free.bending, "{soft:?}");
    assert!(stiff.data_m2 > soft.data_m2 && stiff.bending < 1e-6 * free.bending, "{stiff:?}");
    assert!(soft.total_m2(100.0) < free.total_m2(100.0) && soft.total_m2(100.0) < stiff.total_m2(100.0));
}

#[test]
fn greedy_takes_the_closest_pair_first_and_identity_the_order() {
    let at = |x: f64| Vec2::new(x, 0.0);
    let (drones, slots) = ([at(0.0), at(2.0)], [at(3.0), at(-30.0)]);
    assert_eq!(assign_by(Reformation::Greedy, &drones, &slots), Ok(vec![1, 0]));
    let slots = [at(1.2), at(-1.5), at(100.0)];
    // The second drone is the closest to the first slot; the first one, left over, takes the next slot.
    assert_eq!(assign_by(Reformation::Greedy, &drones, &slots), Ok(vec![1, 0]));
    let slots = [at(0.9), at(-100.0), at(100.0)];
    // Greed: 98 m for the second drone, although both would have fared better otherwise.
    assert_eq!(assign_by(Reformation::Greedy, &drones, &slots), Ok(vec![0, 2]));
    let slots = [at(2.0), at(0.0)];
    assert_eq!(assign_by(Reformation::Identity, &drones, &slots), Ok(vec![0, 1]));
    assert_eq!(assign_by(Reformation::Optimal, &drones, &slots), Ok(vec![1, 0]));
}

#[test]
fn inputs_that_cannot_be_mapped_are_refused_or_assigned_optimally() {
    let slots = Shape::Wedge.slots(201, 35.0);
    assert_eq!(tps::assign(&slots, &slots, 0.0), None);
    let tps = Reformation::Tps { lambda_m2: 0.0 };
    assert_eq!(assign_by(tps, &slots, &slots), assign(&slots, &slots));
    let (one, lost) = ([Vec2::zeros()], [Vec2::new(f64::NAN, 0.0)]);
    for (from, to, lambda) in [(&lost, &one, 1.0), (&one, &lost, 1.0), (&one, &one, -1.0), (&one, &one, f64::NAN)] {
        assert_eq!(bending_energy(from, to, lambda), None);
        assert_eq!(tps::assign(from, to, lambda), None);
    }
    assert_eq!(bending_energy(&slots, &one, 1.0), None);
    for method in METHODS {
        assert_eq!(assign_by(method, &slots[..2], &one), Err(TooFewSlots { drones: 2, slots: 1 }));
    }
}

#[test]
fn two_hundred_drones_are_mapped() {
    let slots = Shape::Wedge.slots(200, 35.0);
    let taken = tps::assign(&disturbed(&slots), &slots, 1000.0).unwrap();
    assert!(is_matching(&taken, 200, 200));
}

#[test]
fn the_drone_that_is_first_at_the_mouth_of_a_bay_goes_deepest() {
    // The slots lie along a corridor whose mouth is at x = 0, and whose end is at x = 40 m. The drones wait in front of the mouth, one behind the other.
    let line = |xs: [f64; 4]| xs.map(|x| Vec2::new(x, 0.0)).to_vec();
    let (drones, slots) = (line([-5.0, -15.0, -25.0, -35.0]), line([10.0, 20.0, 30.0, 40.0]));
    let way_m = |from: Vec2, to: Vec2| to.x - from.x;
    assert_eq!(assign_along(Reformation::Optimal, &drones, &slots, way_m).unwrap(), [3, 2, 1, 0]);
    // As the crow flies, from beside the end of the corridor, the drones would take the slots that are nearest to them.
    let beside: Vec<Vec2> = slots.iter().map(|slot| slot + Vec2::new(0.0, 20.0)).collect();
    assert_eq!(assign(&beside, &slots).unwrap(), [0, 1, 2, 3]);
    let round_the_mouth_m = |from: Vec2, to: Vec2| (from.x + 20.0) + 20.0 + to.x;
    assert_eq!(assign_along(Reformation::Optimal, &beside, &slots, round_the_mouth_m).unwrap(), [3, 2, 1, 0]);
    assert_eq!(assign_along(Reformation::Identity, &beside, &slots, round_the_mouth_m).unwrap(), [0, 1, 2, 3]);
    assert!(assign_along(Reformation::Optimal, &beside, &slots[1..], round_the_mouth_m).is_err());
}
