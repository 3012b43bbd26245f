//! The shape of every obstacle: an upright prism over a convex polygon with a rounding radius. A circle is one vertex with a
//! radius. A rectangle is four vertices with radius 0. The prism reaches from its floor to its top; by default it has neither.

use crate::{Course, Vec2};
use bytemuck::{Pod, Zeroable};
use thiserror::Error;

/// Maximum number of vertices of an obstacle.
pub const MAX_VERTICES: usize = 16;

/// All points within `radius_m` of the convex hull of the first `count` vertices. Coordinates are in the world frame, in
/// metres; the vertices are in counter-clockwise order. The layout is that of shared memory: call [`ConvexShape::check`] on
/// a shape that another process wrote.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ConvexShape {
    /// Rounding radius, m, ≥ 0.
    pub radius_m: f64,
    /// Altitude of the lower face, m; −∞ if the obstacle stands on the ground.
    pub floor_m: f64,
    /// Altitude of the upper face, m; +∞ if the obstacle reaches to the sky.
    pub top_m: f64,
    /// Number of vertices in use, 1 to [`MAX_VERTICES`].
    pub count: u32,
    /// Always 0.
    pub reserved: u32,
    /// x and y of each vertex, world frame, m; zero past `count`.
    pub vertices_m: [[f64; 2]; MAX_VERTICES],
}

/// What is wrong with a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum ShapeError {
    /// The shape has no vertex, or more than [`MAX_VERTICES`]. Holds the number of vertices.
    #[error("an obstacle has 1 to {MAX_VERTICES} vertices, not {0}")]
    Count(u32),
    /// A coordinate or the radius is not a finite number, or the radius is negative.
    #[error("an obstacle's coordinates and radius must be finite, its radius not negative")]
    NotFinite,
    /// The vertices are in clockwise order, the polygon is not convex, or three consecutive vertices are collinear.
    #[error("an obstacle's vertices must be convex and counter-clockwise")]
    NotConvex,
    /// The floor is not below the top, or one of them is not a number.
    #[error("an obstacle's floor must be below its top")]
    Heights,
}

impl ConvexShape {
    /// The shape with these vertices (world frame, m) and this rounding radius, m. The vertices must form a convex polygon
    /// in counter-clockwise order.
    ///
    /// # Errors
    /// [`ShapeError`] if the polygon is not convex and counter-clockwise, has no vertex or too many, or if a number is not
    /// finite.
    pub fn new(vertices: &[Vec2], radius_m: f64) -> Result<Self, ShapeError> {
        let count = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        if vertices.is_empty() || vertices.len() > MAX_VERTICES {
            return Err(ShapeError::Count(count));
        }
        let mut shape = Self {
            radius_m,
            floor_m: f64::NEG_INFINITY,
            top_m: f64::INFINITY,
            count,
            reserved: 0,
            vertices_m: [[0.0; 2]; MAX_VERTICES],
        };
        for (place, vertex) in shape.vertices_m.iter_mut().zip(vertices) {
            *place = [vertex.x, vertex.y];
        }
        shape.check()?;
        Ok(shape)
    }

    /// A disc with this centre (world frame, m) and radius, m.
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`] if a number is not finite or the radius is negative.
    pub fn circle(centre: Vec2, radius_m: f64) -> Result<Self, ShapeError> {
        Self::new(&[centre], radius_m)
    }

    /// The same outline between these altitudes, m. −∞ and +∞ stand for the ground and the sky.
    ///
    /// # Errors
    /// [`ShapeError::Heights`] if the floor is not below the top.
    pub fn between(self, floor_m: f64, top_m: f64) -> Result<Self, ShapeError> {
        if floor_m < top_m { Ok(Self { floor_m, top_m, ..self }) } else { Err(ShapeError::Heights) }
    }

    /// The same shape, moved by `by_m`, m.
    #[must_use]
    pub fn moved(mut self, by_m: Vec2) -> Self {
        for vertex in self.vertices_m.iter_mut().take(self.count as usize) {
            *vertex = [vertex[0] + by_m.x, vertex[1] + by_m.y];
        }
        self
    }

    /// The same shape of the course's frame, in the world frame.
    #[must_use]
    pub fn to_world(mut self, course: Course) -> Self {
        for vertex in self.vertices_m.iter_mut().take(self.count as usize) {
            *vertex = course.to_world((*vertex).into()).into();
        }
        self
    }

    /// Where the shape begins and ends along a course, m.
    #[must_use]
    pub fn extent(&self, course: Course) -> (f64, f64) {
        course.extent(self.bounds())
    }

    /// Whether a drone at this altitude could come closer to the shape than `margin_m` by flying on at its altitude.
    #[must_use]
    pub fn blocks(&self, altitude_m: f64, margin_m: f64) -> bool {
        self.height_gap_m(altitude_m) < margin_m
    }

    /// How far an altitude is above the top or below the floor, m; negative between them.
    #[must_use]
    #[inline]
    pub fn height_gap_m(&self, altitude_m: f64) -> f64 {
        (self.floor_m - altitude_m).max(altitude_m - self.top_m)
    }

    /// A rectangle with this centre (world frame, m) and these half sizes along its own axes, m, turned counter-clockwise
    /// by `rotation_rad`.
    ///
    /// # Errors
    /// [`ShapeError`] if a number is not finite, or if a size is 0 or negative.
    pub fn rectangle(centre: Vec2, half: Vec2, rotation_rad: f64) -> Result<Self, ShapeError> {
        if half.x <= 0.0 || half.y <= 0.0 {
            return Err(ShapeError::NotConvex);
        }
        let (sin, cos) = rotation_rad.sin_cos();
        let corner = |x: f64, y: f64| centre + Vec2::new(x * cos - y * sin, x * sin + y * cos);
        let corners =
            [corner(-half.x, -half.y), corner(half.x, -half.y), corner(half.x, half.y), corner(-half.x, half.y)];
        Self::new(&corners, 0.0)
    }

    /// Checks a shape that another process wrote.
    ///
    /// # Errors
    /// [`ShapeError`] if the number of vertices is wrong, a number is not finite, the radius is negative, the polygon
    /// is not convex and counter-clockwise, or the floor is not below the top.
    pub fn check(&self) -> Result<(), ShapeError> {
        if self.count == 0 || self.count as usize > MAX_VERTICES {
            return Err(ShapeError::Count(self.count));
        }
        let finite = self.vertices().all(|v| v.x.is_finite() && v.y.is_finite());
        if !finite || !self.radius_m.is_finite() || self.radius_m < 0.0 {
            return Err(ShapeError::NotFinite);
        }
        if self.floor_m.is_nan() || self.top_m.is_nan() || self.floor_m >= self.top_m {
            return Err(ShapeError::Heights);
        }
        let n = self.count as usize;
        let turn = |i: usize| {
            let (a, b, c) = (self.vertex(i), self.vertex((i + 1) % n), self.vertex((i + 2) % n));
            (b - a).perp(&(c - b))
        };
        // Every corner turns left, and all together turn once: a pentagram turns twice.
        if n >= 3 && ((0..n).any(|i| turn(i) <= 0.0) || self.full_turns() != 1) {
            return Err(ShapeError::NotConvex);
        }
        Ok(())
    }

    /// How often the edges turn all the way round, if every corner turns left by less than half a turn.
    fn full_turns(&self) -> usize {
        let n = self.count as usize;
        let upwards = |i: usize| {
            let edge = self.vertex((i + 1) % n) - self.vertex(i);
            edge.y > 0.0 || (edge.y == 0.0 && edge.x > 0.0)
        };
        (0..n).filter(|&i| !upwards(i) && upwards((i + 1) % n)).count()
    }

    /// Vertex `i`, world frame, m. The caller must keep `i` below `count`.
    #[must_use]
    pub fn vertex(&self, i: usize) -> Vec2 {
        Vec2::new(self.vertices_m[i][0], self.vertices_m[i][1])
    }

    /// The vertices in use, world frame, m.
    pub fn vertices(&self) -> impl ExactSizeIterator<Item = Vec2> + '_ {
        self.vertices_m[..(self.count as usize).min(MAX_VERTICES)].iter().map(|v| Vec2::new(v[0], v[1]))
    }

    /// Lower left and upper right corner of the axis-aligned bounding box, world frame, m.
    #[must_use]
    pub fn bounds(&self) -> (Vec2, Vec2) {
        let start = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
        let (low, high) = self.vertices().fold(start, |(low, high), v| (low.inf(&v), high.sup(&v)));
        let margin = Vec2::repeat(self.radius_m);
        (low - margin, high + margin)
    }

    /// Distance from a point to the outline seen from above, m; 0 inside.
    #[must_use]
    pub fn distance_m(&self, point: Vec2) -> f64 {
        let n = (self.count as usize).min(MAX_VERTICES);
        let edges = || (0..n).map(|i| (self.vertex(i), self.vertex((i + 1) % n)));
        if n >= 3 && edges().all(|(a, b)| (b - a).perp(&(point - a)) >= 0.0) {
            return 0.0;
        }
        let to_edge = |(a, b): (Vec2, Vec2)| {
            let along = (b - a).dot(&(point - a)) / (b - a).norm_squared().max(f64::MIN_POSITIVE);
            (point - a - (b - a) * along.clamp(0.0, 1.0)).norm()
        };
        (edges().map(to_edge).fold(f64::INFINITY, f64::min) - self.radius_m).max(0.0)
    }

    /// Centre of the axis-aligned bounding box, world frame, m.
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
    fn a_polygon_that_turns_twice_is_refused() {
        let star = |step: f64| -> Vec<Vec2> {
            (0..5)
                .map(|i| f64::from(i) * step * std::f64::consts::TAU / 5.0)
                .map(|a| Vec2::new(a.cos(), a.sin()))
                .collect()
        };
        assert!(ConvexShape::new(&star(1.0), 0.0).is_ok());
        assert_eq!(ConvexShape::new(&star(2.0), 0.0), Err(ShapeError::NotConvex));
    }

    #[test]
    fn distances_to_a_rectangle_and_a_disc() {
        let v = Vec2::new;
        let rectangle = ConvexShape::rectangle(v(10.0, 0.0), v(2.0, 5.0), 0.0).unwrap();
        for (point, wanted) in [(v(10.0, 1.0), 0.0), (v(0.0, 0.0), 8.0), (v(15.0, 9.0), 5.0), (v(10.0, -7.0), 2.0)] {
            assert!((rectangle.distance_m(point) - wanted).abs() < 1e-12, "{point}");
        }
        let disc = ConvexShape::circle(v(0.0, 0.0), 3.0).unwrap();
        assert!((disc.distance_m(v(3.0, 4.0)) - 2.0).abs() < 1e-12);
        assert!(disc.distance_m(v(1.0, 1.0)).abs() < 1e-12);
    }

    #[test]
    fn a_floor_is_below_its_top() {
        let disc = ConvexShape::circle(Vec2::zeros(), 1.0).unwrap();
        let low = disc.between(f64::NEG_INFINITY, 30.0).unwrap();
        assert!(low.blocks(30.0, 1.0) && low.blocks(44.9, 15.0) && !low.blocks(45.0, 15.0));
        assert!(disc.blocks(1e6, 1.0));
        for (floor_m, top_m) in [(5.0, 5.0), (6.0, 5.0), (f64::NAN, 5.0)] {
            assert_eq!(disc.between(floor_m, top_m), Err(ShapeError::Heights));
            assert_eq!(ConvexShape { floor_m, top_m, ..disc }.check(), Err(ShapeError::Heights));
        }
    }

    #[test]
    fn a_rectangle_has_positive_sizes() {
        let of = |x, y| ConvexShape::rectangle(Vec2::zeros(), Vec2::new(x, y), 0.3);
        assert!(of(1.0, 2.0).is_ok());
        for (x, y) in [(-1.0, -2.0), (-1.0, 2.0), (0.0, 2.0)] {
            assert_eq!(of(x, y), Err(ShapeError::NotConvex));
        }
    }

    #[test]
    fn bounds_include_the_rounding_radius() {
        let disc = ConvexShape::circle(Vec2::new(3.0, -1.0), 2.0).unwrap();
        assert_eq!(disc.bounds(), (Vec2::new(1.0, -3.0), Vec2::new(5.0, 1.0)));
        assert_eq!(disc.centre(), Vec2::new(3.0, -1.0));
    }

    #[test]
    fn each_defect_of_a_shape_has_its_own_error() {
        let v = |x, y| Vec2::new(x, y);
        assert_eq!(ConvexShape::new(&[], 0.0), Err(ShapeError::Count(0)));
        assert_eq!(ConvexShape::new(&[v(f64::NAN, 0.0)], 1.0), Err(ShapeError::NotFinite));
        assert_eq!(ConvexShape::circle(v(0.0, 0.0), -1.0), Err(ShapeError::NotFinite));
        let clockwise = [v(0.0, 0.0), v(0.0, 1.0), v(1.0, 1.0)];
        assert_eq!(ConvexShape::new(&clockwise, 0.0), Err(ShapeError::NotConvex));
        assert!(ConvexShape::rectangle(v(0.0, 0.0), v(0.0, 1.0), 0.0).is_err());
    }
}
