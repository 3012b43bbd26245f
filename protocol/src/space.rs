//! Points and vectors on the wire are three numbers: x (east) and y (north) in the plane, z up. Code that flies in one plane
//! works with the horizontal part.

use crate::Vec2;

/// The horizontal part of a point or vector: x and y.
#[must_use]
#[inline]
pub fn horizontal([x, y, _]: [f64; 3]) -> Vec2 {
    Vec2::new(x, y)
}

/// The point or vector with this horizontal part and this vertical part.
#[must_use]
#[inline]
pub fn raised(horizontal: Vec2, z: f64) -> [f64; 3] {
    [horizontal.x, horizontal.y, z]
}
