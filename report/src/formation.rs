//! How far the living drones are from the target shape, after the best translation and assignment.

use crate::facts::{MissionEnd, RunFacts};
use crate::tuning::{SOLVE_ALWAYS_DRONES_MAX, SOLVE_PERIOD_S};
use skein_protocol::Vec2;
use skein_protocol::formation::GoalGround;
use skein_protocol::matching::least_cost;

/// The error of a formation after the best translation and assignment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FormationError {
    /// Distance to its slot of the drone farthest from it, m.
    pub largest_m: f64,
    /// Root of the mean squared distance, m.
    pub rmse_m: f64,
    /// Absolute difference between the mean distance of the drones and that of the slots, m; `None` for fewer than two
    /// drones.
    pub mean_distance_m: Option<f64>,
    /// The slot of each drone, by index.
    pub slot_of: Vec<usize>,
}

/// The error of drones at these positions, m, while others hang dead at the places `dead`, m. `None` without drones, or if the shape has too
/// few slots.
pub(crate) fn error(facts: &RunFacts, positions: &[Vec2], dead: &[Vec2]) -> Option<FormationError> {
    let slots = slots(facts, positions.len(), dead)?;
    let positions = centred(positions.to_vec());
    let slot_of = assign(&positions, &slots);
    let offsets = offsets(&positions, &slots, &slot_of);
    let mean_distance_m = (positions.len() > 1).then(|| (mean_distance(&positions) - mean_distance(&slots)).abs());
    Some(FormationError {
        largest_m: offsets.iter().copied().fold(0.0, f64::max),
        rmse_m: (offsets.iter().map(|m| m * m).sum::<f64>() / offsets.len() as f64).sqrt(),
        mean_distance_m,
        slot_of,
    })
}

/// The slots of `count` drones relative to their mean, m. The best translation in the least-squares sense maps the mean
/// of the drones to the mean of the slots, whatever the assignment. `dead`: where others hang dead, m.
pub(crate) fn slots(facts: &RunFacts, count: usize, dead: &[Vec2]) -> Option<Vec<Vec2>> {
    let slots = around_dead(facts, count, dead);
    (count > 0 && slots.len() == count).then(|| centred(slots))
}

/// The slots of `count` drones relative to the front slot, axes of the world frame, m. At the goal, slots beside which drones hang dead at the places `dead`, m, stay
/// free, and then no slot is added beside an obstacle.
pub(crate) fn around_dead(facts: &RunFacts, count: usize, dead: &[Vec2]) -> Vec<Vec2> {
    let course = facts.course;
    let slots = if let MissionEnd::Goal { front_m } = facts.end {
        let (obstacles, safe_distance_m, clearance_m) = (&facts.obstacles, facts.safe_distance_m, facts.clearance_m);
        let ground = GoalGround { dead, obstacles, safe_distance_m, clearance_m };
        let place = |slot| Vec2::from(front_m) + course.to_world(slot);
        facts.shape.free_slots(count, facts.spacing_m, &ground, place)
    } else {
        facts.shape.slots(count, facts.spacing_m)
    };
    slots.into_iter().map(|slot| course.to_world(slot)).collect()
}

/// The points relative to their mean.
pub(crate) fn centred(mut points: Vec<Vec2>) -> Vec<Vec2> {
    let mean = points.iter().sum::<Vec2>() / points.len() as f64;
    for point in &mut points {
        *point -= mean;
    }
    points
}

fn offsets(positions: &[Vec2], slots: &[Vec2], slot_of: &[usize]) -> Vec<f64> {
    positions.iter().zip(slot_of).map(|(position, &slot)| (position - slots[slot]).norm()).collect()
}

/// Mean distance over all pairs; 0 for fewer than two points.
pub(crate) fn mean_distance(points: &[Vec2]) -> f64 {
    let pairs = points.len() * points.len().saturating_sub(1) / 2;
    let sum: f64 = points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(move |b| (a - b).norm())).sum();
    sum / pairs.max(1) as f64
}

/// Finds the time from which the formation stayed closed.
#[derive(Default)]
pub(crate) struct Closing {
    since_s: Option<f64>,
    /// Where drones hang dead, m.
    dead: Vec<Vec2>,
    /// Slots of the living drones, relative to their mean, m.
    slots: Vec<Vec2>,
    /// The last assignment.
    slot_of: Vec<usize>,
    /// When it was solved, s.
    solved_s: Option<f64>,
}

impl Closing {
    /// Start of the current period in which the formation is closed, s; `None` if it is open.
    pub(crate) fn since_s(&self) -> Option<f64> {
        self.since_s
    }

    /// Notes that the formation is open.
    pub(crate) fn reopen(&mut self) {
        self.since_s = None;
    }

    /// Takes the positions of the living drones in a tick in which all of them reform, and the places where others hang dead, m.
    pub(crate) fn take(&mut self, facts: &RunFacts, t_s: f64, positions: &[Vec2], dead: &[Vec2]) {
        if self.dead != dead {
            self.dead = dead.to_vec();
            self.slots.clear();
        }
        if self.closed(facts, t_s, positions) {
            self.since_s.get_or_insert(t_s);
        } else {
            self.reopen();
        }
    }

    /// Whether each drone is close enough to its slot. Tries the last assignment before it solves a new one.
    fn closed(&mut self, facts: &RunFacts, t_s: f64, positions: &[Vec2]) -> bool {
        if self.slots.len() != positions.len() {
            self.slots = slots(facts, positions.len(), &self.dead).unwrap_or_default();
            (self.slot_of, self.solved_s) = (Vec::new(), None);
        }
        if self.slots.is_empty() {
            return false;
        }
        let positions = centred(positions.to_vec());
        let fits = |slots: &[Vec2], slot_of: &[usize]| {
            offsets(&positions, slots, slot_of).iter().all(|&offset| offset <= facts.arrival_error_m)
        };
        if self.solved_s.is_some() && fits(&self.slots, &self.slot_of) {
            return true;
        }
        let due = self.solved_s.is_none_or(|solved_s| t_s - solved_s >= SOLVE_PERIOD_S);
        if positions.len() > SOLVE_ALWAYS_DRONES_MAX && !due {
            return false;
        }
        self.slot_of = assign(&positions, &self.slots);
        self.solved_s = Some(t_s);
        fits(&self.slots, &self.slot_of)
    }
}

/// The slot of each drone, by least total squared distance. At least as many slots as drones.
fn assign(positions: &[Vec2], slots: &[Vec2]) -> Vec<usize> {
    least_cost(positions.len(), slots.len(), |drone, slot| (positions[drone] - slots[slot]).norm_squared())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;

    /// The slots, translated and permuted, with drone `i` displaced by `off(i)`.
    fn near_slots(count: usize, off: impl Fn(usize) -> Vec2) -> Vec<Vec2> {
        let slots = facts(8).shape.slots(count, 35.0);
        (0..count).map(|i| slots[(i * 3 + 1) % count] + Vec2::new(900.0, -40.0) + off(i)).collect()
    }

    #[test]
    fn a_moved_and_permuted_formation_has_no_error() {
        let error = error(&facts(8), &near_slots(8, |_| Vec2::zeros()), &[]).unwrap();
        assert!(error.largest_m < 1e-9 && error.rmse_m < 1e-9 && error.mean_distance_m.unwrap() < 1e-9, "{error:?}");
    }

    #[test]
    fn one_displaced_drone_moves_the_mean_too() {
        let error = error(&facts(8), &near_slots(8, |i| Vec2::new(if i == 2 { 8.0 } else { 0.0 }, 0.0)), &[]).unwrap();
        assert!((error.largest_m - 7.0).abs() < 1e-9, "{error:?}");
        assert!((error.rmse_m - (56.0f64 / 8.0).sqrt()).abs() < 1e-9, "{error:?}");
    }

    #[test]
    fn the_error_is_defined_for_any_number_of_living_drones() {
        assert!(error(&facts(8), &[], &[]).is_none());
        let alone = error(&facts(8), &[Vec2::new(3.0, 3.0)], &[]).unwrap();
        assert_eq!((alone.largest_m, alone.mean_distance_m), (0.0, None));
        let pair = error(&facts(8), &[Vec2::zeros(), Vec2::new(0.0, 36.0)], &[]).unwrap();
        assert!((pair.mean_distance_m.unwrap() - 1.0).abs() < 1e-9, "{pair:?}");
        let offsets = skein_protocol::formation::Shape::Offsets(vec![[0.0, 0.0]]);
        assert!(error(&RunFacts { shape: offsets, ..facts(8) }, &[Vec2::zeros(); 2], &[]).is_none());
    }

    #[test]
    fn a_slot_at_the_goal_beside_a_dead_drone_is_no_error() {
        let front = Vec2::new(900.0, -40.0);
        let facts = RunFacts { end: MissionEnd::Goal { front_m: front.into() }, ..facts(8) };
        let mut places: Vec<Vec2> = facts.shape.slots(8, 35.0).into_iter().map(|slot| slot + front).collect();
        let dead = places.remove(3);
        assert!(error(&facts, &places, &[dead]).unwrap().largest_m < 1e-9);
        assert!(error(&facts, &places, &[]).unwrap().largest_m > 1.0);
        let mut closing = Closing::default();
        closing.take(&facts, 1.0, &places, &[dead]);
        assert_eq!(closing.since_s(), Some(1.0));
        closing.take(&facts, 2.0, &places, &[]);
        assert_eq!(closing.since_s(), None, "it has landed, and a drone can take its slot");
    }

    #[test]
    fn closing_starts_again_after_the_formation_was_open() {
        for count in [8, 80] {
            let facts = facts(count as u32);
            let mut closing = Closing::default();
            let wide = |i: usize| Vec2::new(if i == 0 { 3.0 } else { 0.0 }, 0.0);
            closing.take(&facts, 1.0, &near_slots(count, |_| Vec2::zeros()), &[]);
            assert_eq!(closing.since_s(), Some(1.0));
            closing.take(&facts, 2.0, &near_slots(count, wide), &[]);
            assert_eq!(closing.since_s(), None);
            closing.take(&facts, 3.0, &near_slots(count, |_| Vec2::zeros()), &[]);
            closing.take(&facts, 4.0, &near_slots(count, |_| Vec2::zeros()), &[]);
            assert_eq!(closing.since_s(), Some(3.0));
        }
    }
}
