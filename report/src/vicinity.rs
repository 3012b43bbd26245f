//! The least distances between drones, and of drones to obstacles and to the ground, over a mission.

use crate::close::Sweep;
use crate::facts::RunFacts;
use crate::geometry::clearance;
use skein_protocol::record::DroneRow;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Vec2, Vec3};

/// The least distances so far. A dead drone counts as a body until it has landed.
pub(crate) struct Vicinity {
    separation_m: Option<f64>,
    clearance_m: Option<f64>,
    obstacles: Vec<BoxedShape>,
    /// Positions of all bodies in the tick that was taken last, m.
    bodies: Vec<Vec3>,
    altitude_m: Option<f64>,
    sweep: Sweep,
}

/// A shape and its axis-aligned bounding box.
struct BoxedShape {
    shape: ConvexShape,
    low: Vec2,
    high: Vec2,
}

impl Vicinity {
    /// For a run with these facts, before its first tick.
    pub(crate) fn new(facts: &RunFacts) -> Self {
        let bounded = |shape: &ConvexShape| {
            let (low, high) = shape.bounds();
            BoxedShape { shape: *shape, low, high }
        };
        Self {
            separation_m: None,
            clearance_m: None,
            altitude_m: None,
            obstacles: facts.obstacles.iter().map(bounded).collect(),
            bodies: Vec::new(),
            sweep: Sweep::default(),
        }
    }

    /// Least distance of two bodies, centre to centre, m; `None` for fewer than two bodies.
    pub(crate) fn separation_m(&self) -> Option<f64> {
        self.separation_m
    }

    /// Least distance of a body's centre to an obstacle, m, negative inside; `None` without obstacles.
    pub(crate) fn clearance_m(&self) -> Option<f64> {
        self.clearance_m
    }

    /// Least altitude of a living drone, m; `None` if none ever lived.
    pub(crate) fn altitude_m(&self) -> Option<f64> {
        self.altitude_m
    }

    /// Takes the rows of a tick.
    pub(crate) fn take(&mut self, rows: &[DroneRow]) {
        self.bodies.clear();
        let landed = |row: &&DroneRow| !row.alive() && row.position_m[2] <= 0.0;
        self.bodies.extend(rows.iter().filter(|row| !landed(row)).map(|row| Vec3::from(row.position_m)));
        let lowest = rows.iter().filter(|row| row.alive()).map(|row| row.position_m[2]).min_by(f64::total_cmp);
        self.altitude_m = least(self.altitude_m, lowest);
        let separation = self.sweep.least_distance(&self.bodies);
        self.separation_m = least(self.separation_m, separation);
        for &body in &self.bodies {
            for BoxedShape { shape, low, high } in &self.obstacles {
                let place = body.xy();
                let box_distance = (low - place).sup(&(place - high)).sup(&Vec2::zeros()).norm();
                // Within the box, where its distance is 0, a body may be deeper inside the obstacle than any before.
                if self.clearance_m.is_none_or(|least| box_distance <= least.max(0.0)) {
                    self.clearance_m = least(self.clearance_m, Some(clearance(shape, body)));
                }
            }
        }
    }
}

fn least(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{facts, row};

    #[test]
    fn dead_drones_are_bodies_until_they_have_landed() {
        let dead = |z_m| DroneRow { flags: 0, position_m: [0.0, 0.0, z_m], ..row(0.0, 0.0) };
        let mut vicinity = Vicinity::new(&facts(2));
        vicinity.take(&[row(4.0, 0.0), dead(0.0)]);
        assert_eq!(vicinity.separation_m, None);
        vicinity.take(&[row(50.0, 0.0), dead(50.0)]);
        assert_eq!((vicinity.separation_m, vicinity.clearance_m), (Some(50.0), None));
    }

    #[test]
    fn the_least_clearance_is_kept() {
        let obstacles = vec![ConvexShape::circle(Vec2::new(0.0, 0.0), 2.0).unwrap()];
        let mut vicinity = Vicinity::new(&RunFacts { obstacles, ..facts(2) });
        for x in [-9.0, -6.0, -8.0] {
            vicinity.take(&[row(x, 0.0), row(x - 30.0, 0.0)]);
        }
        assert_eq!((vicinity.clearance_m, vicinity.separation_m), (Some(4.0), Some(30.0)));
        for x in [-1.5, -0.5, -1.0] {
            vicinity.take(&[row(x, 0.0)]);
        }
        assert_eq!(vicinity.clearance_m, Some(-1.5), "the deepest place counts, not the first one inside");
    }
}
