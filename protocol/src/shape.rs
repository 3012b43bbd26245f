//! The one obstacle shape: a convex polygon with a rounding radius. A circle is one vertex with a radius, a rectangle
//! four vertices without.

use crate::Vec2;
use bytemuck::{Pod, Zeroable};
use thiserror::Error;

/// Most vertices of an obstacle.
pub const MAX_VERTICES: usize = 16;

/// All points within `radius_m` of the convex hull of the first `count` vertices. World frame, metres, vertices
/// counter-clockwise. Laid out for shared memory: call [`ConvexShape::check`] on one that another process wrote.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ConvexShape {
    /// Rounding radius, ≥ 0.
    pub radius_m: f64,
    /// Number of vertices in use, 1 to [`MAX_VERTICES`].
    pub count: u32,
    /// Always 0.
    pub reserved: u32,
    /// x and y of each vertex; zero past `count`.
    pub vertices_m: [[f64; 2]; MAX_VERTICES],
}

/// What is wrong with a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ShapeError {
    /// No vertex, or more than [`MAX_VERTICES`].
    #[error("an obstacle has 1 to {MAX_VERTICES} vertices, not {0}")]
    Count(u32),
    /// A coordinate or the radius is not a finite number, or the radius is negative.
    #[error("an obstacle's coordinates and radius must be finite, its radius not negative")]
    NotFinite,
    /// Clockwise or not convex.
    #[error("an obstacle's vertices must be convex and counter-clockwise")]
    NotConvex,
}

impl ConvexShape {
    /// The shape around these vertices, which must be convex and counter-clockwise.
    ///
    /// # Errors
    /// [`ShapeError`] if they are not, are too many, or a number is not finite.
    pub fn new(vertices: &[Vec2], radius_m: f64) -> Result<Self, ShapeError> {
        let count = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        if vertices.is_empty() || vertices.len() > MAX_VERTICES {
            return Err(ShapeError::Count(count));
        }
        let mut shape = Self { radius_m, count, reserved: 0, vertices_m: [[0.0; 2]; MAX_VERTICES] };
        for (place, vertex) in shape.vertices_m.iter_mut().zip(vertices) {
            *place = [vertex.x, vertex.y];
        }
        shape.check()?;
        Ok(shape)
    }

    /// A disc.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`].
    pub fn circle(centre: Vec2, radius_m: f64) -> Result<Self, ShapeError> {
        Self::new(&[centre], radius_m)
    }

    /// A rectangle of the given half sizes, turned counter-clockwise by `rotation_rad`.
    ///
    /// # Errors
    /// [`ShapeError`] if a number is not finite or a size not positive.
    pub fn rectangle(centre: Vec2, half: Vec2, rotation_rad: f64) -> Result<Self, ShapeError> {
        let (sin, cos) = rotation_rad.sin_cos();
        let corner = |x: f64, y: f64| centre + Vec2::new(x * cos - y * sin, x * sin + y * cos);
        let corners =
            [corner(-half.x, -half.y), corner(half.x, -half.y), corner(half.x, half.y), corner(-half.x, half.y)];
        Self::new(&corners, 0.0)
    }

    /// Checks a shape that another process wrote.
    ///
    /// # Errors
    /// [`ShapeError`].
    pub fn check(&self) -> Result<(), ShapeError> {
        if self.count == 0 || self.count as usize > MAX_VERTICES {
            return Err(ShapeError::Count(self.count));
        }
        let finite = self.vertices().all(|v| v.x.is_finite() && v.y.is_finite());
        if !finite || !self.radius_m.is_finite() || self.radius_m < 0.0 {
            return Err(ShapeError::NotFinite);
        }
        let n = self.count as usize;
        let turn = |i: usize| {
            let (a, b, c) = (self.vertex(i), self.vertex((i + 1) % n), self.vertex((i + 2) % n));
            (b - a).perp(&(c - b))
        };
        if n >= 3 && (0..n).any(|i| turn(i) <= 0.0) {
            return Err(ShapeError::NotConvex);
        }
        Ok(())
    }

    /// Vertex `i`; the caller keeps `i` below `count`.
    #[must_use]
    pub fn vertex(&self, i: usize) -> Vec2 {
        Vec2::new(self.vertices_m[i][0], self.vertices_m[i][1])
    }

    /// The vertices in use.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = Vec2> + '_ {
        self.vertices_m[..(self.count as usize).min(MAX_VERTICES)].iter().map(|v| Vec2::new(v[0], v[1]))
    }

    /// Least and greatest corner of the axis-aligned box around the shape.
    #[must_use]
    pub fn bounds(&self) -> (Vec2, Vec2) {
        let start = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
        let (low, high) = self.vertices().fold(start, |(low, high), v| (low.inf(&v), high.sup(&v)));
        let margin = Vec2::repeat(self.radius_m);
        (low - margin, high + margin)
    }

    /// Centre of the box around the shape.
    #[must_use]
    pub fn centre(&self) -> Vec2 {
        let (low, high) = self.bounds();
        (low + high) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_hold_the_rounding() {
        let disc = ConvexShape::circle(Vec2::new(3.0, -1.0), 2.0).unwrap();
        assert_eq!(disc.bounds(), (Vec2::new(1.0, -3.0), Vec2::new(5.0, 1.0)));
        assert_eq!(disc.centre(), Vec2::new(3.0, -1.0));
    }

    #[test]
    fn bad_shapes_are_named() {
        let v = |x, y| Vec2::new(x, y);
        assert_eq!(ConvexShape::new(&[], 0.0), Err(ShapeError::Count(0)));
        assert_eq!(ConvexShape::new(&[v(f64::NAN, 0.0)], 1.0), Err(ShapeError::NotFinite));
        assert_eq!(ConvexShape::circle(v(0.0, 0.0), -1.0), Err(ShapeError::NotFinite));
        let clockwise = [v(0.0, 0.0), v(0.0, 1.0), v(1.0, 1.0)];
        assert_eq!(ConvexShape::new(&clockwise, 0.0), Err(ShapeError::NotConvex));
        assert!(ConvexShape::rectangle(v(0.0, 0.0), v(0.0, 1.0), 0.0).is_err());
    }
}
