//! The drone's own path round all obstacles that it knows of, to wherever it is to be: a slot, or the end of its way past
//! an obstacle set.

use crate::visibility::VisibilityMap;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;

/// A corner of a path is passed when it is nearer than this, m.
const PASSED_M: f64 = 1.0;
/// A target that moved by more than this makes the path be searched anew, m.
const MOVED_M: f64 = 10.0;
/// Added to the clearance where a path leads through a gap that is hardly open, m: what the braking filter's rounding needs.
const TIGHT_M: f64 = 0.02;
/// A search that found no path is repeated after so many ticks.
const RETRY_TICKS: u64 = 50;

/// How to get to a target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heading {
    /// Straight on: nothing known is in the way.
    Straight,
    /// To this point first, world frame, m.
    Via(Vec2),
    /// No path is known.
    NoPath,
}

/// A path that is being flown.
#[derive(Clone, Debug)]
struct Path {
    target: Vec2,
    /// Corners still ahead, the next one last.
    corners: Vec<Vec2>,
}

/// What the drone knows of the ground, and the path it flies.
#[derive(Clone, Debug)]
pub struct Navigator {
    /// With the distance that paths are planned with.
    wide: VisibilityMap,
    /// With the least distance that the braking filter keeps.
    tight: VisibilityMap,
    path: Option<Path>,
    retry_at: u64,
}

impl Navigator {
    /// Nothing known. Paths keep `planning_m` from obstacles where they can, `clearance_m` everywhere.
    #[must_use]
    pub fn new(clearance_m: f64, planning_m: f64) -> Self {
        Self {
            wide: VisibilityMap::new(planning_m),
            tight: VisibilityMap::new(clearance_m + TIGHT_M),
            path: None,
            retry_at: 0,
        }
    }

    /// Takes over the known obstacles, if their number changed; true if it did.
    pub fn learn<'a>(&mut self, count: usize, shapes: impl Iterator<Item = &'a ConvexShape>) -> bool {
        if count == self.tight.len() {
            return false;
        }
        self.wide.clear();
        self.tight.clear();
        for shape in shapes {
            self.wide.add(shape);
            self.tight.add(shape);
        }
        (self.path, self.retry_at) = (None, 0);
        true
    }

    /// Whether a straight flight keeps clear of all known obstacles.
    #[must_use]
    pub fn is_free(&self, from: Vec2, to: Vec2) -> bool {
        self.tight.is_free(from, to)
    }

    /// The next step of the shortest path to a target.
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
        let found = self.wide.path(from, to).or_else(|| self.tight.path(from, to));
        let Some((mut corners, _)) = found else {
            self.retry_at = tick + RETRY_TICKS;
            return Heading::NoPath;
        };
        corners.reverse();
        self.path = Some(Path { target: to, corners });
        self.follow(from, to).map_or(Heading::NoPath, Heading::Via)
    }

    /// The next corner of the path that is flown; `None` if it no longer leads to the target.
    fn follow(&mut self, from: Vec2, to: Vec2) -> Option<Vec2> {
        let path = self.path.as_mut()?;
        if (path.target - to).norm() > MOVED_M {
            return None;
        }
        if let Some(end) = path.corners.first_mut() {
            *end = to;
        }
        while let [.., after, next] = path.corners[..]
            && ((next - from).norm() <= PASSED_M || self.tight.is_free(from, after))
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
    fn a_drone_gets_out_of_a_dead_end() {
        let wall =
            |x: f64, y: f64, hx: f64, hy: f64| ConvexShape::rectangle(Vec2::new(x, y), Vec2::new(hx, hy), 0.0).unwrap();
        let walls = [wall(300.0, 70.0, 150.0, 10.0), wall(300.0, -70.0, 150.0, 10.0), wall(440.0, 0.0, 10.0, 80.0)];
        let mut navigator = Navigator::new(15.0, 20.0);
        navigator.learn(walls.len(), walls.iter());
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

    #[test]
    fn without_obstacles_it_flies_straight() {
        assert_eq!(Navigator::new(15.0, 20.0).head(0, Vec2::zeros(), Vec2::x()), Heading::Straight);
    }
}
