//! The safety filter: a drone keeps its distance from obstacles and neighbours on its own senses, whoever leads.
//!
//! For each obstacle and neighbour a barrier h = √(2 α x) + ẋ is kept from falling faster than γ h, where x is the
//! distance beyond the one to keep and α the deceleration counted upon (a control barrier function on the braking
//! distance). That bounds the acceleration along the line of sight: a half-plane each, for [`Program`].

use crate::program::{HalfPlane, Program};
use skein_protocol::{DroneId, Vec2};
use std::collections::VecDeque;

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
    /// Added to the safe distance, as a share of it; at least [`LEAST_MARGIN_M`].
    pub margin: f64,
    /// t_c, s.
    pub reaction_time_s: f64,
    /// Between two calls of the filter, s.
    pub dt_s: f64,
}

/// Obstacles farther than this beyond the clearance are left out, m.
const OBSTACLE_REACH_M: f64 = 60.0;
/// Added to the obstacle clearance against the length of a tick, and for [`TANGENT_M`], m.
const OBSTACLE_MARGIN_M: f64 = 0.1;
/// Who does so much less than its share, m/s², is not counted upon.
const FAILING_MPS2: f64 = 2.0;
/// The speed limit behind another drone is not taken lower than this, m/s: it would be arbitrarily steep.
const LEAST_LIMIT_MPS: f64 = 0.5;
/// Share of the acceleration counted upon for braking before an obstacle; the rest turns.
const OBSTACLE_BRAKING: f64 = 0.7;
/// Least margin on the safe distance, m: what the length of a tick and [`TANGENT_M`] may cost.
pub const LEAST_MARGIN_M: f64 = 0.25;
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
    /// Who.
    pub id: DroneId,
    /// Its position relative to the drone, m.
    pub position_m: Vec2,
    /// Its velocity relative to the drone, m/s.
    pub velocity_mps: Vec2,
    /// Age of what was told when the command takes effect, s; 0 if sensed.
    pub age_s: f64,
    /// Whether it is sensed, not told.
    pub sensed: bool,
    /// Share of an evasion that this drone takes, 0 to 1.
    pub share: f64,
}

/// What a sensed neighbour was counted upon for in the tick before.
#[derive(Clone, Copy, Debug)]
struct Trust {
    id: DroneId,
    /// Its velocity then, m/s.
    velocity: Vec2,
    /// From it to this drone.
    normal: Vec2,
    /// Its share of the acceleration away from this drone, m/s².
    owed: f64,
}

/// The filter and its memory.
#[derive(Clone, Debug)]
pub struct Safety {
    params: SafetyParams,
    planes: Vec<HalfPlane>,
    program: Program,
    /// What neighbours were counted upon for, the newest last: one entry a tick, until it has taken effect.
    trusted: VecDeque<Vec<Trust>>,
}

impl Safety {
    /// A filter with these constants.
    #[must_use]
    pub fn new(params: SafetyParams) -> Self {
        Self { params, planes: Vec::new(), program: Program::default(), trusted: VecDeque::new() }
    }

    /// Margins for another t_c from now on, s.
    pub fn set_reaction_time(&mut self, reaction_time_s: f64) {
        self.params.reaction_time_s = reaction_time_s;
    }

    /// The acceleration nearest to `wanted` that is safe, m/s². If not everything can be kept, obstacles and
    /// neighbours that cannot evade come first.
    pub fn filter(
        &mut self,
        wanted: Vec2,
        velocity: Vec2,
        obstacles: impl Iterator<Item = NearObstacle>,
        neighbours: impl Iterator<Item = Neighbour> + Clone,
    ) -> Vec2 {
        let params = self.params;
        self.planes.clear();
        self.planes.extend(obstacles.filter_map(|obstacle| params.obstacle_plane(&obstacle, velocity)));
        let lag = (params.reaction_time_s / params.dt_s).round() as usize;
        let mut trusting = match self.trusted.len() > lag + 1 {
            true => self.trusted.pop_front().unwrap_or_default(),
            false => Vec::new(),
        };
        trusting.clear();
        let due = self.trusted.len().checked_sub(lag + 1).and_then(|i| self.trusted.get(i));
        let last = self.trusted.back();
        let of = |trusts: Option<&Vec<Trust>>, neighbour: &Neighbour| -> Option<Trust> {
            trusts.filter(|_| neighbour.sensed)?.iter().find(|trust| trust.id == neighbour.id).copied()
        };
        let braking = |neighbour: &Neighbour| {
            let before = of(last, neighbour).map(|trust| trust.velocity);
            before.map_or_else(Vec2::zeros, |before| (velocity + neighbour.velocity_mps - before) / params.dt_s)
        };
        let missing = |neighbour: &Neighbour| of(due, neighbour).map_or(0.0, |trust| trust.missing(braking(neighbour)));
        // Whoever cannot evade, or has precedence and fails to, is kept clear of like an obstacle: first, and whatever the
        // others do. Those behind this drone have to see to it that there is room.
        let helpless = |n: &Neighbour| n.share >= 1.0 || (n.share > 0.5 && missing(n) > FAILING_MPS2);
        let (helpless, others) = (neighbours.clone().filter(|n| helpless(n)), neighbours.filter(|n| !helpless(n)));
        let mut hard = self.planes.len();
        let first = helpless.clone().count();
        for (i, neighbour) in helpless.chain(others).enumerate() {
            let barrier = params.neighbour_barrier(&neighbour);
            self.planes.extend(params.following_plane(&neighbour, &barrier, velocity, braking(&neighbour)));
            let bound = missing(&neighbour) - barrier.share * barrier.slack;
            self.planes.push(HalfPlane { normal: barrier.normal, bound });
            if i < first {
                hard = self.planes.len();
            }
            trusting.push(Trust {
                id: neighbour.id,
                velocity: velocity + neighbour.velocity_mps,
                normal: barrier.normal,
                owed: (barrier.share - 1.0) * barrier.slack,
            });
        }
        self.trusted.push_back(trusting);
        self.program.solve(&self.planes, hard, params.acceleration_max_mps2, wanted)
    }
}

impl Trust {
    /// What the neighbour did less than its share, m/s², when its acceleration in the tick in which it was due was `done`,
    /// m/s²: this drone makes up for it, whether the other is dead, brakes, or cannot evade. Sensed, not told.
    fn missing(&self, done: Vec2) -> f64 {
        (self.owed + done.dot(&self.normal)).max(0.0)
    }
}

/// The barrier between this drone and a neighbour.
struct Barrier {
    /// From the neighbour to this drone.
    normal: Vec2,
    /// How fast the two may accelerate towards each other, m/s²; negative: how fast they must part.
    slack: f64,
    /// This drone's share of it.
    share: f64,
    /// Distance beyond the one to keep, m.
    beyond_m: f64,
}

impl SafetyParams {
    fn obstacle_plane(&self, obstacle: &NearObstacle, velocity: Vec2) -> Option<HalfPlane> {
        if obstacle.distance_m > self.clearance_m + OBSTACLE_REACH_M {
            return None;
        }
        let away = -obstacle.nearest_m / obstacle.distance_m.abs().max(1e-9);
        let normal = if obstacle.distance_m < 0.0 { -away } else { away };
        let alpha = OBSTACLE_BRAKING * self.acceleration_max_mps2;
        let (root, slope) = root(alpha, obstacle.distance_m - self.clearance_m - OBSTACLE_MARGIN_M);
        let speed = normal.dot(&velocity);
        Some(HalfPlane { normal, bound: -(self.gain_per_s * (root + speed) + slope * speed) })
    }

    fn neighbour_barrier(&self, neighbour: &Neighbour) -> Barrier {
        let distance = neighbour.position_m.norm().max(1e-6);
        let normal = -neighbour.position_m / distance;
        let velocity = -neighbour.velocity_mps;
        // What is known is old, and the answer comes late: meanwhile the other may have turned.
        let late_s = neighbour.age_s + if neighbour.sensed { self.reaction_time_s } else { 0.0 };
        let margin_m = (self.safe_distance_m * self.margin).max(LEAST_MARGIN_M);
        let keep = self.safe_distance_m + margin_m + late_s * (1.0 + self.acceleration_max_mps2 * late_s);
        let alpha = self.acceleration_max_mps2;
        let beyond_m = distance - keep;
        let (root, slope) = root(alpha, beyond_m);
        let speed = normal.dot(&velocity);
        let turning = (velocity.norm_squared() - speed * speed) / distance;
        let slack = self.gain_per_s * (root + speed) + turning + slope * speed;
        // Room that is left is halved, an evasion is divided by precedence.
        let share = if slack < 0.0 { neighbour.share } else { neighbour.share.min(0.5) };
        Barrier { normal, slack, share, beyond_m }
    }

    /// Behind a drone that flies away a drone keeps room to stop, should the other stop dead: v ≤ √(u² + 2 a x), with v
    /// and u the speeds of both along the line between them. `braking` is the other's acceleration, as sensed.
    fn following_plane(&self, other: &Neighbour, barrier: &Barrier, own: Vec2, braking: Vec2) -> Option<HalfPlane> {
        let (normal, theirs) = (barrier.normal, own + other.velocity_mps);
        let (approach, flight) = (-own.dot(&normal), -theirs.dot(&normal));
        if flight <= 0.0 || approach <= 0.0 {
            return None;
        }
        let stop = self.acceleration_max_mps2;
        let limit = (flight * flight + 2.0 * stop * barrier.beyond_m).max(LEAST_LIMIT_MPS * LEAST_LIMIT_MPS).sqrt();
        let apart = -other.velocity_mps;
        let turn = (apart - normal * apart.dot(&normal)) / other.position_m.norm().max(1e-6);
        let slowing = flight * (-braking.dot(&normal) - theirs.dot(&turn)) + stop * apart.dot(&normal);
        let bound = -self.gain_per_s * (limit - approach) - own.dot(&turn) - slowing / limit;
        Some(HalfPlane { normal, bound })
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
        dt_s: DT,
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
                let id = DroneId(other as u32);
                let neighbour = Neighbour { id, position_m, velocity_mps, age_s: 0.0, sensed: true, share: shares[i] };
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
        fn two_drones_on_any_crossing_keep_their_distance(angle in 0.3..std::f64::consts::PI, offset in -40.0..40.0, share in 0.1..0.9) {
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
    fn a_drone_that_stops_dead_ahead_is_not_run_into_whatever_its_share_was() {
        for share in [0.1, 0.5, 0.9] {
            let (mut ahead, mut behind) = ((31.0, 10.0), (0.0, 10.0));
            let mut filter = Safety::new(PARAMS);
            for _ in 0..1500 {
                let neighbour = Neighbour {
                    id: DroneId(0),
                    position_m: Vec2::new(ahead.0 - behind.0, 0.0),
                    velocity_mps: Vec2::new(ahead.1 - behind.1, 0.0),
                    age_s: 0.0,
                    sensed: true,
                    share,
                };
                let (velocity, wanted) = (Vec2::new(behind.1, 0.0), Vec2::new((10.0 - behind.1) * 2.0, 0.0));
                let a = filter.filter(wanted, velocity, std::iter::empty(), std::iter::once(neighbour));
                let brake = -f64::min(PARAMS.acceleration_max_mps2, ahead.1 / DT);
                for (body, a) in [(&mut ahead, brake), (&mut behind, a.x)] {
                    *body = (body.0 + body.1 * DT + a * DT * DT / 2.0, body.1 + a * DT);
                }
                assert!(ahead.0 - behind.0 >= PARAMS.safe_distance_m, "{} with share {share}", ahead.0 - behind.0);
            }
        }
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
