//! Convex polygons in the plane: hulls, inflation, distance. Vertices are counter-clockwise. One vertex is a point, two
//! are a segment.

use skein_protocol::Vec2;
use std::f64::consts::{FRAC_PI_2, PI};

/// Number of sides of the polygon that approximates a circle.
pub const CIRCLE_SIDES: usize = 32;

/// Flatter corners are left out. The measure is twice the area of the triangle that a corner cuts off, m².
const FLAT_M2: f64 = 1e-9;

/// The convex hull, counter-clockwise from its leftmost lowest vertex.
#[must_use]
pub fn hull(points: &[Vec2]) -> Vec<Vec2> {
    let sorted = sorted(points);
    let mut hull = half_hull(sorted.iter().copied());
    let upper = half_hull(sorted.iter().rev().copied());
    if sorted.len() > 1 {
        hull.pop();
        hull.extend(&upper[..upper.len() - 1]);
    }
    hull
}

/// The lower side of the points' hull, by strictly increasing x.
#[must_use]
pub fn lower_chain(points: &[Vec2]) -> Vec<Vec2> {
    let mut lowest = sorted(points);
    lowest.dedup_by(|next, kept| next.x == kept.x);
    half_hull(lowest.into_iter())
}

/// The upper side of the points' hull, by strictly increasing x.
#[must_use]
pub fn upper_chain(points: &[Vec2]) -> Vec<Vec2> {
    let flipped: Vec<Vec2> = points.iter().map(|p| Vec2::new(p.x, -p.y)).collect();
    lower_chain(&flipped).into_iter().map(|p| Vec2::new(p.x, -p.y)).collect()
}

/// All points within `radius_m` (m) of a polygon. Each corner is rounded by a circumscribed [`CIRCLE_SIDES`]-gon, so the
/// result is never too small. Sides that face along an axis are at the exact distance.
#[must_use]
pub fn inflate(polygon: &[Vec2], radius_m: f64) -> Vec<Vec2> {
    if radius_m <= 0.0 {
        return polygon.to_vec();
    }
    let step = 2.0 * PI / CIRCLE_SIDES as f64;
    let corner_m = radius_m / inscribed();
    let mut points = Vec::with_capacity(polygon.len() * CIRCLE_SIDES);
    // One quadrant, mirrored: a mirrored obstacle has an exactly mirrored outline.
    for angle in (0..CIRCLE_SIDES / 4).map(|k| FRAC_PI_2 - (k as f64 + 0.5) * step) {
        let (dy, dx) = (corner_m * angle.sin(), corner_m * angle.cos());
        for &p in polygon {
            points.extend([(dx, dy), (-dx, dy), (dx, -dy), (-dx, -dy)].map(|(x, y)| p + Vec2::new(x, y)));
        }
    }
    hull(&points)
}

/// Ratio of the inner radius to the outer radius of the polygon that approximates a circle.
#[must_use]
pub fn inscribed() -> f64 {
    (PI / CIRCLE_SIDES as f64).cos()
}

/// The shortest vector from polygon `a` to polygon `b`, m; zero if they touch or overlap.
#[must_use]
pub fn separation(a: &[Vec2], b: &[Vec2]) -> Vec2 {
    let differences: Vec<Vec2> = a.iter().flat_map(|p| b.iter().map(move |q| q - p)).collect();
    nearest(&hull(&differences), Vec2::zeros())
}

/// The point of a polygon nearest to `point`; `point` itself if it is inside.
#[must_use]
pub fn nearest(polygon: &[Vec2], point: Vec2) -> Vec2 {
    let n = polygon.len();
    let edges = || (0..n).map(|i| (polygon[i], polygon[(i + 1) % n]));
    if n >= 3 && edges().all(|(a, b)| (b - a).perp(&(point - a)) >= 0.0) {
        return point;
    }
    let on_edges = edges().map(|(a, b)| nearest_on_segment(a, b, point));
    on_edges.min_by(|p, q| (p - point).norm_squared().total_cmp(&(q - point).norm_squared())).unwrap_or(point)
}

fn nearest_on_segment(a: Vec2, b: Vec2, point: Vec2) -> Vec2 {
    let (edge, length2) = (b - a, (b - a).norm_squared());
    if length2 == 0.0 {
        return a;
    }
    a + edge * ((point - a).dot(&edge) / length2).clamp(0.0, 1.0)
}

/// The points by x, then y, without repetitions.
fn sorted(points: &[Vec2]) -> Vec<Vec2> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|p, q| p.x.total_cmp(&q.x).then(p.y.total_cmp(&q.y)));
    sorted.dedup();
    sorted
}

/// Keeps the points at which the path through them turns left.
fn half_hull(points: impl Iterator<Item = Vec2>) -> Vec<Vec2> {
    let mut kept: Vec<Vec2> = Vec::new();
    for point in points {
        while let [.., before, last] = kept[..]
            && is_left_out(before, last, point)
        {
            kept.pop();
        }
        kept.push(point);
    }
    kept
}

/// Whether the path through three points does not turn left at the middle one, or hardly. A point far from two that nearly coincide cuts
/// off little as well, but it is a corner.
fn is_left_out(before: Vec2, last: Vec2, next: Vec2) -> bool {
    let area_m2 = (last - before).perp(&(next - before));
    area_m2 <= 0.0 || (area_m2 <= FLAT_M2 && (last - before).dot(&(next - last)) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn square(x: f64, y: f64, half: f64) -> Vec<Vec2> {
        hull(&[(-half, -half), (half, half), (half, -half), (-half, half)].map(|(dx, dy)| Vec2::new(x + dx, y + dy)))
    }

    #[test]
    fn a_hull_has_no_inner_points_and_no_flat_corners() {
        let mut points = square(0.0, 0.0, 2.0);
        points.extend([Vec2::new(0.0, 0.0), Vec2::new(2.0, 0.5), Vec2::new(-2.0, -2.0)]);
        assert_eq!(hull(&points), square(0.0, 0.0, 2.0));
        assert_eq!(hull(&[Vec2::new(1.0, 1.0); 3]), vec![Vec2::new(1.0, 1.0)]);
        assert_eq!(hull(&[Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.0)]).len(), 2);
        assert!(hull(&[]).is_empty());
    }

    #[test]
    fn a_corner_beside_two_points_that_nearly_coincide_is_kept() {
        let (a, b) = (11.622_999_999_999_99, 11.622_999_999_999_998);
        let points = [Vec2::new(a, 6.0), Vec2::new(28.0, 6.0), Vec2::new(b, 6.0), Vec2::new(b, -22.0)];
        for mirror in [1.0, -1.0] {
            let hull = hull(&points.map(|p| Vec2::new(p.x, mirror * p.y)));
            let lowest = hull.iter().map(|p| mirror * p.y).fold(f64::INFINITY, f64::min);
            assert!(hull.len() == 3 && lowest == -22.0, "{hull:?}");
        }
    }

    #[test]
    fn the_chains_of_a_square_are_its_two_sides() {
        let hull = square(0.0, 0.0, 2.0);
        assert_eq!(lower_chain(&hull), vec![Vec2::new(-2.0, -2.0), Vec2::new(2.0, -2.0)]);
        assert_eq!(upper_chain(&hull), vec![Vec2::new(-2.0, 2.0), Vec2::new(2.0, 2.0)]);
    }

    #[test]
    fn inflation_is_exact_along_the_axes_and_never_too_small() {
        let disc = inflate(&[Vec2::new(5.0, 1.0)], 20.0);
        assert_eq!(disc.len(), CIRCLE_SIDES);
        let top = disc.iter().map(|p| p.y).fold(f64::MIN, f64::max);
        assert!((top - 21.0).abs() < 1e-9);
        let edge = |i: usize| (disc[i] + disc[(i + 1) % CIRCLE_SIDES]) / 2.0 - Vec2::new(5.0, 1.0);
        assert!((0..CIRCLE_SIDES).all(|i| (edge(i).norm() - 20.0).abs() < 1e-9));
    }

    #[test]
    fn crossed_bars_overlap_though_neither_has_a_corner_in_the_other() {
        let bar = |x: f64, y: f64| hull(&[Vec2::new(-x, -y), Vec2::new(x, -y), Vec2::new(x, y), Vec2::new(-x, y)]);
        assert_eq!(separation(&bar(9.0, 1.0), &bar(1.0, 9.0)), Vec2::zeros());
        assert_eq!(separation(&bar(1.0, 1.0), &[Vec2::new(4.0, 5.0)]), Vec2::new(3.0, 4.0));
    }

    fn point() -> impl Strategy<Value = Vec2> {
        (-50.0..50.0, -50.0..50.0).prop_map(|(x, y)| Vec2::new(x, y))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]
        #[test]
        fn separation_is_the_least_distance_of_sampled_points(
            a in prop::collection::vec(point(), 1..6), b in prop::collection::vec(point(), 1..6),
        ) {
            let (a, b) = (hull(&a), hull(&b));
            let gap_m = separation(&a, &b).norm();
            let edge = |hull: &[Vec2], i: usize, t: f64| hull[i] * (1.0 - t) + hull[(i + 1) % hull.len()] * t;
            for (i, j, t, u) in (0..a.len()).flat_map(|i| (0..b.len()).flat_map(move |j| {
                [(i, j, 0.0, 0.3), (i, j, 0.7, 0.0), (i, j, 0.5, 0.5)]
            })) {
                prop_assert!((edge(&a, i, t) - edge(&b, j, u)).norm() >= gap_m - 1e-9);
            }
        }
    }
}
