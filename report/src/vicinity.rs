//! How near bodies came to each other and to obstacles over a mission.

use crate::close::Sweep;
use crate::facts::RunFacts;
use skein_protocol::Vec2;
use skein_protocol::record::DroneRow;
use skein_protocol::shape::ConvexShape;

/// The least distances so far. Dead drones are bodies too, until they have landed.
pub(crate) struct Vicinity {
    /// Of two bodies, m.
    pub separation_m: Option<f64>,
    /// Of a body and an obstacle, m.
    pub clearance_m: Option<f64>,
    obstacles: Vec<(ConvexShape, Vec2, Vec2)>,
    landing_s: Option<f64>,
    still_s: Vec<f64>,
    bodies: Vec<Vec2>,
    sweep: Sweep,
}

impl Vicinity {
    pub fn new(facts: &RunFacts) -> Self {
        let bounded = |shape: &ConvexShape| (*shape, shape.bounds().0, shape.bounds().1);
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

    /// Takes the rows of a tick that lasted `dt_s`.
    pub fn take(&mut self, rows: &[DroneRow], dt_s: f64) {
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
            for (shape, low, high) in &self.obstacles {
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

/// Distance from a point to a shape's surface, m; negative inside.
pub(crate) fn clearance(shape: &ConvexShape, point: Vec2) -> f64 {
    let vertices: Vec<Vec2> = shape.vertices().collect();
    let (mut distance, mut inside) = (f64::INFINITY, vertices.len() > 2);
    for (i, &a) in vertices.iter().enumerate() {
        let edge = vertices[(i + 1) % vertices.len()] - a;
        let along = ((point - a).dot(&edge) / edge.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        distance = distance.min((point - a - edge * along).norm());
        inside &= edge.perp(&(point - a)) > 0.0;
    }
    (if inside { -distance } else { distance }) - shape.radius_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{facts, row};

    #[test]
    fn clearance_is_signed_and_knows_the_rounding() {
        let at = Vec2::new;
        let block = ConvexShape::rectangle(at(10.0, 0.0), at(2.0, 3.0), 0.0).unwrap();
        let disc = ConvexShape::circle(at(0.0, 0.0), 2.0).unwrap();
        let bar = ConvexShape::new(&[at(0.0, 0.0), at(4.0, 0.0)], 1.0).unwrap();
        for (shape, point, wanted) in [
            (block, at(5.0, 0.0), 3.0),
            (block, at(15.0, 7.0), 5.0),
            (block, at(10.5, 0.0), -1.5),
            (disc, at(3.0, 4.0), 3.0),
            (disc, at(0.0, 0.5), -1.5),
            (bar, at(2.0, 3.0), 2.0),
            (bar, at(7.0, 4.0), 4.0),
        ] {
            assert!((clearance(&shape, point) - wanted).abs() < 1e-12, "{point} of {shape:?}");
        }
    }

    #[test]
    fn the_dead_are_bodies_until_they_have_landed() {
        let dead = DroneRow { flags: 0, ..row(0.0, 0.0) };
        let far = [row(50.0, 0.0), dead];
        let near = [row(4.0, 0.0), dead];
        let mut hover = Vicinity::new(&facts(2));
        let mut land = Vicinity::new(&RunFacts { landing_s: Some(1.0), ..facts(2) });
        for vicinity in [&mut hover, &mut land] {
            (0..51).for_each(|_| vicinity.take(&far, 0.02));
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
