//! The safety filter: a drone keeps its distance from obstacles and neighbours on its own senses, whoever leads.
//!
//! For each obstacle and neighbour a barrier h = √(2 α x) + ẋ is kept from falling faster than γ h, where x is the
//! distance beyond the one to keep and α the deceleration counted upon (a control barrier function on the braking
//! distance). That bounds the acceleration along the line of sight: a half-plane each, for [`Program`].

use crate::program::{HalfPlane, Program};
use skein_protocol::Vec2;

/// Constants of the filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyParams {
    /// Least distance between two drones, m.
    pub safe_distance_m: f64,
    /// Least distance of a drone's centre to an obstacle, m.
    pub clearance_m: f64,
    /// Greatest acceleration, m/s².
    pub acceleration_max_mps2: f64,
    /// γ, 1/s.
    pub gain_per_s: f64,
    /// Added to the safe distance, as a share of it.
    pub margin: f64,
    /// t_c, s.
    pub reaction_time_s: f64,
}

/// Obstacles farther than this beyond the clearance are left out, m.
const OBSTACLE_REACH_M: f64 = 60.0;
/// Added to the obstacle clearance against the length of a tick, and for [`TANGENT_M`], m.
const OBSTACLE_MARGIN_M: f64 = 0.1;
/// Share of the acceleration counted upon for braking before an obstacle; the rest turns.
const OBSTACLE_BRAKING: f64 = 0.7;
/// Closer to the border than this, √x is continued by its tangent, m: it would be arbitrarily steep, and beyond the
/// border there would be none. A drone that is pressed against the border comes to rest as much beyond it.
const TANGENT_M: f64 = 0.05;

/// An obstacle as sensed.
#[derive(Clone, Copy, Debug)]
pub struct NearObstacle {
    /// Nearest surface point, relative to the drone, m.
    pub nearest_m: Vec2,
    /// Distance to it, negative inside, m.
    pub distance_m: f64,
}

/// A neighbour, sensed or known from its beacon.
#[derive(Clone, Copy, Debug)]
pub struct Neighbour {
    /// Its position relative to the drone, m.
    pub position_m: Vec2,
    /// Its velocity relative to the drone, m/s.
    pub velocity_mps: Vec2,
    /// Age of this knowledge, s; 0 if sensed now.
    pub age_s: f64,
    /// Share of an evasion that this drone takes, 0 to 1.
    pub share: f64,
}

/// The filter and its memory.
#[derive(Clone, Debug)]
pub struct Safety {
    params: SafetyParams,
    planes: Vec<HalfPlane>,
    program: Program,
}

impl Safety {
    /// A filter with these constants.
    #[must_use]
    pub fn new(params: SafetyParams) -> Self {
        Self { params, planes: Vec::new(), program: Program::default() }
    }

    /// The acceleration nearest to `wanted` that is safe, m/s². If not everything can be kept, obstacles come first.
    pub fn filter(
        &mut self,
        wanted: Vec2,
        velocity: Vec2,
        obstacles: impl Iterator<Item = NearObstacle>,
        neighbours: impl Iterator<Item = Neighbour>,
    ) -> Vec2 {
        let params = self.params;
        self.planes.clear();
        self.planes.extend(obstacles.filter_map(|obstacle| params.obstacle_plane(&obstacle, velocity)));
        let hard = self.planes.len();
        self.planes.extend(neighbours.map(|neighbour| params.neighbour_plane(&neighbour)));
        self.program.solve(&self.planes, hard, params.acceleration_max_mps2, wanted)
    }
}

impl SafetyParams {
    fn obstacle_plane(&self, obstacle: &NearObstacle, velocity: Vec2) -> Option<HalfPlane> {
        if obstacle.distance_m > self.clearance_m + OBSTACLE_REACH_M {
            return None;
        }
        let away = -obstacle.nearest_m / obstacle.distance_m.abs().max(1e-9);
        let normal = if obstacle.distance_m < 0.0 { -away } else { away };
        let alpha = OBSTACLE_BRAKING * self.acceleration_max_mps2;
        // While the drone has not yet reacted it flies on.
        let reaction_m = velocity.norm() * self.reaction_time_s;
        let (root, slope) = root(alpha, obstacle.distance_m - self.clearance_m - OBSTACLE_MARGIN_M - reaction_m);
        let speed = normal.dot(&velocity);
        Some(HalfPlane { normal, bound: -(self.gain_per_s * (root + speed) + slope * speed) })
    }

    fn neighbour_plane(&self, neighbour: &Neighbour) -> HalfPlane {
        let distance = neighbour.position_m.norm().max(1e-6);
        let normal = -neighbour.position_m / distance;
        let velocity = -neighbour.velocity_mps;
        // What is known is old, and the answer comes late: meanwhile either may have turned.
        let late_s = neighbour.age_s + self.reaction_time_s;
        let keep = self.safe_distance_m * (1.0 + self.margin) + late_s * (1.0 + self.acceleration_max_mps2 * late_s);
        let alpha = self.acceleration_max_mps2;
        let (root, slope) = root(alpha, distance - keep);
        let speed = normal.dot(&velocity);
        let turning = (velocity.norm_squared() - speed * speed) / distance;
        let slack = self.gain_per_s * (root + speed) + turning + slope * speed;
        // Room that is left is halved, an evasion is divided by precedence.
        let share = if slack < 0.0 { neighbour.share } else { neighbour.share.min(0.5) };
        HalfPlane { normal, bound: -share * slack }
    }
}

/// √(2 α x), m/s, and its slope, 1/s.
fn root(alpha: f64, x: f64) -> (f64, f64) {
    let least = (2.0 * alpha * TANGENT_M).sqrt();
    if x < TANGENT_M {
        let slope = alpha / least;
        return (least + slope * (x - TANGENT_M), slope);
    }
    let root = (2.0 * alpha * x).sqrt();
    (root, alpha / root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PARAMS: SafetyParams = SafetyParams {
        safe_distance_m: 30.0,
        clearance_m: 15.0,
        acceleration_max_mps2: 5.0,
        gain_per_s: 1.5,
        margin: 0.02,
        reaction_time_s: 0.0,
    };
    const DT: f64 = 0.02;

    /// Flies two drones, each wanting to fly with its velocity for ever; returns their least distance.
    fn fly_pair(mut p: [Vec2; 2], mut v: [Vec2; 2], shares: [f64; 2]) -> f64 {
        let wanted = v;
        let mut filters = [Safety::new(PARAMS), Safety::new(PARAMS)];
        let mut least = f64::INFINITY;
        for _ in 0..1500 {
            let accelerations = [0, 1].map(|i| {
                let other = 1 - i;
                let (position_m, velocity_mps) = (p[other] - p[i], v[other] - v[i]);
                let neighbour = Neighbour { position_m, velocity_mps, age_s: 0.0, share: shares[i] };
                let want = (wanted[i] - v[i]) * 2.0;
                filters[i].filter(want, v[i], std::iter::empty(), std::iter::once(neighbour))
            });
            for i in 0..2 {
                let next = v[i] + accelerations[i] * DT;
                p[i] += (v[i] + next) * (DT / 2.0);
                v[i] = next;
            }
            least = least.min((p[0] - p[1]).norm());
        }
        least
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        #[test]
        fn two_drones_on_any_crossing_keep_their_distance(angle in 0.3..3.14, offset in -40.0..40.0, share in 0.1..0.9) {
            let other = Vec2::new(f64::cos(angle), f64::sin(angle)) * 10.0;
            let start = -other * 15.0 + Vec2::new(0.0, offset);
            let (p, v) = ([Vec2::new(-150.0, 0.0), start], [Vec2::new(10.0, 0.0), other]);
            prop_assume!((p[0] - p[1]).norm() > 45.0);
            let least = fly_pair(p, v, [share, 1.0 - share]);
            prop_assert!(least >= PARAMS.safe_distance_m, "{least}");
        }
    }

    #[test]
    fn one_that_takes_all_is_safe_from_one_that_takes_nothing() {
        let least = fly_pair([Vec2::zeros(), Vec2::new(90.0, 5.0)], [Vec2::new(10.0, 0.0), Vec2::zeros()], [1.0, 0.0]);
        assert!(least >= PARAMS.safe_distance_m, "{least}");
    }

    #[test]
    fn a_drone_stops_before_a_wall() {
        let mut filter = Safety::new(PARAMS);
        let (mut x, mut v) = (-80.0, Vec2::new(10.0, 0.0));
        for _ in 0..2000 {
            let wall = NearObstacle { nearest_m: Vec2::new(-x, 0.0), distance_m: -x };
            let a = filter.filter((Vec2::new(10.0, 0.0) - v) * 2.0, v, std::iter::once(wall), std::iter::empty());
            let next = v + a * DT;
            x += (v.x + next.x) * DT / 2.0;
            v = next;
            assert!(x <= -PARAMS.clearance_m, "{x}");
        }
        assert!(x > -PARAMS.clearance_m - 1.0, "it comes close: {x}");
    }
}
