//! Whether a drone has a way at all: whether obstacles that are too close together enclose it, or enclose its destination.
//!
//! Two obstacles that no drone fits between are linked. A ring of linked obstacles separates two points if a path between the
//! points crosses it an odd number of times. A union-find structure that keeps parities finds such a ring without a search
//! through the plane, and without a grid: the answer is exact.

use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;

/// Obstacles, and which of them are linked.
pub(crate) struct Barrier {
    /// A point inside each obstacle.
    inside: Vec<Vec2>,
    links: Vec<Link>,
}

/// Two obstacles that no drone fits between.
struct Link {
    between: (usize, usize),
    /// The points of the two cores that are nearest to each other.
    nearest: (Vec2, Vec2),
}

impl Barrier {
    /// Links the obstacles between which a gap is narrower than twice `half_gap_m`.
    pub(crate) fn new(shapes: &[ConvexShape], half_gap_m: f64) -> Self {
        let inside =
            shapes.iter().map(|shape| shape.vertices().sum::<Vec2>() / f64::from(shape.count.max(1))).collect();
        let mut links = Vec::new();
        for (j, b) in shapes.iter().enumerate() {
            for (i, a) in shapes[..j].iter().enumerate() {
                let reach_m = a.radius_m + b.radius_m + 2.0 * half_gap_m;
                let ((low_a, high_a), (low_b, high_b)) = (a.bounds(), b.bounds());
                let apart = (low_a - high_b).max().max((low_b - high_a).max());
                if apart >= 2.0 * half_gap_m {
                    continue;
                }
                let nearest = nearest_points(a, b);
                if (nearest.0 - nearest.1).norm() < reach_m {
                    links.push(Link { between: (i, j), nearest });
                }
            }
        }
        Self { inside, links }
    }

    /// Whether a ring of linked obstacles lies between two points outside all obstacles.
    pub(crate) fn separates(&self, from: Vec2, to: Vec2) -> bool {
        let mut rings = ParityForest::new(self.inside.len());
        self.links.iter().any(|link| {
            let (i, j) = link.between;
            let path = [self.inside[i], link.nearest.0, link.nearest.1, self.inside[j]];
            let odd = path.windows(2).filter(|leg| cross(leg[0], leg[1], from, to)).count() % 2 == 1;
            rings.join(i, j, odd)
        })
    }
}

/// Trees of linked obstacles. Each node knows whether the path to its parent crosses the line between the two points an odd
/// number of times.
struct ParityForest {
    parent: Vec<usize>,
    odd: Vec<bool>,
}

impl ParityForest {
    fn new(count: usize) -> Self {
        Self { parent: (0..count).collect(), odd: vec![false; count] }
    }

    /// The root of a node, and the parity of the path to it.
    fn root(&self, mut node: usize) -> (usize, bool) {
        let mut odd = false;
        while self.parent[node] != node {
            odd ^= self.odd[node];
            node = self.parent[node];
        }
        (node, odd)
    }

    /// Joins two nodes by a path of this parity. Returns whether that closes a ring of odd parity.
    fn join(&mut self, a: usize, b: usize, odd: bool) -> bool {
        let ((root_a, odd_a), (root_b, odd_b)) = (self.root(a), self.root(b));
        let ring = odd_a ^ odd_b ^ odd;
        if root_a == root_b {
            return ring;
        }
        (self.parent[root_a], self.odd[root_a]) = (root_b, ring);
        false
    }
}

/// Whether two segments cross.
fn cross(a: Vec2, b: Vec2, from: Vec2, to: Vec2) -> bool {
    let side = |p: Vec2, q: Vec2, r: Vec2| (q - p).perp(&(r - p)) > 0.0;
    side(from, to, a) != side(from, to, b) && side(a, b, from) != side(a, b, to)
}

/// The points of two cores that are nearest to each other; a common point twice if the cores overlap.
fn nearest_points(a: &ConvexShape, b: &ConvexShape) -> (Vec2, Vec2) {
    for (shape, other) in [(a, b), (b, a)] {
        if let Some(common) = other.vertices().find(|&vertex| contains(shape, vertex)) {
            return (common, common);
        }
    }
    let mut best = (f64::INFINITY, (Vec2::zeros(), Vec2::zeros()));
    for (a0, a1) in edges(a) {
        for (b0, b1) in edges(b) {
            if cross(a0, a1, b0, b1) {
                let along = (b0 - a0).perp(&(b1 - b0)) / (a1 - a0).perp(&(b1 - b0));
                let common = a0 + (a1 - a0) * along;
                return (common, common);
            }
            let pairs = [(a0, on(b0, b1, a0)), (a1, on(b0, b1, a1)), (on(a0, a1, b0), b0), (on(a0, a1, b1), b1)];
            for pair in pairs {
                let distance_m = (pair.0 - pair.1).norm();
                if distance_m < best.0 {
                    best = (distance_m, pair);
                }
            }
        }
    }
    best.1
}

fn edges(shape: &ConvexShape) -> impl Iterator<Item = (Vec2, Vec2)> {
    let n = shape.count as usize;
    (0..n).map(move |i| (shape.vertex(i), shape.vertex((i + 1) % n)))
}

fn contains(shape: &ConvexShape, point: Vec2) -> bool {
    shape.count >= 3 && edges(shape).all(|(a, b)| (b - a).perp(&(point - a)) >= 0.0)
}

/// The point of a segment that is nearest to `point`.
fn on(a: Vec2, b: Vec2, point: Vec2) -> Vec2 {
    let along = (b - a).dot(&(point - a)) / (b - a).norm_squared().max(f64::MIN_POSITIVE);
    a + (b - a) * along.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn wall(x: f64, y: f64, hx: f64, hy: f64) -> ConvexShape {
        ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(hx, hy), 0.0).unwrap()
    }

    fn room(door_m: f64) -> Vec<ConvexShape> {
        let half_m = 50.0 - door_m / 4.0;
        let mut walls =
            vec![wall(0.0, 100.0, 100.0, 2.0), wall(0.0, -100.0, 100.0, 2.0), wall(-100.0, 0.0, 2.0, 100.0)];
        walls.extend([wall(100.0, 50.0 + door_m / 4.0, 2.0, half_m), wall(100.0, -50.0 - door_m / 4.0, 2.0, half_m)]);
        walls
    }

    #[test]
    fn a_room_without_a_door_separates_inside_from_outside() {
        let (inside, outside) = (Vec2::new(3.0, 7.0), Vec2::new(400.0, 20.0));
        let separates = |door_m, from, to| Barrier::new(&room(door_m), 15.0).separates(from, to);
        assert!(separates(20.0, inside, outside) && separates(20.0, outside, inside));
        assert!(!separates(60.0, inside, outside));
        assert!(!separates(20.0, inside, Vec2::new(-3.0, 9.0)) && !separates(20.0, outside, Vec2::new(-400.0, 0.0)));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// A flood fill on a fine grid agrees wherever it is certain.
        #[test]
        fn a_flood_fill_agrees(
            discs in prop::collection::vec((-90.0..90.0_f64, -90.0..90.0_f64, 2.0..12.0_f64), 10..40),
        ) {
            let shapes: Vec<_> =
                discs.iter().map(|&(x, y, r)| ConvexShape::circle(Vec2::new(x, y), r).unwrap()).collect();
            let (from, to) = (Vec2::new(0.1, 0.2), Vec2::new(160.0, 3.0));
            let room_m = |p: Vec2| discs.iter().map(|d| (p - Vec2::new(d.0, d.1)).norm() - d.2).fold(1e9, f64::min);
            prop_assume!(room_m(from) > 9.0);
            let reaches = |clearance_m: f64| {
                let (side, step_m) = (340_usize, 1.0);
                let at = |i: usize| Vec2::new((i % side) as f64 - 170.0, (i / side) as f64 - 170.0) * step_m;
                let index = |p: Vec2| (p.y + 170.0).round() as usize * side + (p.x + 170.0).round() as usize;
                let mut seen = vec![false; side * side];
                let mut stack = vec![index(from)];
                while let Some(i) = stack.pop() {
                    if std::mem::replace(&mut seen[i], true) {
                        continue;
                    }
                    let (x, y) = (i % side, i / side);
                    let near = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
                    stack.extend(near.iter().filter(|n| n.0 < side && n.1 < side).map(|n| n.1 * side + n.0)
                        .filter(|&n| !seen[n] && room_m(at(n)) >= clearance_m));
                }
                seen[index(to)]
            };
            let separated = Barrier::new(&shapes, 6.0).separates(from, to);
            prop_assert!(!(separated && reaches(7.0)), "the barrier is not there");
            prop_assert!(separated || reaches(5.0), "the barrier was not found");
        }
    }
}
