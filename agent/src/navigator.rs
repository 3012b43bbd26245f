//! The drone's own path around all obstacles that it knows of. The path leads to the drone's target: a slot, or the end of its
//! route past an obstacle set.

//!
//! # Example
//!
//! ```
//! use skein_agent::navigator::{Heading, Navigator};
//! use skein_protocol::Vec2;
//! use skein_protocol::shape::ConvexShape;
//!
//! // Paths keep 5 m from obstacles, and at least 3 m where they must.
//! let mut navigator = Navigator::new(3.0, 5.0);
//! let tree = ConvexShape::circle(Vec2::new(50.0, 1.0), 4.0)?;
//! navigator.learn(1, [&tree].into_iter(), &[]);
//! let goal = Vec2::new(100.0, 0.0);
//! let Heading::Via(corner) = navigator.head(0, Vec2::zeros(), goal) else { panic!("the tree is in the way") };
//! assert!(corner.y < -2.0, "the shorter way is on the right");
//! # Ok::<(), skein_protocol::shape::ShapeError>(())
//! ```

use crate::silent_drones::have_moved;
use skein_leader::routes::Body;
use skein_leader::visibility::VisibilityMap;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;

/// If the target moves by more than this, a new path is searched, m.
const MOVED_M: f64 = 10.0;
/// The same as a part of the planning distance. The less of the two counts. No unit.
const MOVED: f64 = 0.5;
/// Added to the clearance for paths through gaps that are hardly wide enough, m. It covers the braking filter's margin for
/// rounding errors. Routes lead through gaps that leave more ([`skein_leader::routes::RouteParams::half_gap_m`]), so that a drone that is not
/// exactly on its route does not take it for blocked.
const TIGHT_M: f64 = 0.002;
/// A path with the planning distance that is longer than the path with the least distance by this factor is a long detour. So is a path
/// with the least distance that is longer than a straight flight by this factor.
const DETOUR_FACTOR: f64 = 1.25;
/// A search that found no path is repeated after this many ticks.
const RETRY_TICKS: u64 = 50;

/// Direction of flight towards a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heading {
    /// Straight to the target: no known obstacle is in the way.
    Straight,
    /// First to this point, world frame, m.
    Via(Vec2),
    /// No path is known.
    NoPath,
}

/// The path that the drone is flying.
#[derive(Clone, Debug)]
struct Path {
    target: Vec2,
    /// Corners still ahead in reverse order: the next corner is last, the target is first.
    corners: Vec<Vec2>,
}

/// The obstacles that the drone knows, and the path that it flies.
#[derive(Clone, Debug)]
pub struct Navigator {
    /// Map with the planning distance.
    wide: VisibilityMap,
    /// Map with the least distance that the braking filter keeps.
    tight: VisibilityMap,
    /// By how much the target may move until a new path is searched, m.
    moved_m: f64,
    path: Option<Path>,
    /// After a search without a result: the tick from which the next search is allowed.
    retry_at: u64,
    /// How often the obstacles had changed when they were learnt.
    changes: usize,
    /// The bodies in the maps.
    bodies: Vec<Body>,
}

impl Navigator {
    /// Creates a navigator that knows no obstacle. Paths keep `planning_m` from obstacles if such a path exists and is no long
    /// detour, and otherwise `clearance_m`.
    #[must_use]
    pub fn new(clearance_m: f64, planning_m: f64) -> Self {
        Self {
            wide: VisibilityMap::new(planning_m.max(clearance_m + TIGHT_M)),
            tight: VisibilityMap::new(clearance_m + TIGHT_M),
            moved_m: MOVED_M.min(MOVED * planning_m),
            changes: 0,
            bodies: Vec::new(),
            path: None,
            retry_at: 0,
        }
    }

    /// Replaces the known obstacles by `shapes` (world frame) and the dead drones that hang still by `bodies`, if `changes`, how often the
    /// obstacles have changed, is another number than before, or the bodies have moved. Returns whether that is so.
    pub fn learn<'a>(
        &mut self,
        changes: usize,
        shapes: impl Iterator<Item = &'a ConvexShape>,
        bodies: &[Body],
    ) -> bool {
        if changes == self.changes && !have_moved(&self.bodies, bodies) {
            return false;
        }
        self.changes = changes;
        self.bodies = bodies.to_vec();
        self.wide.clear();
        self.tight.clear();
        for shape in shapes {
            self.wide.add(shape);
            self.tight.add(shape);
        }
        for body in bodies {
            self.wide.add_body(body.centre_m, body.radius_m);
            self.tight.add_body(body.centre_m, body.radius_m);
        }
        (self.path, self.retry_at) = (None, 0);
        true
    }

    /// Whether a straight flight keeps the clearance from all known obstacles. World frame, m.
    #[must_use]
    pub fn is_free(&self, from: Vec2, to: Vec2) -> bool {
        self.tight.is_free(from, to)
    }

    /// Whether a straight flight keeps the planning distance from all known obstacles. World frame, m.
    #[must_use]
    pub fn is_clear(&self, from: Vec2, to: Vec2) -> bool {
        self.wide.is_free(from, to)
    }

    /// Whether a path that keeps the clearance from all known obstacles is not much longer than a straight flight. World frame, m.
    #[must_use]
    pub fn is_short_way(&self, from: Vec2, to: Vec2) -> bool {
        self.tight.path(from, to).is_some_and(|(_, length_m)| length_m <= DETOUR_FACTOR * (to - from).norm())
    }

    /// Length that is left of the path that the drone flies, m; `None` if it flies none.
    #[must_use]
    pub fn left_m(&self, from: Vec2) -> Option<f64> {
        let corners = &self.path.as_ref()?.corners;
        let first_m = (corners.last()? - from).norm();
        Some(first_m + corners.windows(2).map(|two| (two[1] - two[0]).norm()).sum::<f64>())
    }

    /// Returns the next step of the shortest path from `from` to `to`, world frame, m. `tick`: number of the present tick.
    pub fn head(&mut self, tick: u64, from: Vec2, to: Vec2) -> Heading {
        if self.is_free(from, to) {
            self.path = None;
            return Heading::Straight;
        }
        if let Some(next) = self.follow(from, to) {
            return Heading::Via(next);
        }
        if tick < self.retry_at {
            return Heading::NoPath;
        }
        let Some((mut corners, _)) = self.search(from, to) else {
            self.retry_at = tick + RETRY_TICKS;
            return Heading::NoPath;
        };
        let first = corners.first().copied();
        corners.reverse();
        self.path = Some(Path { target: to, corners });
        // A drone that is nearer to an obstacle than the least distance may leave it on a path that is not free by the map.
        self.follow(from, to).or(first).map_or(Heading::NoPath, Heading::Via)
    }

    /// The shortest path with the planning distance; or with the least distance, if that is much shorter: then it leads through
    /// a gap that the planning distance closes.
    fn search(&self, from: Vec2, to: Vec2) -> Option<(Vec<Vec2>, f64)> {
        let (wide, tight) = (self.wide.path(from, to), self.tight.path(from, to));
        match (wide, tight) {
            (Some(wide), Some(tight)) if wide.1 > DETOUR_FACTOR * tight.1 => Some(tight),
            (wide, tight) => wide.or(tight),
        }
    }

    /// The next corner of the present path. A corner is passed as soon as the way to the one after it is free, however near it is: on
    /// the way round a small obstacle, corners are close together. `None` if the path no longer leads to the target, or the way to
    /// the next corner is blocked.
    fn follow(&mut self, from: Vec2, to: Vec2) -> Option<Vec2> {
        let path = self.path.as_mut()?;
        if (path.target - to).norm() > self.moved_m {
            return None;
        }
        if let Some(end) = path.corners.first_mut() {
            *end = to;
        }
        while let [.., after, _] = path.corners[..]
            && self.tight.is_free(from, after)
        {
            path.corners.pop();
        }
        path.corners.last().copied().filter(|next| self.tight.is_free(from, *next))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drone_leaves_a_dead_end() {
        let wall =
            |x: f64, y: f64, hx: f64, hy: f64| ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(hx, hy), 0.0).unwrap();
        let walls = [wall(300.0, 70.0, 150.0, 10.0), wall(300.0, -70.0, 150.0, 10.0), wall(440.0, 0.0, 10.0, 80.0)];
        let mut navigator = Navigator::new(15.0, 20.0);
        navigator.learn(walls.len(), walls.iter(), &[]);
        let (mut position, target) = (Vec2::new(390.0, 0.0), Vec2::new(700.0, 0.0));
        let mut flown_m = 0.0;
        for tick in 0..20_000 {
            let next = match navigator.head(tick, position, target) {
                Heading::Straight => target,
                Heading::Via(corner) => corner,
                Heading::NoPath => panic!("no path from {position}"),
            };
            let step = (next - position).norm().min(0.5);
            position += (next - position).normalize() * step;
            flown_m += step;
            if (position - target).norm() < 1.0 {
                break;
            }
        }
        assert!((position - target).norm() < 1.0 && flown_m < 900.0, "{position} after {flown_m} m");
    }

    /// Flies from `from` to `to` in steps of 6 cm, as a small drone does in a tick. Gives the length of the flight, m.
    fn flown_m(navigator: &mut Navigator, from: Vec2, to: Vec2) -> f64 {
        let (mut position, mut flown_m) = (from, 0.0);
        for tick in 0..10_000 {
            let next = match navigator.head(tick, position, to) {
                Heading::Straight => to,
                Heading::Via(corner) => corner,
                Heading::NoPath => panic!("no path from {position}"),
            };
            let step = (next - position).normalize() * 0.06;
            position += step;
            flown_m += step.norm();
            if (position - to).norm() < 0.1 {
                return flown_m;
            }
        }
        panic!("at {position} after {flown_m} m");
    }

    #[test]
    fn a_small_drone_turns_a_corner_whose_points_are_close_together() {
        let wall = ConvexShape::rectangle(Vec2::new(249.09, 21.76), Vec2::new(1.31, 31.31), 0.0).unwrap();
        let (from, to) = (Vec2::new(246.47, 50.0), Vec2::new(386.9, 0.0));
        let mut navigator = Navigator::new(1.26, 1.32);
        navigator.learn(1, [&wall].into_iter(), &[]);
        assert!(flown_m(&mut navigator, from, to) < 160.0);
    }

    #[test]
    fn paths_with_the_planning_distance_keep_the_least_distance() {
        let wall = ConvexShape::rectangle(Vec2::new(249.09, 21.76), Vec2::new(1.31, 31.31), 0.0).unwrap();
        let mut navigator = Navigator::new(1.26, 1.26);
        navigator.learn(1, [&wall].into_iter(), &[]);
        assert!(flown_m(&mut navigator, Vec2::new(200.0, 50.0), Vec2::new(386.9, 0.0)) < 210.0);
    }

    #[test]
    fn a_route_through_the_narrowest_gap_is_free_beside_its_middle() {
        let wall = |y: f64| ConvexShape::rectangle(Vec2::new(100.0, y), Vec2::new(10.0, 60.0), 0.0).unwrap();
        let mut navigator = Navigator::new(15.0, 20.0);
        navigator.learn(1, [&wall(75.0041), &wall(-75.0041)].into_iter(), &[]);
        for y_m in [-0.002, 0.0, 0.002] {
            let (before, behind) = (Vec2::new(50.0, y_m), Vec2::new(200.0, y_m));
            assert_eq!(navigator.head(0, before, behind), Heading::Straight, "{y_m} m beside the middle");
        }
    }

    #[test]
    fn a_path_leads_round_a_dead_drone_that_closes_the_gap_to_an_obstacle() {
        let tree = ConvexShape::circle(Vec2::new(100.0, -80.0), 50.0).unwrap();
        let dead = [Body { centre_m: Vec2::new(100.0, 0.0), radius_m: 30.0 }];
        let (from, to) = (Vec2::new(60.0, -14.0), Vec2::new(300.0, -14.0));
        let mut navigator = Navigator::new(15.0, 20.0);
        navigator.learn(1, [&tree].into_iter(), &[]);
        assert_eq!(navigator.head(0, from, to), Heading::Straight, "it passes above the tree");
        assert!(navigator.learn(1, [&tree].into_iter(), &dead));
        let Heading::Via(corner) = navigator.head(1, from, to) else { panic!("the dead drone is in the way") };
        assert!(corner.y > 0.0, "{corner}");
        assert!(!navigator.learn(1, [&tree].into_iter(), &dead), "it hangs still");
        assert!(navigator.learn(1, [&tree].into_iter(), &[]), "it has landed");
        assert_eq!(navigator.head(2, from, to), Heading::Straight);
    }

    #[test]
    fn the_way_along_a_wall_is_short_and_the_way_round_it_is_not() {
        let wall = ConvexShape::rectangle(Vec2::new(144.0, -115.0), Vec2::new(5.0, 80.0), 0.0).unwrap();
        let mut navigator = Navigator::new(15.0, 20.0);
        navigator.learn(1, [&wall].into_iter(), &[]);
        let beside = Vec2::new(123.95, -156.0);
        assert!(!navigator.is_free(beside, Vec2::new(127.0, -229.0)));
        assert!(navigator.is_short_way(beside, Vec2::new(127.0, -229.0)));
        assert!(!navigator.is_short_way(beside, Vec2::new(164.0, -156.0)));
    }

    #[test]
    fn without_obstacles_a_drone_flies_straight() {
        assert_eq!(Navigator::new(15.0, 20.0).head(0, Vec2::zeros(), Vec2::x()), Heading::Straight);
    }
}
