//! Wrong positions, clocks and outlines of the drones of a crowd.

use super::{Crowd, Keyed};
use skein_agent::sensing_errors::SensingErrors;
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;

/// Share of the ticks in which the error of a position or of a clock jumps. Between jumps it is constant, as the worst correlated error.
const JUMPS: f64 = 0.03;

/// The errors of all drones of a crowd.
pub(crate) struct Errors {
    /// What the drones allow for.
    pub(crate) allowed: SensingErrors,
    /// What happens.
    bounds: SensingErrors,
    random: Keyed,
    positions_m: Vec<Vec2>,
    clocks_s: Vec<f64>,
}

impl Errors {
    pub(crate) fn none(crowd: &Crowd) -> Self {
        Self::new(crowd, 0, SensingErrors::default())
    }

    /// Random errors up to random bounds, for which the drones allow.
    pub(crate) fn random(crowd: &Crowd, seed: u64) -> Self {
        let mut random = Keyed(seed ^ 0x5e45);
        random.unit();
        let size_m = crowd.params.safe_distance_m.min(crowd.params.clearance_m);
        let bounds = SensingErrors {
            position_m: random.within(0.0, 0.3) * size_m,
            obstacle_m: random.within(0.0, 0.1) * size_m,
            clock_s: random.within(-0.5, 1.0).max(0.0),
            partial_outlines: random.unit() < 0.5,
        };
        Self::new(crowd, seed, bounds)
    }

    fn new(crowd: &Crowd, seed: u64, bounds: SensingErrors) -> Self {
        let mut random = Keyed(seed ^ 0x5e46);
        let n = crowd.bodies.len();
        let positions_m = (0..n).map(|_| random.disc(bounds.position_m)).collect();
        let clocks_s = (0..n).map(|_| random.within(-bounds.clock_s, bounds.clock_s)).collect();
        Self { allowed: bounds, bounds, random, positions_m, clocks_s }
    }

    /// The same errors, for which the drones do not allow.
    pub(crate) fn unallowed(self) -> Self {
        Self { allowed: SensingErrors::default(), ..self }
    }

    pub(crate) fn step(&mut self) {
        for error in &mut self.positions_m {
            if self.random.unit() < JUMPS {
                // Mostly at the bound.
                let next = self.random.disc(1.5 * self.bounds.position_m);
                *error = next.cap_magnitude(self.bounds.position_m);
            }
        }
        for error in &mut self.clocks_s {
            if self.random.unit() < JUMPS {
                // Mostly at one of the two ends.
                let next = self.random.within(-1.5, 1.5) * self.bounds.clock_s;
                *error = next.clamp(-self.bounds.clock_s, self.bounds.clock_s);
            }
        }
    }

    pub(crate) fn position_m(&self, i: usize) -> Vec2 {
        self.positions_m[i]
    }

    pub(crate) fn clock_s(&self, i: usize) -> f64 {
        self.clocks_s[i]
    }

    /// The outlines as drone `i` senses them in this tick from where it is: as far as they face it, relative to its wrong position, and
    /// displaced.
    pub(crate) fn outlines(&mut self, i: usize, here: Vec2, obstacles: &[ConvexShape]) -> Vec<ConvexShape> {
        let mut displaced = |shape: &ConvexShape| {
            let displaced_m = self.random.disc(1.5 * self.bounds.obstacle_m).cap_magnitude(self.bounds.obstacle_m);
            let part = if self.bounds.partial_outlines { facing(shape, here - displaced_m) } else { *shape };
            part.moved(self.positions_m[i] + displaced_m)
        };
        obstacles.iter().map(&mut displaced).collect()
    }
}

/// The sides of an outline that face a point. A rounded outline is a disc here, of which all is kept.
fn facing(shape: &ConvexShape, from: Vec2) -> ConvexShape {
    let corners: Vec<Vec2> = shape.vertices().collect();
    let n = corners.len();
    let faces = |i: usize| (corners[(i + 1) % n] - corners[i % n]).perp(&(from - corners[i % n])) < 0.0;
    // A corner is kept if one of its two sides faces the point. The corners that are kept follow one another.
    let kept = |i: usize| faces(i) || faces(i + n - 1);
    let Some(first) = (0..n).find(|&i| kept(i) && !kept(i + n - 1)) else { return *shape };
    let part: Vec<Vec2> = (first..first + n).take_while(|&i| kept(i % n)).map(|i| corners[i % n]).collect();
    ConvexShape::new(&part, shape.radius_m).unwrap_or(*shape)
}
