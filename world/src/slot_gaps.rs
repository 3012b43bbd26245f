//! How far drones are from the slots that are left for them, when a mission is judged that did not reach its goal.

use crate::goal_slots;
use crate::params::{End, WorldParams};
use crate::tuning::FIT_MAX_DRONES;
use skein_protocol::Vec2;
use skein_protocol::formation::GoalGround;
use skein_protocol::matching::least_cost;

/// For each of the drones at these places, its distance from the slot that is left for it, m. A drone in a slot that no other one takes
/// has that slot; the others share the slots that are left so that the sum of their distances is least. `None` if the goal has no
/// slots, or too few. `ground`: what keeps slots at the goal free. World frame, m.
pub(crate) fn slot_gaps(params: &WorldParams, places: &[Vec2], ground: &GoalGround<'_>) -> Option<Vec<f64>> {
    let slots = goal_slots::slots(params, places.len(), ground);
    if slots.len() < places.len() || places.is_empty() {
        return None;
    }
    match params.end {
        End::Goal { front_m } => Some(gaps(places, &slots, front_m, params.arrival_error_m)),
        End::Hold { .. } => Some(gaps(places, &slots, anchor(places, &slots), params.arrival_error_m)),
        End::Time { .. } | End::Pilots => None,
    }
}

fn gaps(places: &[Vec2], slots: &[Vec2], anchor: Vec2, error_m: f64) -> Vec<f64> {
    let gap = |drone: usize, slot: usize| (places[drone] - anchor - slots[slot]).norm();
    let mut free: Vec<usize> = (0..slots.len()).collect();
    let mut gap_of = vec![0.0; places.len()];
    let mut rest = Vec::new();
    for (drone, own) in gap_of.iter_mut().enumerate() {
        match free.iter().position(|&slot| gap(drone, slot) <= error_m) {
            Some(place) => *own = gap(drone, free.swap_remove(place)),
            None => rest.push(drone),
        }
    }
    free.sort_unstable();
    let slot_of = least_cost(rest.len(), free.len(), |row, column| gap(rest[row], free[column]));
    for (&drone, slot) in rest.iter().zip(slot_of) {
        gap_of[drone] = gap(drone, free[slot]);
    }
    gap_of
}

/// Where the front slot of the formation is in which most drones are. A median does not follow the few that are elsewhere, as a mean
/// does.
fn anchor(places: &[Vec2], slots: &[Vec2]) -> Vec2 {
    let mut anchor = median(places.iter().copied()) - median(slots.iter().copied());
    if places.len() > FIT_MAX_DRONES {
        return anchor;
    }
    for _ in 0..3 {
        let slot_of =
            least_cost(places.len(), slots.len(), |drone, slot| (places[drone] - anchor - slots[slot]).norm());
        anchor = median(places.iter().zip(slot_of).map(|(place, slot)| place - slots[slot]));
    }
    anchor
}

/// The median of each coordinate.
fn median(points: impl Iterator<Item = Vec2> + Clone) -> Vec2 {
    let middle = |coordinate: fn(Vec2) -> f64| {
        let mut all: Vec<f64> = points.clone().map(coordinate).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or_default()
    };
    Vec2::new(middle(|point| point.x), middle(|point| point.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::params;

    /// Eight drones in their slots, the front one here, m; the last one 60 m to the left of its slot.
    fn one_away(front: Vec2) -> Vec<Vec2> {
        let mut places: Vec<Vec2> = params().shape.slots(8, 35.0).into_iter().map(|slot| slot + front).collect();
        places[7].y += 60.0;
        places
    }

    fn rounded(end: End) -> Option<Vec<f64>> {
        let params = WorldParams { end, ..params() };
        let gaps = slot_gaps(&params, &one_away(Vec2::new(500.0, 20.0)), &goal_slots::ground(&params, &[], &[]));
        gaps.map(|gaps| gaps.into_iter().map(f64::round).collect())
    }

    #[test]
    fn one_drone_is_far_from_its_slot_wherever_the_formation_is() {
        let mut wanted = vec![0.0; 8];
        wanted[7] = 60.0;
        assert_eq!(rounded(End::Hold { stop_x_m: 0.0 }), Some(wanted.clone()));
        assert_eq!(rounded(End::Goal { front_m: Vec2::new(500.0, 20.0) }), Some(wanted));
        assert_eq!(rounded(End::Pilots), None);
    }

    #[test]
    fn two_drones_in_one_slot_do_not_both_have_it() {
        let mut places = one_away(Vec2::zeros());
        places[7] = places[0];
        let params = WorldParams { end: End::Goal { front_m: Vec2::zeros() }, ..params() };
        let gaps = slot_gaps(&params, &places, &goal_slots::ground(&params, &[], &[])).unwrap();
        assert_eq!(gaps.iter().filter(|&&gap| gap > 1.0).count(), 1, "{gaps:?}");
    }
}
