//! Flight at one altitude among obstacles that have floors and tops. The paper's pilot flies in a plane: it ignores the obstacles
//! above and below, and avoids the others as if they reached from the ground to the sky.

use crate::tuning::{ALTITUDE_GAIN_PER_S, CLIMB_GAIN_PER_S, CLIMB_MPS, CLIMB_SHARE};
use skein_leader::geometry::nearest;
use skein_protocol::downlink::{SensedObstacle, Senses};
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Vec2, raised};

/// The altitude that a drone keeps, and the obstacles that are in its way there.
#[derive(Clone, Debug)]
pub(crate) struct Altitude {
    altitude_m: f64,
    /// Obstacles that are at least this far above or below are not in the way, m.
    margin_m: f64,
    /// The lowest and the highest altitude that counts, m: the one to keep, and that of the drone.
    between_m: (f64, f64),
    obstacles: Vec<SensedObstacle>,
}

impl Altitude {
    /// For a drone that keeps `altitude_m`, and `margin_m` to what is above or below it.
    pub(crate) fn new(altitude_m: f64, margin_m: f64) -> Self {
        Self { altitude_m, margin_m, between_m: (altitude_m, altitude_m), obstacles: Vec::new() }
    }

    /// Looks at the obstacles. Returns whether [`Self::level`] differs from `senses`.
    pub(crate) fn look(&mut self, senses: &Senses<'_>) -> bool {
        let here_m = senses.position_m[2];
        self.between_m = (self.altitude_m.min(here_m), self.altitude_m.max(here_m));
        // The nearest point of an obstacle beside the drone is at its own altitude.
        if senses.obstacles.iter().all(|sensed| sensed.nearest_m[2] == here_m) {
            return false;
        }
        self.obstacles.clear();
        for sensed in senses.obstacles {
            let Some(shape) =
                senses.shape(sensed).map(|sensed| &sensed.shape).filter(|shape| self.is_blocked_by(shape))
            else {
                continue;
            };
            let beside = sensed.nearest_m[2] == here_m;
            self.obstacles.push(if beside { *sensed } else { flattened(sensed, shape, senses) });
        }
        true
    }

    /// The senses with the obstacles that are in the way alone. `senses` are those that were passed to [`Self::look`].
    pub(crate) fn level<'a>(&'a self, senses: &Senses<'a>) -> Senses<'a> {
        senses.at(senses.now, (senses.position_m, senses.velocity_mps), &self.obstacles, senses.neighbours)
    }

    /// Whether an obstacle is in the way: whether it is close to the altitude that the drone keeps, to its present one, or
    /// between the two.
    pub(crate) fn is_blocked_by(&self, shape: &ConvexShape) -> bool {
        shape.floor_m - self.margin_m < self.between_m.1 && self.between_m.0 < shape.top_m + self.margin_m
    }

    /// The vertical acceleration that leads to the altitude and keeps it, m/s²; 0 if the drone is there and does not climb.
    /// `horizontal` is the horizontal acceleration, which has precedence within the limit, m/s².
    pub(crate) fn climb_mps2(&self, senses: &Senses<'_>, horizontal: Vec2, limit_mps2: f64) -> f64 {
        let wanted_mps = (ALTITUDE_GAIN_PER_S * (self.altitude_m - senses.position_m[2])).clamp(-CLIMB_MPS, CLIMB_MPS);
        let wanted_mps2 = CLIMB_GAIN_PER_S * (wanted_mps - senses.velocity_mps[2]);
        let room_mps2 = CLIMB_SHARE * (limit_mps2 * limit_mps2 - horizontal.norm_squared()).max(0.0).sqrt();
        wanted_mps2.clamp(-room_mps2, room_mps2)
    }
}

/// A sensed obstacle as if it reached from the ground to the sky.
fn flattened(sensed: &SensedObstacle, shape: &ConvexShape, senses: &Senses<'_>) -> SensedObstacle {
    let (core, position): (Vec<Vec2>, Vec2) = (shape.vertices().collect(), senses.position());
    let to_core = nearest(&core, position) - position;
    let distance_m = to_core.norm() - shape.radius_m;
    let place = position + to_core * (distance_m / to_core.norm().max(1e-9));
    SensedObstacle { nearest_m: raised(place, senses.position_m[2]), distance_m, ..*sensed }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::downlink::SensedShape;
    use skein_protocol::{ObstacleId, SimTime};

    /// A column of 10 m radius, 40 m ahead, between these altitudes, and what a drone at 50 m senses of it.
    fn levelled(floor_m: f64, top_m: f64, nearest_z_m: f64) -> Option<Vec<SensedObstacle>> {
        let shape = ConvexShape::circle(Vec2::new(50.0, 0.0), 10.0).unwrap().between(floor_m, top_m).unwrap();
        let shapes = [SensedShape { shape, id: ObstacleId(0), reserved: 0 }];
        let distance_m = 40f64.hypot(nearest_z_m - 50.0);
        let sensed = [SensedObstacle { nearest_m: [40.0, 0.0, nearest_z_m], distance_m, shape: 0, reserved: 0 }];
        let senses = Senses::new((0, SimTime::ZERO), ([0.0, 0.0, 50.0], [0.0; 3]), &sensed, &[], &shapes);
        let mut altitude = Altitude::new(50.0, 20.0);
        altitude.look(&senses).then(|| altitude.level(&senses).obstacles.to_vec())
    }

    #[test]
    fn obstacles_above_and_below_are_ignored_and_near_ones_flattened() {
        assert_eq!(levelled(f64::NEG_INFINITY, f64::INFINITY, 50.0), None);
        assert_eq!(levelled(0.0, 30.0, 30.0), Some(vec![]));
        assert_eq!(levelled(70.0, 80.0, 70.0), Some(vec![]));
        let near = levelled(0.0, 31.0, 31.0).unwrap();
        assert_eq!((near[0].nearest_m, near[0].distance_m), ([40.0, 0.0, 50.0], 40.0));
    }

    #[test]
    fn a_drone_off_its_altitude_returns_to_it_and_one_on_it_does_nothing() {
        let mut altitude = Altitude::new(50.0, 20.0);
        let step = |altitude: &mut Altitude, z: f64, vz: f64, horizontal| {
            let senses = Senses::new((0, SimTime::ZERO), ([0.0, 0.0, z], [0.0, 0.0, vz]), &[], &[], &[]);
            altitude.look(&senses);
            altitude.climb_mps2(&senses, horizontal, 5.0)
        };
        assert_eq!(step(&mut altitude, 50.0, 0.0, Vec2::new(5.0, 0.0)), 0.0);
        assert_eq!(
            step(&mut altitude, 20.0, 0.0, Vec2::new(5.0, 0.0)),
            0.0,
            "the horizontal acceleration has precedence"
        );
        let (mut z, mut vz) = (20.0, -5.0);
        for _ in 0..2000 {
            let next = vz + 0.02 * step(&mut altitude, z, vz, Vec2::new(3.0, 0.0));
            z += (vz + next) / 2.0 * 0.02;
            vz = next;
        }
        assert!((z - 50.0).abs() < 0.1 && vz.abs() < 0.1, "{z} m, {vz} m/s");
    }
}
