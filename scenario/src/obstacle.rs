//! The keys of an obstacle, and the upright prism over a convex shape that they describe.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use skein_protocol::Vec2;
use skein_protocol::shape::{ConvexShape, MAX_VERTICES, ShapeError};
use std::f64::consts::{PI, TAU};

/// One obstacle, in the world frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "shape", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Obstacle {
    /// A rectangle.
    Rectangle {
        /// Its centre, [x, y].
        #[schemars(inner(range(min = -1e6, max = 1e6)))]
        centre_m: [f64; 2],
        /// Half its length along x and along y, before the rotation.
        #[schemars(inner(range(min = 1e-3, max = 1e5)))]
        half_size_m: [f64; 2],
        /// Rotation around the centre, counter-clockwise.
        #[serde(default)]
        #[schemars(range(min = -1000.0, max = 1000.0))]
        rotation_rad: f64,
        /// Altitude of its lower face. Default: it stands on the ground.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        floor_m: Option<f64>,
        /// Altitude of its upper face, above `floor_m`. Default: it reaches to the sky.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        top_m: Option<f64>,
    },
    /// A circle.
    Circle {
        /// Its centre, [x, y].
        #[schemars(inner(range(min = -1e6, max = 1e6)))]
        centre_m: [f64; 2],
        /// Its radius.
        #[schemars(range(min = 1e-3, max = 1e5))]
        radius_m: f64,
        /// Altitude of its lower face. Default: it stands on the ground.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        floor_m: Option<f64>,
        /// Altitude of its upper face, above `floor_m`. Default: it reaches to the sky.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        top_m: Option<f64>,
    },
    /// A convex polygon.
    Polygon {
        /// Its corners in order, [x, y] each, clockwise or counter-clockwise.
        #[schemars(length(min = 3, max = MAX_VERTICES), inner(inner(range(min = -1e6, max = 1e6))))]
        vertices_m: Vec<[f64; 2]>,
        /// Altitude of its lower face. Default: it stands on the ground.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        floor_m: Option<f64>,
        /// Altitude of its upper face, above `floor_m`. Default: it reaches to the sky.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        top_m: Option<f64>,
    },
    /// An ellipse. It is replaced by the polygon of 16 corners that encloses it.
    Ellipse {
        /// Its centre, [x, y].
        #[schemars(inner(range(min = -1e6, max = 1e6)))]
        centre_m: [f64; 2],
        /// Its semi-axes along x and along y, before the rotation.
        #[schemars(inner(range(min = 1e-3, max = 1e5)))]
        semi_axes_m: [f64; 2],
        /// Rotation around the centre, counter-clockwise.
        #[serde(default)]
        #[schemars(range(min = -1000.0, max = 1000.0))]
        rotation_rad: f64,
        /// Altitude of its lower face. Default: it stands on the ground.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        floor_m: Option<f64>,
        /// Altitude of its upper face, above `floor_m`. Default: it reaches to the sky.
        #[serde(default)]
        #[schemars(range(min = -1e4, max = 1e5))]
        top_m: Option<f64>,
    },
}

impl Obstacle {
    /// The obstacle's shape, counter-clockwise, world frame, m.
    ///
    /// # Errors
    /// [`ShapeError`] if a polygon is not convex, a number is outside its key's range, or the floor is not below the top.
    pub fn shape(&self) -> Result<ConvexShape, ShapeError> {
        let (floor_m, top_m) = self.heights_m();
        self.outline()?.between(floor_m.unwrap_or(f64::NEG_INFINITY), top_m.unwrap_or(f64::INFINITY))
    }

    /// The altitudes of its floor and its top, m.
    #[must_use]
    pub fn heights_m(&self) -> (Option<f64>, Option<f64>) {
        match *self {
            Self::Rectangle { floor_m, top_m, .. }
            | Self::Circle { floor_m, top_m, .. }
            | Self::Polygon { floor_m, top_m, .. }
            | Self::Ellipse { floor_m, top_m, .. } => (floor_m, top_m),
        }
    }

    fn outline(&self) -> Result<ConvexShape, ShapeError> {
        match self {
            Self::Rectangle { centre_m, half_size_m, rotation_rad, .. } => {
                ConvexShape::rectangle(Vec2::from(*centre_m), Vec2::from(*half_size_m), *rotation_rad)
            }
            Self::Circle { centre_m, radius_m, .. } => ConvexShape::circle(Vec2::from(*centre_m), *radius_m),
            Self::Polygon { vertices_m, .. } => polygon(vertices_m),
            Self::Ellipse { centre_m, semi_axes_m, rotation_rad, .. } => {
                ellipse(Vec2::from(*centre_m), Vec2::from(*semi_axes_m), *rotation_rad)
            }
        }
    }
}

fn polygon(corners: &[[f64; 2]]) -> Result<ConvexShape, ShapeError> {
    let mut corners: Vec<Vec2> = corners.iter().map(|&c| Vec2::from(c)).collect();
    if twice_area(&corners) < 0.0 {
        corners.reverse();
    }
    let shape = ConvexShape::new(&corners, 0.0)?;
    // To turn left at every corner is not enough: a pentagram does that too. Every corner has to be left of every edge.
    let n = corners.len();
    let edge_is_outside = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % n]);
        (2..n).all(|k| (b - a).perp(&(corners[(i + k) % n] - a)) > 0.0)
    };
    if n >= 3 && (0..n).all(edge_is_outside) { Ok(shape) } else { Err(ShapeError::NotConvex) }
}

/// Twice the signed area; positive if the corners are in counter-clockwise order.
fn twice_area(corners: &[Vec2]) -> f64 {
    (0..corners.len()).map(|i| corners[i].perp(&corners[(i + 1) % corners.len()])).sum()
}

/// The affine image of the regular polygon around the unit circle. Each of its edges touches the ellipse.
fn ellipse(centre: Vec2, semi_axes: Vec2, rotation_rad: f64) -> Result<ConvexShape, ShapeError> {
    let out = 1.0 / (PI / MAX_VERTICES as f64).cos();
    let (sin, cos) = rotation_rad.sin_cos();
    let corner = |k: usize| {
        let angle = TAU * (k as f64 + 0.5) / MAX_VERTICES as f64;
        let p = Vec2::new(angle.cos() * semi_axes.x, angle.sin() * semi_axes.y) * out;
        centre + Vec2::new(p.x * cos - p.y * sin, p.x * sin + p.y * cos)
    };
    ConvexShape::new(&(0..MAX_VERTICES).map(corner).collect::<Vec<_>>(), 0.0)
}
