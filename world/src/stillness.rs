//! Since when each drone has not moved.

use crate::body::Body;
use skein_protocol::{SimTime, Vec3};

/// Where a drone was when it moved last, and when.
#[derive(Clone, Copy, Debug)]
struct Place {
    at: Vec3,
    since: SimTime,
}

/// Since when each drone has not moved. A drone moves if it leaves the ball around its place. Then it has a new place.
#[derive(Clone, Debug)]
pub(crate) struct Stillness {
    radius_m: f64,
    places: Vec<Place>,
}

impl Stillness {
    /// All drones begin where these bodies are.
    pub(crate) fn new(bodies: &[Body], radius_m: f64) -> Self {
        let places = bodies.iter().map(|body| Place { at: body.position(), since: SimTime::ZERO }).collect();
        Self { radius_m, places }
    }

    /// Takes the bodies at the end of a tick.
    pub(crate) fn look(&mut self, now: SimTime, bodies: &[Body]) {
        let square = self.radius_m * self.radius_m;
        for (place, body) in self.places.iter_mut().zip(bodies) {
            if (body.position() - place.at).norm_squared() > square {
                *place = Place { at: body.position(), since: now };
            }
        }
    }

    /// How long the drone has not moved, s.
    pub(crate) fn still_s(&self, drone: usize, now: SimTime) -> f64 {
        self.places.get(drone).map_or(0.0, |place| now.since(place.since))
    }

    /// How long no living drone has moved, s; `None` without living drones.
    pub(crate) fn swarm_still_s(&self, bodies: &[Body], now: SimTime) -> Option<f64> {
        let living = (0..bodies.len()).filter(|&drone| bodies[drone].is_alive());
        living.map(|drone| self.still_s(drone, now)).reduce(f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::bodies;

    fn at(seconds: f64) -> SimTime {
        SimTime::from_secs(seconds)
    }

    #[test]
    fn a_drone_is_still_until_it_leaves_its_place() {
        let mut all = bodies(&[[0.0, 0.0], [100.0, 0.0]]);
        let mut stillness = Stillness::new(&all, 2.0);
        for (now_s, x) in [(1.0, 1.9), (2.0, -1.9), (3.0, 2.1), (4.0, 3.0)] {
            all[0] = bodies(&[[x, 0.0]])[0];
            stillness.look(at(now_s), &all);
        }
        assert_eq!((stillness.still_s(0, at(9.0)), stillness.still_s(1, at(9.0))), (6.0, 9.0));
        assert_eq!(stillness.swarm_still_s(&all, at(9.0)), Some(6.0));
        all[0].kill();
        assert_eq!(stillness.swarm_still_s(&all, at(9.0)), Some(9.0), "a dead drone does not count");
        all[1].kill();
        assert_eq!(stillness.swarm_still_s(&all, at(9.0)), None);
    }
}
