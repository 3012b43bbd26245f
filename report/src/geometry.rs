//! Outlines of obstacles, and distances to them.

use skein_protocol::shape::ConvexShape;
use skein_protocol::{Vec2, Vec3};
use std::f64::consts::TAU;

/// Segments of a full circle in an outline.
const CIRCLE_SEGMENTS: f64 = 72.0;

/// Distance from a point to the surface of a shape, m; negative inside the shape.
pub(crate) fn clearance(shape: &ConvexShape, point: Vec3) -> f64 {
    let (beside, gap) = (outline_distance(shape, point.xy()), shape.height_gap_m(point.z));
    if gap <= 0.0 {
        return beside.max(gap);
    }
    if beside <= 0.0 { gap } else { (beside * beside + gap * gap).sqrt() }
}

/// Distance from a place to the outline of a shape, seen from above, m; negative inside.
fn outline_distance(shape: &ConvexShape, point: Vec2) -> f64 {
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

/// The outline of a shape as a polygon, m. Each rounded corner is an arc from the normal of one edge to the normal of
/// the next edge.
pub(crate) fn outline(shape: &ConvexShape) -> Vec<(f64, f64)> {
    let vertices: Vec<Vec2> = shape.vertices().collect();
    let n = vertices.len();
    let normal = |from: Vec2, to: Vec2| {
        let edge = to - from;
        (-edge.x).atan2(edge.y)
    };
    let mut outline = Vec::new();
    for (i, &vertex) in vertices.iter().enumerate() {
        let first = normal(vertices[(i + n - 1) % n], vertex);
        let turn = if n == 1 { TAU } else { (normal(vertex, vertices[(i + 1) % n]) - first).rem_euclid(TAU) };
        let steps = if shape.radius_m > 0.0 { (turn / TAU * CIRCLE_SEGMENTS).ceil().max(1.0) as u32 } else { 0 };
        for step in 0..=steps {
            let angle = first + turn * f64::from(step) / f64::from(steps.max(1));
            let point = vertex + Vec2::new(angle.cos(), angle.sin()) * shape.radius_m;
            outline.push((point.x, point.y));
        }
    }
    outline
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clearance_is_negative_inside_and_includes_the_rounding_radius() {
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
            assert!((clearance(&shape, point.push(50.0)) - wanted).abs() < 1e-12, "{point} of {shape:?}");
        }
    }

    #[test]
    fn clearance_counts_floor_and_top() {
        let block =
            ConvexShape::rectangle(Vec2::zeros(), Vec2::new(4.0, 4.0), 0.0).unwrap().between(10.0, 30.0).unwrap();
        let at = Vec3::new;
        for (point, wanted) in [
            (at(7.0, 0.0, 20.0), 3.0),
            (at(0.0, 0.0, 35.0), 5.0),
            (at(0.0, 0.0, 4.0), 6.0),
            (at(7.0, 0.0, 34.0), 5.0),
            (at(0.0, 0.0, 29.0), -1.0),
            (at(3.5, 0.0, 20.0), -0.5),
        ] {
            assert!((clearance(&block, point) - wanted).abs() < 1e-12, "{point}");
        }
    }

    #[test]
    fn outlines_lie_on_the_surface() {
        let at = Vec2::new;
        for shape in [
            ConvexShape::circle(at(3.0, 4.0), 2.0).unwrap(),
            ConvexShape::new(&[at(0.0, 0.0), at(4.0, 1.0)], 1.0).unwrap(),
            ConvexShape::rectangle(at(1.0, 1.0), at(2.0, 3.0), 0.4).unwrap(),
            ConvexShape::new(&[at(0.0, 0.0), at(4.0, 0.0), at(1.0, 5.0)], 0.5).unwrap(),
        ] {
            let outline = outline(&shape);
            for &(x, y) in &outline {
                assert!(outline_distance(&shape, at(x, y)).abs() < 1e-9, "({x}, {y}) of {shape:?}");
            }
            let (low, high) = shape.bounds();
            let widest = outline.iter().fold(0.0f64, |widest, &(x, _)| widest.max(x - low.x));
            assert!((widest - (high - low).x).abs() < 0.01, "{shape:?}");
        }
    }
}
