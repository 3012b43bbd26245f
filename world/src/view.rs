//! The part of an outline that a drone has in view.

use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;

/// Two points nearer than this are one, m.
const SAME_M: f64 = 1e-6;

/// The convex hull of the part of an outline that faces `from` and is at most `range_m` away. A rounded corner is in view with its whole
/// rounding. Other obstacles hide nothing. World frame, m.
pub(crate) fn in_view(shape: &ConvexShape, from: Vec2, range_m: f64) -> ConvexShape {
    let corners: Vec<Vec2> = shape.vertices().collect();
    let count = corners.len();
    let edge = |i: usize| (corners[i % count], corners[(i + 1) % count]);
    let faces = |i: usize| {
        let (a, b) = edge(i);
        (b - a).perp(&(from - a)) < 0.0
    };
    // The first edge of the chain that faces the drone. Without one it is inside, or the outline is a disc.
    let Some(first) = (0..count).find(|&i| faces(i) && !faces(i + count - 1)) else { return *shape };
    let mut seen: Vec<Vec2> = Vec::new();
    for i in (first..first + count).take_while(|&i| faces(i)) {
        let (a, b) = edge(i);
        let Some((begin, end)) = within(a, b, from, range_m + shape.radius_m) else { continue };
        for share in [begin, end] {
            let point = a + (b - a) * share;
            if seen.last().is_none_or(|last| (point - last).norm() > SAME_M) {
                seen.push(point);
            }
        }
    }
    let part = ConvexShape::new(&seen, shape.radius_m);
    part.map_or(*shape, |part| ConvexShape { floor_m: shape.floor_m, top_m: shape.top_m, ..part })
}

/// The part of a segment within `range_m` of `from`, as shares of its length; `None` if there is none.
fn within(a: Vec2, b: Vec2, from: Vec2, range_m: f64) -> Option<(f64, f64)> {
    let (along, reach) = (b - a, from - a);
    let length2 = along.norm_squared();
    let middle = along.dot(&reach) / length2;
    let beside2 = (reach - along * middle).norm_squared();
    let half = ((range_m * range_m - beside2) / length2).max(0.0).sqrt();
    let (begin, end) = ((middle - half).max(0.0), (middle + half).min(1.0));
    (beside2 <= range_m * range_m && begin <= end).then_some((begin, end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Outline;
    use crate::testing::rectangle;
    use proptest::prelude::*;
    use skein_protocol::Vec3;

    fn corners(shape: &ConvexShape) -> Vec<[f64; 2]> {
        shape.vertices().map(|v| [v.x, v.y]).collect()
    }

    #[test]
    fn the_near_sides_are_seen_as_far_as_the_sensor_reaches() {
        let wall = rectangle(100.0, 0.0, 10.0, 50.0);
        assert_eq!(corners(&in_view(&wall, Vec2::zeros(), 200.0)), [[90.0, 50.0], [90.0, -50.0]]);
        let touched = corners(&in_view(&wall, Vec2::zeros(), 91.0));
        assert!((touched[0][1] - 181.0f64.sqrt()).abs() < 1e-9 && touched[1][1] == -touched[0][1], "{touched:?}");
        assert_eq!(in_view(&wall, Vec2::new(0.0, -100.0), 300.0).count, 3, "two sides");
        assert_eq!(in_view(&wall, Vec2::new(100.0, 0.0), 300.0), wall, "inside");
        let disc = ConvexShape::circle(Vec2::new(50.0, 0.0), 10.0).unwrap();
        assert_eq!(in_view(&disc, Vec2::zeros(), 45.0), disc);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        /// The point of an obstacle that is nearest to a set that is convex and contains the drone is in view.
        #[test]
        fn what_is_nearest_to_a_path_is_in_view(
            turn in 0.0f64..6.3, half in (1.0f64..40.0, 1.0f64..40.0), radius_m in 0.0f64..5.0,
            from in (-90.0f64..90.0, -90.0f64..90.0), to in (-90.0f64..90.0, -90.0f64..90.0),
        ) {
            let sharp = ConvexShape::rectangle(Vec2::zeros(), Vec2::new(half.0, half.1), turn).unwrap();
            let whole = ConvexShape { radius_m, ..sharp };
            let (from, to) = (Vec2::new(from.0, from.1), Vec2::new(to.0, to.1));
            let seen = in_view(&whole, from, 500.0);
            let least_m = |shape: &ConvexShape| {
                let outline = Outline::new(shape);
                let at = |k: u32| (from + (to - from) * (f64::from(k) / 400.0)).push(0.0);
                (0..=400).map(|k| outline.nearest(Vec3::from(at(k))).distance_m).fold(f64::INFINITY, f64::min)
            };
            let (all_m, seen_m) = (least_m(&whole), least_m(&seen));
            prop_assert!(seen_m >= all_m - 1e-9, "what is seen is a part");
            // A sampled path: its nearest sample may see its nearest point at an angle of up to half a sample.
            prop_assert!(all_m <= 0.0 || seen_m - all_m < 0.6, "{seen_m} m, {all_m} m");
        }
    }
}
