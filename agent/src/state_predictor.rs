//! Predicts what a drone will sense when the command that it gives now takes effect, one reaction time later.
//!
//! The drone's own motion until then is known, because the pending commands are. Obstacles stay where they are.
//! Neighbours are assumed to keep their velocities.

use crate::few::Few;
use crate::reaction::PendingMotion;
use crate::safety::NearObstacle;
use skein_protocol::downlink::{SensedNeighbour, SensedObstacle, Senses};
use skein_protocol::{SimTime, raised};

/// Predicted senses.
#[derive(Clone, Debug, Default)]
pub(crate) struct StatePredictor {
    now: SimTime,
    position_m: [f64; 3],
    velocity_mps: [f64; 3],
    obstacles: Few<SensedObstacle>,
    neighbours: Few<SensedNeighbour>,
}

impl StatePredictor {
    /// Predicts the senses `span_s` from now. Until then the drone moves by `motion`.
    pub(crate) fn predict(&mut self, senses: &Senses<'_>, span_s: f64, motion: PendingMotion) {
        let PendingMotion { offset, velocity } = motion;
        let position = senses.position() + offset;
        self.now = senses.now.after(span_s);
        self.position_m = raised(position, senses.position_m[2]);
        self.velocity_mps = raised(velocity, senses.velocity_mps[2]);
        self.obstacles.clear();
        for sensed in senses.obstacles {
            let Some(outline) = senses.shape(sensed).map(|sensed| &sensed.shape) else { continue };
            let near = NearObstacle::seen_from(position, outline);
            let nearest_m = raised(position + near.nearest_m, sensed.nearest_m[2]);
            self.obstacles.push(SensedObstacle { nearest_m, distance_m: near.distance_m, ..*sensed });
        }
        self.neighbours.clear();
        self.neighbours.extend(senses.neighbours.iter().map(|sensed| {
            let theirs = sensed.velocity() + senses.velocity();
            let position_m = raised(sensed.position() + theirs * span_s - offset, sensed.position_m[2]);
            SensedNeighbour { position_m, velocity_mps: raised(theirs - velocity, sensed.velocity_mps[2]), ..*sensed }
        }));
    }

    /// The predicted senses. `senses` are those that were passed to [`Self::predict`].
    pub(crate) fn predicted<'a>(&'a self, senses: &Senses<'a>) -> Senses<'a> {
        senses.at(self.now, (self.position_m, self.velocity_mps), &self.obstacles, &self.neighbours)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::downlink::SensedShape;
    use skein_protocol::shape::ConvexShape;
    use skein_protocol::{DroneId, ObstacleId, Vec2};

    #[test]
    fn obstacles_stay_and_neighbours_keep_their_velocity() {
        let shape = ConvexShape::circle(Vec2::new(50.0, 0.0), 10.0).unwrap();
        let shapes = [SensedShape { shape, id: ObstacleId(3), reserved: 0 }];
        let obstacles = [SensedObstacle { nearest_m: [40.0, 0.0, 50.0], distance_m: 40.0, shape: 0, reserved: 0 }];
        let neighbours = [SensedNeighbour {
            position_m: [0.0, 30.0, 0.0],
            velocity_mps: [0.0, -2.0, 0.0],
            drone: DroneId(7),
            reserved: 0,
        }];
        let body = ([0.0, 0.0, 50.0], [10.0, 0.0, 0.0]);
        let senses = Senses::new((5, SimTime::from_secs(0.1)), body, &obstacles, &neighbours, &shapes);
        let mut predictor = StatePredictor::default();
        let motion = PendingMotion { offset: Vec2::new(4.0, 0.0), velocity: Vec2::new(6.0, 0.0) };
        predictor.predict(&senses, 0.5, motion);
        let ahead = predictor.predicted(&senses);
        assert_eq!((ahead.now, ahead.position_m, ahead.velocity().x), (SimTime::from_secs(0.6), [4.0, 0.0, 50.0], 6.0));
        assert!((ahead.obstacles[0].distance_m - 36.0).abs() < 1e-12);
        assert!((ahead.obstacles[0].nearest() - Vec2::new(40.0, 0.0)).norm() < 1e-12);
        assert_eq!(
            (ahead.neighbours[0].position_m, ahead.neighbours[0].velocity_mps),
            ([1.0, 29.0, 0.0], [4.0, -2.0, 0.0])
        );
    }
}
