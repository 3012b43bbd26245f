//! The least distances between drones, and between drones and obstacles, over a mission.

use crate::close::Sweep;
use crate::facts::RunFacts;
use crate::geometry::clearance;
use skein_protocol::Vec2;
use skein_protocol::record::DroneRow;
use skein_protocol::shape::ConvexShape;

/// The least distances so far. A dead drone counts as a body until it has landed.
pub(crate) struct Vicinity {
    separation_m: Option<f64>,
    clearance_m: Option<f64>,
    obstacles: Vec<BoxedShape>,
    landing_s: Option<f64>,
    /// For each drone, how long it has been dead and without motion, s.
    still_s: Vec<f64>,
    /// Positions of all bodies in the tick that was taken last, m.
    bodies: Vec<Vec2>,
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
            obstacles: facts.obstacles.iter().map(bounded).collect(),
            landing_s: facts.landing_s,
            still_s: vec![0.0; facts.drones as usize],
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

    /// Takes the rows of a tick that lasted `dt_s`.
    pub(crate) fn take(&mut self, rows: &[DroneRow], dt_s: f64) {
        self.bodies.clear();
        for (row, still_s) in rows.iter().zip(&mut self.still_s) {
            let landed = self.landing_s.is_some_and(|landing_s| *still_s > landing_s - dt_s / 2.0);
            if !landed {
                self.bodies.push(Vec2::from(row.position_m));
            }
            *still_s = if !row.alive() && row.velocity_mps == [0.0; 2] { *still_s + dt_s } else { 0.0 };
        }
        let separation = self.sweep.least_distance(&self.bodies);
        self.separation_m = least(self.separation_m, separation);
        for &body in &self.bodies {
            for BoxedShape { shape, low, high } in &self.obstacles {
                let box_distance = (low - body).sup(&(body - high)).sup(&Vec2::zeros()).norm();
                if self.clearance_m.is_none_or(|least| box_distance <= least) {
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
        let dead = DroneRow { flags: 0, ..row(0.0, 0.0) };
        let far = [row(50.0, 0.0), dead];
        let near = [row(4.0, 0.0), dead];
        let mut hover = Vicinity::new(&facts(2));
        let mut land = Vicinity::new(&RunFacts { landing_s: Some(1.0), ..facts(2) });
        for vicinity in [&mut hover, &mut land] {
            for _ in 0..51 {
                vicinity.take(&far, 0.02);
            }
            vicinity.take(&near, 0.02);
        }
        assert_eq!((hover.separation_m, land.separation_m), (Some(4.0), Some(50.0)));
        assert_eq!(hover.clearance_m, None);
    }

    #[test]
    fn the_least_clearance_is_kept() {
        let obstacles = vec![ConvexShape::circle(Vec2::new(0.0, 0.0), 2.0).unwrap()];
        let mut vicinity = Vicinity::new(&RunFacts { obstacles, ..facts(2) });
        for x in [-9.0, -6.0, -8.0] {
            vicinity.take(&[row(x, 0.0), row(x - 30.0, 0.0)], 0.02);
        }
        assert_eq!((vicinity.clearance_m, vicinity.separation_m), (Some(4.0), Some(30.0)));
    }
}
