//! What a flocking law knows of a drone's surroundings, as vectors.

use nalgebra::Vector3;
use skein::Senses;

/// A position, velocity or acceleration: world frame, x east, y north, z up.
pub(crate) type Vec3 = Vector3<f64>;

/// Another drone, relative to this one.
pub(crate) struct Neighbour {
    /// The direction to it; a unit vector.
    pub(crate) direction: Vec3,
    /// The distance to it, m.
    pub(crate) distance_m: f64,
    /// Its velocity relative to this drone, m/s.
    pub(crate) velocity: Vec3,
}

/// The nearest `most` neighbours within `range_m`, nearest first.
pub(crate) fn neighbours(senses: &Senses<'_>, range_m: f64, most: usize) -> Vec<Neighbour> {
    let mut all: Vec<Neighbour> = senses
        .neighbours
        .iter()
        .filter_map(|n| {
            let position = Vec3::from(n.position_m);
            let distance_m = position.norm();
            let direction = position.try_normalize(1e-9)?;
            let near = distance_m < range_m;
            near.then(|| Neighbour { direction, distance_m, velocity: n.velocity_mps.into() })
        })
        .collect();
    all.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    all.truncate(most);
    all
}

/// The vector, shortened to this length if it is longer.
pub(crate) fn limited(vector: Vec3, length: f64) -> Vec3 {
    let norm = vector.norm();
    if norm > length { vector * (length / norm) } else { vector }
}
