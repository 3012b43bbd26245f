//! Target shapes. Each shape gives the slots of a formation for any number of drones.
//!
//! Slots are in metres, relative to the front slot (the anchor): x along the flight direction, y to its left.

use crate::Vec2;
use crate::shape::ConvexShape;
use serde::{Deserialize, Serialize};

/// Maximum speed of a drone relative to its formation while the formation counts as held, m/s.
pub const HOLD_SPEED_MPS: f64 = 1.0;

/// Distance of slots from drones that hang dead, in safe distances. No unit. A drone keeps the safe distance with all margins, and stands within
/// the arrival error of its slot.
pub const SLOT_BERTH: f64 = 1.05;

/// A drone that hangs dead is within [`SLOT_BERTH`] of at most as many slots: they are at least a safe distance apart.
pub const MOST_BLOCKED: usize = 7;

/// A formation that leaves slots free beside dead drones may be larger by as many slots that lie beside obstacles. By hand.
pub const MOST_BESIDE_OBSTACLES: usize = 64;

/// What keeps slots at the goal free: drones that hang dead, and obstacles, beside which a larger formation would have slots. All places are in
/// one frame, m.
#[derive(Clone, Copy, Debug)]
pub struct GoalGround<'a> {
    /// Where drones hang dead, m.
    pub dead: &'a [Vec2],
    /// The obstacles.
    pub obstacles: &'a [ConvexShape],
    /// Least distance between two bodies, m.
    pub safe_distance_m: f64,
    /// Least distance of a body to an obstacle, m.
    pub clearance_m: f64,
}

impl GoalGround<'_> {
    /// Whether a slot at this place is at least [`SLOT_BERTH`] safe distances away from dead drones, and `dead_margin_m` more, and the
    /// clearance away from obstacles, and `obstacle_margin_m` more.
    #[must_use]
    pub fn is_free(&self, place: Vec2, dead_margin_m: f64, obstacle_margin_m: f64) -> bool {
        let keep_m = SLOT_BERTH * self.safe_distance_m + dead_margin_m;
        let clear_m = self.clearance_m + obstacle_margin_m - ROUNDING_M;
        self.dead.iter().all(|dead| (place - dead).norm() >= keep_m)
            && self.obstacles.iter().all(|obstacle| obstacle.distance_m(place) >= clear_m)
    }

    /// The most slots of a formation at the goal in which `count` drones stand.
    #[must_use]
    pub fn most_slots(&self, count: usize) -> usize {
        let beside = if self.dead.is_empty() || self.obstacles.is_empty() { 0 } else { MOST_BESIDE_OBSTACLES };
        count + MOST_BLOCKED * self.dead.len() + beside
    }
}

/// Distances that differ by less than this are equal, m.
const ROUNDING_M: f64 = 1e-6;

/// The shape of a formation. It has slots for any number of drones, except for [`Shape::Offsets`]. `spacing_m` below is the
/// argument of [`Shape::slots`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// The paper's formation: chevrons of five drones, one at the tip and two on each arm. Each chevron is
    /// `2 · spacing_m / √2` behind the one before.
    NestedV,
    /// One chevron with an angle of 90° at its tip.
    V,
    /// All drones side by side, perpendicular to the flight direction.
    Line,
    /// All drones one behind the other.
    Column,
    /// A square grid: about as many rows as there are drones in a row.
    Grid,
    /// A circle with `spacing_m` between neighbours. A single drone is at the anchor.
    Circle,
    /// A filled triangle with its tip in front: rows of 1, 2, 3, … drones with `spacing_m` between all neighbours. Each row is
    /// filled from its middle outwards.
    Wedge,
    /// An explicit list of slots: offsets from the anchor, m. The spacing has no effect.
    Offsets(Vec<[f64; 2]>),
}

impl Shape {
    /// The slots of `count` drones with the spacing `spacing_m` (m), front slot first: offsets from the anchor, m.
    /// [`Shape::Offsets`] gives its first `count` entries, or fewer if it has fewer.
    #[must_use]
    pub fn slots(&self, count: usize, spacing_m: f64) -> Vec<Vec2> {
        let step = spacing_m * std::f64::consts::FRAC_1_SQRT_2;
        match self {
            Self::NestedV => {
                (0..count).map(|i| chevron_slot(i % 5, step) - Vec2::new(2.0 * step, 0.0) * (i / 5) as f64).collect()
            }
            Self::V => (0..count).map(|i| chevron_slot(i, step)).collect(),
            Self::Line => (0..count).map(|i| Vec2::new(0.0, side(i) * spacing_m)).collect(),
            Self::Column => (0..count).map(|i| Vec2::new(0.0 - i as f64 * spacing_m, 0.0)).collect(),
            Self::Grid => {
                let width = (count as f64).sqrt().ceil().max(1.0) as usize;
                (0..count).map(|i| Vec2::new(0.0 - (i / width) as f64, side(i % width)) * spacing_m).collect()
            }
            Self::Circle => circle(count, spacing_m),
            Self::Wedge => wedge(count, spacing_m),
            Self::Offsets(offsets) => offsets.iter().take(count).map(|&o| Vec2::from(o)).collect(),
        }
    }

    /// The slots of `count` drones at the goal: the first free slots of the smallest formation that has enough of them; [`Self::slots`] if none
    /// has, or if no drone hangs dead. `place` gives the place of a slot, in the frame of `ground`, m.
    #[must_use]
    pub fn free_slots(
        &self,
        count: usize,
        spacing_m: f64,
        ground: &GoalGround<'_>,
        place: impl Fn(Vec2) -> Vec2,
    ) -> Vec<Vec2> {
        let is_free = |slot: &Vec2| ground.is_free(place(*slot), 0.0, 0.0);
        let free = |size| self.slots(size, spacing_m).into_iter().filter(is_free).take(count).collect::<Vec<_>>();
        let mut sizes = (count..=ground.most_slots(count)).filter(|_| !ground.dead.is_empty());
        sizes
            .find_map(|size| Some(free(size)).filter(|free| free.len() == count))
            .unwrap_or_else(|| self.slots(count, spacing_m))
    }
}

/// Slot number `i` of a chevron: the tip first, then left and right in turn along the arms.
fn chevron_slot(i: usize, step: f64) -> Vec2 {
    let along = i.div_ceil(2) as f64;
    Vec2::new(0.0 - along, side(i)) * step
}

/// Lateral place number `i`, in steps, left positive: 0, 1, −1, 2, −2, …
fn side(i: usize) -> f64 {
    let distance = i.div_ceil(2) as f64;
    if i % 2 == 1 { distance } else { 0.0 - distance }
}

fn circle(count: usize, spacing_m: f64) -> Vec<Vec2> {
    if count < 2 {
        return vec![Vec2::zeros(); count];
    }
    let step = std::f64::consts::TAU / count as f64;
    let radius = spacing_m / (2.0 * (step / 2.0).sin());
    (0..count).map(|i| Vec2::new((step * i as f64).cos() - 1.0, (step * i as f64).sin()) * radius).collect()
}

fn wedge(count: usize, spacing_m: f64) -> Vec<Vec2> {
    let depth = 3.0f64.sqrt() / 2.0;
    let row = |row: usize| {
        // A row with an even number of slots has no slot on the axis, so it is shifted by half a step.
        let half = if row % 2 == 1 { 0.5 } else { 0.0 };
        (0..=row).map(move |i| Vec2::new(0.0 - depth * row as f64, side(i) - half) * spacing_m)
    };
    (0..).flat_map(row).take(count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_v_of_eight_matches_the_paper() {
        let c = 35.0 / 2.0f64.sqrt();
        let expected =
            [(0.0, 0.0), (-1.0, 1.0), (-1.0, -1.0), (-2.0, 2.0), (-2.0, -2.0), (-2.0, 0.0), (-3.0, 1.0), (-3.0, -1.0)];
        for (slot, (x, y)) in Shape::NestedV.slots(8, 35.0).iter().zip(expected) {
            assert!((slot - Vec2::new(x * c, y * c)).norm() < 1e-9, "{slot} should be ({x}, {y})·c");
        }
    }

    #[test]
    fn a_wedge_of_six_has_rows_of_one_two_and_three() {
        let depth = 75.0f64.sqrt();
        let expected = [(0.0, 0.0), (-1.0, -5.0), (-1.0, 5.0), (-2.0, 0.0), (-2.0, 10.0), (-2.0, -10.0)];
        for (slot, (row, y)) in Shape::Wedge.slots(6, 10.0).iter().zip(expected) {
            assert!((slot - Vec2::new(row * depth, y)).norm() < 1e-9, "{slot} should be in row {row} at y = {y} m");
        }
    }

    /// The abscissas of `count` slots with the front slot at (500, 30), 20 m apart. A drone hangs dead at this place relative to that one, m.
    fn free_xs(shape: &Shape, count: usize, dead: (f64, f64), obstacles: &[ConvexShape]) -> Vec<f64> {
        let front = Vec2::new(500.0, 30.0);
        let dead = [front + Vec2::new(dead.0, dead.1)];
        let ground = GoalGround { dead: &dead, obstacles, safe_distance_m: 12.0 / SLOT_BERTH, clearance_m: 5.0 };
        shape.free_slots(count, 20.0, &ground, |slot| front + slot).iter().map(|slot| slot.x).collect()
    }

    #[test]
    fn a_slot_beside_a_dead_drone_is_left_free() {
        let xs = |shape: &Shape, count, x: f64, y: f64| free_xs(shape, count, (x, y), &[]);
        assert_eq!(xs(&Shape::Column, 4, -20.0, 13.0), [0.0, -20.0, -40.0, -60.0]);
        assert_eq!(xs(&Shape::Column, 4, -30.0, 0.0), [0.0, -60.0, -80.0, -100.0]);
        assert_eq!(xs(&Shape::Column, 4, 0.0, 5.0), [-20.0, -40.0, -60.0, -80.0]);
        let two = Shape::Offsets(vec![[0.0, 0.0], [-20.0, 0.0]]);
        assert_eq!(xs(&two, 2, 0.0, 0.0), [0.0, -20.0], "it has no third slot");
    }

    #[test]
    fn no_slot_is_added_beside_an_obstacle() {
        let behind = |radius_m| ConvexShape::circle(Vec2::new(420.0, 30.0), radius_m).unwrap();
        let xs = |dead, radius_m| free_xs(&Shape::Column, 4, dead, &[behind(radius_m)]);
        assert_eq!(xs((-20.0, 13.0), 10.0), [0.0, -20.0, -40.0, -60.0], "nothing blocks a slot");
        assert_eq!(xs((-20.0, 11.0), 10.0), [0.0, -40.0, -60.0, -100.0]);
        assert_eq!(xs((-20.0, 11.0), 15.1), [0.0, -40.0, -120.0, -140.0]);
    }

    #[test]
    fn slots_keep_the_spacing_and_the_front_slot_is_first() {
        for shape in [Shape::NestedV, Shape::V, Shape::Line, Shape::Column, Shape::Grid, Shape::Circle, Shape::Wedge] {
            for count in [1, 2, 5, 8, 13, 40] {
                let slots = shape.slots(count, 10.0);
                assert_eq!(slots.len(), count);
                assert!(
                    slots.iter().all(|s| s.x <= slots[0].x + 1e-9),
                    "{shape:?} of {count}: the first slot is not in front"
                );
                for (i, a) in slots.iter().enumerate() {
                    assert!(
                        slots[..i].iter().all(|b| (a - b).norm() > 9.99),
                        "{shape:?} of {count}: slot {i} is too close to another"
                    );
                }
            }
        }
    }
}
