//! Shortest paths around known obstacles: A* search on a visibility graph. Its nodes are the corners of inflated outlines, and
//! its edges are tangents. Edges are generated during the search.

use crate::geometry::inflate;
use crate::nearest_on_segment::core_distance_m;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// Most nodes that one search expands. A search that reaches this limit ends with the shortest path found so far, if any.
const MAX_EXPANSIONS: usize = 4000;
/// Tolerance on the distance to an obstacle, m, so that rounding errors do not block a path.
const ROUNDING_M: f64 = 1e-6;
/// If the start or the end of a path is nearer to an obstacle than the distance to keep, the path may come nearer to that
/// obstacle by this, m.
const PRESSED_M: f64 = 1e-3;
/// The least distance to an obstacle that any searched path keeps, m.
const LEAST_M: f64 = 0.01;

/// A known obstacle, inflated.
#[derive(Clone, Debug)]
struct Outline {
    shape: ConvexShape,
    centre: Vec2,
    /// Half the diagonal of the shape's bounding box, m.
    extent_m: f64,
    /// Corners of the inflated outline, counter-clockwise.
    corners: Vec<Vec2>,
}

/// A map of obstacles. All paths on it keep the same distance from all obstacles.
#[derive(Clone, Debug, Default)]
pub struct VisibilityMap {
    keep_m: f64,
    outlines: Vec<Outline>,
}

/// A node of the graph: index of an outline, and index of a corner of that outline.
type Corner = (usize, usize);

/// A length with a total order, m.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Length(f64);

impl Eq for Length {}

impl PartialOrd for Length {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Length {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl VisibilityMap {
    /// Creates an empty map, for paths that keep at least `keep_m` from each obstacle.
    #[must_use]
    pub fn new(keep_m: f64) -> Self {
        Self { keep_m, outlines: Vec::new() }
    }

    /// Adds an obstacle, world frame.
    pub fn add(&mut self, shape: &ConvexShape) {
        let (low, high) = shape.bounds();
        let core: Vec<Vec2> = shape.vertices().collect();
        self.outlines.push(Outline {
            shape: *shape,
            centre: (low + high) / 2.0,
            extent_m: (high - low).norm() / 2.0,
            corners: inflate(&core, shape.radius_m + self.keep_m),
        });
    }

    /// Adds a body that is no obstacle, such as a dead drone that hangs still: paths keep `keep_m` from `centre`, but no less than from an
    /// obstacle. World frame, m.
    pub fn add_body(&mut self, centre: Vec2, keep_m: f64) {
        if let Ok(shape) = ConvexShape::circle(centre, (keep_m - self.keep_m).max(LEAST_M)) {
            self.add(&shape);
        }
    }

    /// Removes all obstacles.
    pub fn clear(&mut self) {
        self.outlines.clear();
    }

    /// Number of obstacles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.outlines.len()
    }

    /// Whether the map holds no obstacle.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.outlines.is_empty()
    }

    /// Whether the straight flight between two points keeps the distance from all obstacles. If one of the two points is nearer
    /// to an obstacle than that, the flight may come as near to this obstacle as that point. World frame, m.
    #[must_use]
    pub fn is_free(&self, from: Vec2, to: Vec2) -> bool {
        let keep = |outline: &Outline| self.keep_m.min(outline.distance_m(from, from)).min(outline.distance_m(to, to));
        self.outlines.iter().all(|outline| outline.is_free(from, to, self.keep_m, || keep(outline)))
    }

    /// Returns the corners of the shortest path, with `to` as the last one, and the path's length. `None` if no path was found.
    /// World frame, m.
    #[must_use]
    pub fn path(&self, from: Vec2, to: Vec2) -> Option<(Vec<Vec2>, f64)> {
        if self.is_free(from, to) {
            return Some((vec![to], (to - from).norm()));
        }
        // A path may leave its start, or reach its end, even if that point is nearer to an obstacle than the distance to keep.
        let keeps: Vec<f64> = self
            .outlines
            .iter()
            .map(|o| (o.distance_m(from, from).min(o.distance_m(to, to)) - PRESSED_M).min(self.keep_m).max(LEAST_M))
            .collect();
        let sees =
            |a: Vec2, b: Vec2| self.outlines.iter().zip(&keeps).all(|(o, &keep_m)| o.is_free(a, b, keep_m, || keep_m));
        let mut best: BTreeMap<Corner, (f64, Option<Corner>)> = BTreeMap::new();
        let mut open = BinaryHeap::new();
        let mut shortest: Option<(f64, Corner)> = None;
        let estimate = |point: Vec2, length: f64| Reverse((Length(length + (to - point).norm()), Length(length)));
        for corner in self.tangents(from, None) {
            let point = self.corner(corner);
            if sees(from, point) {
                let length = (point - from).norm();
                best.insert(corner, (length, None));
                open.push((estimate(point, length), Reverse(corner)));
            }
        }
        for _ in 0..MAX_EXPANSIONS {
            let Some((Reverse((Length(at_least), Length(length))), Reverse(corner))) = open.pop() else { break };
            if shortest.is_some_and(|(total, _)| total <= at_least) {
                break;
            }
            if best.get(&corner).is_some_and(|(known, _)| *known < length) {
                continue;
            }
            let point = self.corner(corner);
            if sees(point, to) {
                let total = length + (to - point).norm();
                if shortest.is_none_or(|(least, _)| total < least) {
                    shortest = Some((total, corner));
                }
            }
            for next in self.tangents(point, Some(corner)) {
                let there = self.corner(next);
                let through = length + (there - point).norm();
                if best.get(&next).is_none_or(|(known, _)| through < known - 1e-9) && sees(point, there) {
                    best.insert(next, (through, Some(corner)));
                    open.push((estimate(there, through), Reverse(next)));
                }
            }
        }
        shortest.map(|(total, last)| (self.walk_back(&best, last, to), total))
    }

    fn corner(&self, (outline, corner): Corner) -> Vec2 {
        self.outlines[outline].corners[corner]
    }

    /// Corners at which a straight flight from `point` can touch an outline as a tangent. If `point` is the corner `at`, its own
    /// outline contributes only the two adjacent corners. An outline that `point` is in has no tangents, and contributes all its corners: its
    /// corners stick out, so that a point that keeps the distance may be in it.
    fn tangents(&self, point: Vec2, at: Option<Corner>) -> Vec<Corner> {
        let mut found = Vec::new();
        for (i, outline) in self.outlines.iter().enumerate() {
            let count = outline.corners.len();
            if let Some((same, k)) = at
                && same == i
            {
                found.extend([(i, (k + 1) % count), (i, (k + count - 1) % count)]);
                continue;
            }
            let first = found.len();
            for k in 0..count {
                let (before, here, after) =
                    (outline.corners[(k + count - 1) % count], outline.corners[k], outline.corners[(k + 1) % count]);
                let ray = here - point;
                let (a, b) = (ray.perp(&(before - here)), ray.perp(&(after - here)));
                if a * b >= 0.0 {
                    found.push((i, k));
                }
            }
            if found.len() == first {
                found.extend((0..count).map(|k| (i, k)));
            }
        }
        found
    }

    /// The corners from the start of the search to `last`, followed by `to`.
    fn walk_back(&self, best: &BTreeMap<Corner, (f64, Option<Corner>)>, last: Corner, to: Vec2) -> Vec<Vec2> {
        let mut corners = vec![to];
        let mut at = Some(last);
        while let Some(corner) = at {
            corners.push(self.corner(corner));
            at = best.get(&corner).and_then(|(_, before)| *before);
        }
        corners.reverse();
        corners
    }
}

impl Outline {
    /// Distance between a segment and the shape, m; negative if the segment enters it.
    fn distance_m(&self, from: Vec2, to: Vec2) -> f64 {
        core_distance_m(&self.shape, from, to) - self.shape.radius_m
    }

    /// Whether a segment is at least `keep_m`, or at least `fallback_m()`, away from the shape. `fallback_m` is evaluated only if
    /// the segment is nearer than `keep_m`.
    fn is_free(&self, from: Vec2, to: Vec2, keep_m: f64, fallback_m: impl Fn() -> f64) -> bool {
        let along = to - from;
        let length2 = along.norm_squared();
        let share = if length2 > 0.0 { ((self.centre - from).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let reach_m = self.extent_m + keep_m;
        if (from + along * share - self.centre).norm_squared() > reach_m * reach_m {
            return true;
        }
        let distance_m = self.distance_m(from, to);
        distance_m >= keep_m - ROUNDING_M || distance_m >= fallback_m() - ROUNDING_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rectangle(x: f64, y: f64, hx: f64, hy: f64) -> ConvexShape {
        ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(hx, hy), 0.0).unwrap()
    }

    #[test]
    fn a_drone_beside_a_slanted_wall_finds_its_way_round() {
        let wall = ConvexShape::rectangle(Vec2::zeros(), Vec2::new(200.0, 5.0), 0.5).unwrap();
        let map = map(15.0, &[wall]);
        let (along, across) = (Vec2::new(0.5_f64.cos(), 0.5_f64.sin()), Vec2::new(-0.5_f64.sin(), 0.5_f64.cos()));
        // The outline's corners stick out by 0.07 m.
        for away_m in [20.001, 20.03, 20.06, 20.1, 25.0] {
            let (from, to) = (along * 100.0 + across * away_m, along * 100.0 - across * 60.0);
            let (corners, length_m) = map.path(from, to).unwrap();
            assert!(corners.len() > 1 && (210.0..300.0).contains(&length_m), "{away_m} m away: {corners:?}");
        }
    }

    fn map(keep_m: f64, shapes: &[ConvexShape]) -> VisibilityMap {
        let mut map = VisibilityMap::new(keep_m);
        shapes.iter().for_each(|shape| map.add(shape));
        map
    }

    #[test]
    fn the_path_around_a_disc_is_two_tangents_and_an_arc() {
        let map = map(5.0, &[ConvexShape::circle(Vec2::new(50.0, 0.0), 10.0).unwrap()]);
        let (_, length_m) = map.path(Vec2::zeros(), Vec2::new(100.0, 0.0)).unwrap();
        let tangent_m = (50.0f64 * 50.0 - 225.0).sqrt();
        let exact_m = 2.0 * tangent_m + 15.0 * 2.0 * (15.0f64 / 50.0).asin();
        assert!((length_m - exact_m).abs() < 0.05, "length {length_m} m, expected {exact_m} m");
    }

    #[test]
    fn the_path_out_of_a_dead_end_leads_backwards() {
        let walls = [
            rectangle(300.0, 70.0, 150.0, 10.0),
            rectangle(300.0, -70.0, 150.0, 10.0),
            rectangle(440.0, 0.0, 10.0, 80.0),
        ];
        let (path, length_m) = map(20.0, &walls).path(Vec2::new(390.0, 0.0), Vec2::new(700.0, 0.0)).unwrap();
        assert!(path[0].x < 160.0 && length_m > 700.0, "{path:?}");
    }

    #[test]
    fn a_gap_is_passable_from_twice_the_distance_on() {
        let gap = |width_m: f64| {
            [rectangle(100.0, 60.0 + width_m / 2.0, 5.0, 60.0), rectangle(100.0, -60.0 - width_m / 2.0, 5.0, 60.0)]
        };
        let through =
            |width_m: f64| map(15.0, &gap(width_m)).path(Vec2::zeros(), Vec2::new(200.0, 0.0)).unwrap().1 < 201.0;
        assert!(through(30.2) && !through(29.99));
    }

    #[test]
    fn a_closed_ring_of_walls_leaves_no_path() {
        let ring = [
            rectangle(0.0, 50.0, 60.0, 5.0),
            rectangle(0.0, -50.0, 60.0, 5.0),
            rectangle(50.0, 0.0, 5.0, 60.0),
            rectangle(-50.0, 0.0, 5.0, 60.0),
        ];
        assert_eq!(map(5.0, &ring).path(Vec2::zeros(), Vec2::new(200.0, 0.0)), None);
    }

    /// Length of the shortest path over the graph of all corners, m, by Dijkstra's algorithm without tangent selection.
    fn brute_force(map: &VisibilityMap, from: Vec2, to: Vec2) -> Option<f64> {
        let mut nodes = vec![from, to];
        let free = |p: &Vec2| map.outlines.iter().all(|o| o.distance_m(*p, *p) >= map.keep_m - ROUNDING_M);
        nodes.extend(map.outlines.iter().flat_map(|o| o.corners.iter().copied()).filter(free));
        let mut length = vec![f64::INFINITY; nodes.len()];
        let mut done = vec![false; nodes.len()];
        length[0] = 0.0;
        loop {
            let next = (0..nodes.len()).filter(|&i| !done[i] && length[i].is_finite());
            let i = next.min_by(|&a, &b| length[a].total_cmp(&length[b]))?;
            if i == 1 {
                return Some(length[1]);
            }
            done[i] = true;
            for j in 0..nodes.len() {
                let through = length[i] + (nodes[j] - nodes[i]).norm();
                if !done[j] && through < length[j] && map.is_free(nodes[i], nodes[j]) {
                    length[j] = through;
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn tangents_are_sufficient(discs in prop::collection::vec((0.0..200.0f64, -60.0..60.0f64, 2.0..20.0f64), 1..5)) {
            let (from, to) = (Vec2::new(-60.0, 0.0), Vec2::new(260.0, 0.0));
            let shapes: Vec<_> = discs.iter().map(|&(x, y, r)| ConvexShape::circle(Vec2::new(x, y), r).unwrap()).collect();
            let map = map(4.0, &shapes);
            let found = map.path(from, to).map(|(_, length_m)| length_m);
            match (found, brute_force(&map, from, to)) {
                (Some(found), Some(least)) => prop_assert!((found - least).abs() < 1e-6, "found {found} m, least {least} m"),
                (found, least) => prop_assert_eq!(found, least),
            }
        }
    }
}
