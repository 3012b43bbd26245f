//! Where a segment comes nearest to a shape.

use skein_protocol::Vec2;
use skein_protocol::shape::{ConvexShape, MAX_VERTICES};

/// The point of a segment that is nearest to the core of a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestOnSegment {
    /// Distance to the core, m; negative inside.
    pub distance_m: f64,
    /// Unit vector from the core to the segment.
    pub normal: Vec2,
    /// Position on the segment, 0 at its start to 1 at its end.
    pub share: f64,
}

impl NearestOnSegment {
    /// Finds the segment's point nearest to the core of a shape. The core is the polygon of the shape's vertices, without the
    /// rounding radius.
    #[must_use]
    pub fn to_core(shape: &ConvexShape, from: Vec2, to: Vec2) -> Self {
        let along = to - from;
        let length2 = along.norm_squared();
        let count = (shape.count as usize).min(MAX_VERTICES);
        let vertex = |i: usize| Vec2::from(shape.vertices_m[i % count]);
        let mut best = Self { distance_m: f64::INFINITY, normal: Vec2::x(), share: 0.0 };
        let mut take = |on_core: Vec2, share: f64| {
            let offset = from + along * share - on_core;
            let distance_m = offset.norm();
            if distance_m < best.distance_m {
                let normal = if distance_m > 1e-9 { offset / distance_m } else { best.normal };
                best = Self { distance_m, normal, share };
            }
        };
        let mut crossing = None;
        let mut inside = count >= 3;
        for i in 0..count {
            let a = vertex(i);
            let edge = vertex(i + 1) - a;
            let share = if length2 > 0.0 { ((a - from).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
            take(a, share);
            for (end, share) in [(from, 0.0), (to, 1.0)] {
                let edge2 = edge.norm_squared();
                let t = if edge2 > 0.0 { ((end - a).dot(&edge) / edge2).clamp(0.0, 1.0) } else { 0.0 };
                take(a + edge * t, share);
            }
            inside &= edge.perp(&(from - a)) >= 0.0;
            let (turn, reach) = (along.perp(&edge), a - from);
            if turn.abs() > 1e-12 {
                let (t, u) = (reach.perp(&edge) / turn, reach.perp(&along) / turn);
                if (0.0..=1.0).contains(&t)
                    && (0.0..=1.0).contains(&u)
                    && crossing.is_none_or(|(earlier, _)| t < earlier)
                {
                    crossing = Some((t, Vec2::new(edge.y, -edge.x).normalize()));
                }
            }
        }
        match crossing {
            // Vertices are counter-clockwise, so the outer normal is to the right of an edge. A depth is a negative distance.
            Some((t, normal)) if !inside => {
                let depth_m = -normal.dot(&(along * (1.0 - t)));
                Self { distance_m: -depth_m.max(0.0), normal, share: 1.0 }
            }
            _ if inside => Self { distance_m: -best.distance_m, normal: -best.normal, share: best.share },
            _ => best,
        }
    }
}

/// Distance between a segment and the core of a shape, m. Negative if the segment enters the core.
#[must_use]
pub fn core_distance_m(shape: &ConvexShape, from: Vec2, to: Vec2) -> f64 {
    NearestOnSegment::to_core(shape, from, to).distance_m
}
