//! Distance to an obstacle. No other module uses parry.

use parry2d_f64::math::Vector;
use parry2d_f64::query::PointQuery;
use parry2d_f64::shape::Segment;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Vec2, Vec3};

/// An obstacle's outline, prepared for distance queries.
#[derive(Clone, Debug)]
pub(crate) struct Outline {
    /// Edges of the core polygon, counter-clockwise. A core of one vertex has a single edge of length 0.
    edges: Vec<Segment>,
    radius_m: f64,
    low: Vec2,
    high: Vec2,
    floor_m: f64,
    top_m: f64,
}

/// The point of an obstacle's surface nearest to a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// World frame, m.
    pub(crate) point: Vec3,
    /// Distance to the surface, m; negative if the query point is inside.
    pub(crate) distance_m: f64,
}

impl Outline {
    /// Prepares a shape that [`ConvexShape::check`] has accepted.
    pub(crate) fn new(shape: &ConvexShape) -> Self {
        let corners: Vec<Vector> = shape.vertices().map(|v| Vector::new(v.x, v.y)).collect();
        let count = corners.len();
        let edges = if count > 2 { count } else { 1 };
        let (low, high) = shape.bounds();
        Self {
            edges: (0..edges).map(|i| Segment::new(corners[i], corners[(i + 1) % count])).collect(),
            radius_m: shape.radius_m,
            low,
            high,
            floor_m: shape.floor_m,
            top_m: shape.top_m,
        }
    }

    /// The corner of the bounding box with the least coordinates, m.
    pub(crate) fn low(&self) -> Vec2 {
        self.low
    }

    /// The corner of the bounding box with the greatest coordinates, m.
    pub(crate) fn high(&self) -> Vec2 {
        self.high
    }

    /// Square of the distance to the bounding box, m². The distance to the obstacle itself is never shorter.
    pub(crate) fn box_distance_squared(&self, point: Vec3) -> f64 {
        let (place, gap) = (point.xy(), self.gap_m(point.z).max(0.0));
        (place - place.sup(&self.low).inf(&self.high)).norm_squared() + gap * gap
    }

    /// The nearest point of the surface, exact up to rounding.
    pub(crate) fn nearest(&self, point: Vec3) -> Nearest {
        let (place, beside_m) = self.nearest_on_outline(point.xy());
        let gap_m = self.gap_m(point.z);
        if beside_m <= 0.0 && gap_m > beside_m {
            return Nearest { point: Vec3::new(point.x, point.y, self.face_m(point.z)), distance_m: gap_m };
        }
        if gap_m <= 0.0 {
            return Nearest { point: Vec3::new(place.x, place.y, point.z), distance_m: beside_m };
        }
        Nearest {
            point: Vec3::new(place.x, place.y, self.face_m(point.z)),
            distance_m: (beside_m * beside_m + gap_m * gap_m).sqrt(),
        }
    }

    /// Whether the obstacle is in the way of a straight look from one point to the other.
    pub(crate) fn hides(&self, from: Vec3, to: Vec3) -> bool {
        let (low_m, high_m) = (from.z.min(to.z), from.z.max(to.z));
        if high_m <= self.floor_m || low_m >= self.top_m {
            return false;
        }
        let ends = [from.xy(), to.xy()];
        let box_apart = ends[0].sup(&ends[1]).x < self.low.x
            || ends[0].inf(&ends[1]).x > self.high.x
            || ends[0].sup(&ends[1]).y < self.low.y
            || ends[0].inf(&ends[1]).y > self.high.y;
        !box_apart && (ends.iter().any(|end| self.nearest_on_outline(*end).1 <= 0.0) || self.crosses(ends))
    }

    /// Whether a segment comes within the rounding radius of an edge.
    fn crosses(&self, ends: [Vec2; 2]) -> bool {
        let look = Segment::new(Vector::new(ends[0].x, ends[0].y), Vector::new(ends[1].x, ends[1].y));
        self.edges.iter().any(|edge| {
            let (a, b) = (look.b - look.a, edge.b - edge.a);
            let (turn, reach) = (a.perp_dot(b), edge.a - look.a);
            let (t, u) = (reach.perp_dot(b) / turn, reach.perp_dot(a) / turn);
            let meets = turn != 0.0 && (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u);
            let near = |segment: &Segment, point: Vector| {
                let foot = segment.project_local_point(point, true).point;
                (point - foot).length_squared() <= self.radius_m * self.radius_m
            };
            meets || near(&look, edge.a) || near(&look, edge.b) || near(edge, look.a) || near(edge, look.b)
        })
    }

    /// The altitudes of its floor and its top, m.
    pub(crate) fn heights_m(&self) -> (f64, f64) {
        (self.floor_m, self.top_m)
    }

    /// How far an altitude is above the top or below the floor, m; negative between them.
    fn gap_m(&self, altitude_m: f64) -> f64 {
        (self.floor_m - altitude_m).max(altitude_m - self.top_m)
    }

    /// The altitude of the floor or of the top, whichever is nearer, m.
    fn face_m(&self, altitude_m: f64) -> f64 {
        if self.floor_m - altitude_m > altitude_m - self.top_m { self.floor_m } else { self.top_m }
    }

    /// The nearest point of the outline in the plane, and the distance to it, m; negative inside.
    fn nearest_on_outline(&self, point: Vec2) -> (Vec2, f64) {
        let query = Vector::new(point.x, point.y);
        let (mut best, mut inside) = ((f64::INFINITY, Vec2::zeros(), Vec2::zeros()), self.edges.len() > 2);
        for edge in &self.edges {
            let along = edge.b - edge.a;
            inside &= along.perp_dot(query - edge.a) >= 0.0;
            let foot = edge.project_local_point(query, true).point;
            let square = (query - foot).length_squared();
            if square < best.0 {
                best = (square, Vec2::new(foot.x, foot.y), Vec2::new(along.y, -along.x));
            }
        }
        let (square, foot, normal) = best;
        let distance = square.sqrt();
        let side = if inside { -1.0 } else { 1.0 };
        let outward = if distance > 0.0 { (point - foot) * (side / distance) } else { face(normal) };
        (foot + outward * self.radius_m, side * distance - self.radius_m)
    }
}

/// The outward direction at a point of the core itself: the normal of its edge. A core of one vertex has no normal, so it
/// faces the drones that fly towards it (−x).
fn face(normal: Vec2) -> Vec2 {
    normal.try_normalize(0.0).unwrap_or(Vec2::new(-1.0, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::rectangle;
    use proptest::prelude::*;

    #[test]
    fn an_obstacle_hides_what_is_behind_it() {
        let at = |x: f64, y: f64| Vec3::new(x, y, 50.0);
        let wall = Outline::new(&rectangle(50.0, 0.0, 5.0, 20.0));
        assert!(wall.hides(at(0.0, 0.0), at(100.0, 0.0)) && wall.hides(at(0.0, 30.0), at(100.0, -30.0)));
        assert!(!wall.hides(at(0.0, 0.0), at(40.0, 0.0)) && !wall.hides(at(0.0, 21.0), at(100.0, 21.0)));
        assert!(!wall.hides(at(0.0, 21.0), at(46.0, 21.0)) && wall.hides(at(0.0, 0.0), at(48.0, 0.0)));
        let disc = Outline::new(&ConvexShape::circle(Vec2::new(50.0, 0.0), 10.0).unwrap());
        assert!(disc.hides(at(0.0, 9.0), at(100.0, 9.0)) && !disc.hides(at(0.0, 11.0), at(100.0, 11.0)));
        let low = Outline::new(&rectangle(50.0, 0.0, 5.0, 20.0).between(0.0, 40.0).unwrap());
        assert!(!low.hides(at(0.0, 0.0), at(100.0, 0.0)), "they look over it");
    }

    fn nearest(shape: &ConvexShape, x: f64, y: f64) -> (Vec2, f64) {
        Outline::new(shape).nearest_on_outline(Vec2::new(x, y))
    }

    fn rounded_square() -> ConvexShape {
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]].map(Vec2::from);
        ConvexShape::new(&corners, 1.0).unwrap()
    }

    #[test]
    fn the_distance_is_negative_inside_a_rectangle() {
        let shape = rectangle(0.0, 0.0, 10.0, 75.0);
        assert_eq!(nearest(&shape, -30.0, 5.0), (Vec2::new(-10.0, 5.0), 20.0));
        assert_eq!(nearest(&shape, 8.0, 5.0), (Vec2::new(10.0, 5.0), -2.0));
        assert_eq!(nearest(&shape, 13.0, 79.0), (Vec2::new(10.0, 75.0), 5.0));
        assert_eq!(nearest(&shape, 10.0, 0.0).1, 0.0);
    }

    #[test]
    fn the_radius_grows_the_shape_on_every_side() {
        assert_eq!(nearest(&rounded_square(), 5.0, 1.0), (Vec2::new(3.0, 1.0), 2.0));
        assert_eq!(nearest(&rounded_square(), 2.5, 1.0), (Vec2::new(3.0, 1.0), -0.5));
        assert_eq!(nearest(&rounded_square(), 1.5, 1.0), (Vec2::new(3.0, 1.0), -1.5));
        assert_eq!(nearest(&rounded_square(), 2.0, 1.0), (Vec2::new(3.0, 1.0), -1.0));
    }

    #[test]
    fn discs_and_capsules_have_distances() {
        let disc = ConvexShape::circle(Vec2::new(3.0, 4.0), 2.0).unwrap();
        assert_eq!(nearest(&disc, 0.0, 0.0).1, 3.0);
        assert_eq!(nearest(&disc, 3.0, 4.0), (Vec2::new(1.0, 4.0), -2.0));
        let capsule = ConvexShape::new(&[Vec2::zeros(), Vec2::new(10.0, 0.0)], 1.0).unwrap();
        assert_eq!(nearest(&capsule, 5.0, -3.0), (Vec2::new(5.0, -1.0), 2.0));
        assert_eq!(nearest(&capsule, 5.0, 0.0).1, -1.0);
        assert_eq!(nearest(&capsule, 13.0, 4.0).1, 4.0);
    }

    /// Points of the surface at close intervals: along the edges, moved outward, and around the corners.
    fn surface(shape: &ConvexShape) -> Vec<Vec2> {
        let corners: Vec<Vec2> = shape.vertices().collect();
        let mut points = Vec::new();
        for (i, &a) in corners.iter().enumerate() {
            let along = corners[(i + 1) % corners.len()] - a;
            let out = Vec2::new(along.y, -along.x).normalize() * shape.radius_m;
            points.extend((0..=2000).map(|k| a + along * (f64::from(k) / 2000.0) + out));
            let arc = (0..=360).map(|k| f64::from(k).to_radians());
            points.extend(arc.map(|t| a + Vec2::new(t.cos(), t.sin()) * shape.radius_m));
        }
        points
    }

    #[test]
    fn a_prism_has_a_floor_and_a_top() {
        let block = Outline::new(&rectangle(0.0, 0.0, 4.0, 4.0).between(10.0, 30.0).unwrap());
        for (point, wanted) in [
            ([7.0, 0.0, 20.0], ([4.0, 0.0, 20.0], 3.0)),
            ([1.0, 2.0, 35.0], ([1.0, 2.0, 30.0], 5.0)),
            ([1.0, 2.0, 4.0], ([1.0, 2.0, 10.0], 6.0)),
            ([7.0, 0.0, 34.0], ([4.0, 0.0, 30.0], 5.0)),
            ([0.0, 1.0, 29.0], ([0.0, 1.0, 30.0], -1.0)),
            ([3.5, 0.0, 20.0], ([4.0, 0.0, 20.0], -0.5)),
        ] {
            let found = block.nearest(Vec3::from(point));
            assert_eq!((<[f64; 3]>::from(found.point), found.distance_m), wanted, "{point:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn distances_to_a_prism_agree_with_dense_sampling(
            point in [-40f64..40.0, -40f64..40.0, -20f64..90.0], hx in 2f64..20.0, hy in 2f64..20.0,
            turn in 0f64..3.0, radius in 0f64..5.0, floor in 0f64..20.0, height in 5f64..40.0,
        ) {
            let core = ConvexShape::rectangle(Vec2::new(3.0, -2.0), Vec2::new(hx, hy), turn).unwrap();
            let shape = ConvexShape { radius_m: radius, ..core }.between(floor, floor + height).unwrap();
            let (point, outline) = (Vec3::from(point), Outline::new(&shape));
            let found = outline.nearest(point);
            prop_assert!(((found.point - point).norm() - found.distance_m.abs()).abs() < 1e-9);
            prop_assert!(outline.nearest(found.point).distance_m.abs() < 1e-9);
            prop_assert!(outline.box_distance_squared(point).sqrt() <= found.distance_m.max(0.0) + 1e-9);
            // Every point within the prism, on a grid, is at least as far away as the nearest point of the surface.
            let mut sampled = f64::INFINITY;
            for (i, j, k) in (0..21).flat_map(|i| (0..21).flat_map(move |j| (0..21).map(move |k| (i, j, k)))) {
                let part = |n: i32, low: f64, high: f64| low + (high - low) * f64::from(n) / 20.0;
                let (low, high) = (outline.low(), outline.high());
                let sample = Vec3::new(part(i, low.x, high.x), part(j, low.y, high.y), part(k, floor, floor + height));
                if outline.nearest_on_outline(sample.xy()).1 <= 0.0 {
                    sampled = sampled.min((sample - point).norm());
                }
            }
            if found.distance_m > 0.0 {
                prop_assert!(sampled >= found.distance_m - 1e-9 && sampled < found.distance_m + 5.0, "{found:?}, {sampled}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn distances_agree_with_dense_sampling(
            x in -60f64..60.0, y in -60f64..60.0, hx in 2f64..20.0, hy in 2f64..20.0,
            turn in 0f64..3.0, radius in 0f64..5.0,
        ) {
            let core = ConvexShape::rectangle(Vec2::new(3.0, -2.0), Vec2::new(hx, hy), turn).unwrap();
            let shape = ConvexShape { radius_m: radius, ..core };
            let (point, outline) = (Vec2::new(x, y), Outline::new(&shape));
            let found = outline.nearest_on_outline(point);
            // The arcs also sample points inside the rounded outline. From a point outside, those can only be farther away.
            let sampled = surface(&shape).iter().map(|s| (s - point).norm()).fold(f64::INFINITY, f64::min);
            if found.1 > 0.0 {
                prop_assert!((found.1 - sampled).abs() < 0.05, "{found:?}, sampled {sampled}");
            }
            prop_assert!(((found.0 - point).norm() - found.1.abs()).abs() < 1e-9);
            prop_assert!(outline.nearest_on_outline(found.0).1.abs() < 1e-9);
            prop_assert!(outline.box_distance_squared(point.push(7.0)).sqrt() <= found.1.max(0.0) + 1e-9);
        }

        #[test]
        fn the_depth_inside_is_that_of_the_nearest_face(u in -1f64..1.0, v in -1f64..1.0, turn in 0f64..3.0, radius in 0f64..5.0) {
            let (half, centre) = (Vec2::new(12.0, 5.0), Vec2::new(3.0, -2.0));
            let core = ConvexShape::rectangle(centre, half, turn).unwrap();
            let local = Vec2::new(u * half.x, v * half.y);
            let point = centre + nalgebra::Rotation2::new(turn) * local;
            let depth = (half.x - local.x.abs()).min(half.y - local.y.abs()) + radius;
            let found = nearest(&ConvexShape { radius_m: radius, ..core }, point.x, point.y);
            prop_assert!((found.1 + depth).abs() < 1e-9, "{found:?}, depth {depth}");
        }
    }
}
