//! The safety filter: a drone keeps its distance from obstacles and neighbours on its own senses, whoever leads.
//!
//! For each obstacle and neighbour a barrier h = √(2 α x) + ẋ is kept from falling faster than γ h, where x is the
//! distance beyond the one to keep and α the deceleration counted upon (a control barrier function on the braking
//! distance). That bounds the acceleration along the line of sight: a half-plane each, for [`Program`].

use crate::program::{HalfPlane, Program};
use skein_protocol::{DroneId, Vec2};
use std::collections::VecDeque;

/// Neighbours are sensed within so many safe distances.
pub const RANGING: f64 = 2.0;

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
/// A drone that is this part of the margin nearer than it should is kept clear of first.
const PRESSED: f64 = 0.5;
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
    /// It is at least so far away, or it would be sensed, m.
    pub least_m: f64,
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
    counted: Vec<Counted>,
}

impl Safety {
    /// A filter with these constants.
    #[must_use]
    pub fn new(params: SafetyParams) -> Self {
        Self { params, planes: Vec::new(), program: Program::default(), trusted: VecDeque::new(), counted: Vec::new() }
    }

    /// Its constants as they are now.
    #[must_use]
    pub fn params(&self) -> &SafetyParams {
        &self.params
    }

    /// Margins for another t_c from now on, s.
    pub fn set_reaction_time(&mut self, reaction_time_s: f64) {
        self.params.reaction_time_s = reaction_time_s;
    }

    /// The acceleration nearest to `wanted` that is safe, m/s². If not everything can be kept, obstacles come first, then
    /// neighbours that cannot evade.
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
        let lag = (params.reaction_time_s / params.dt_s).round() as usize;
        let mut trusting = match self.trusted.len() > lag + 1 {
            true => self.trusted.pop_front().unwrap_or_default(),
            false => Vec::new(),
        };
        trusting.clear();
        let mut counted = std::mem::take(&mut self.counted);
        counted.clear();
        counted.extend(neighbours.map(|neighbour| self.count(neighbour, velocity, lag)));
        let mut tiers = [self.planes.len(); 2];
        let in_order = counted.iter().filter(|c| c.first).chain(counted.iter().filter(|c| !c.first));
        for Counted { neighbour, barrier, braking, missing, first } in in_order {
            self.planes.extend(params.following_plane(neighbour, barrier, velocity, *braking));
            self.planes.push(HalfPlane { normal: barrier.normal, bound: missing - barrier.share * barrier.slack });
            if *first {
                tiers[1] = self.planes.len();
            }
            trusting.push(Trust {
                id: neighbour.id,
                velocity: velocity + neighbour.velocity_mps,
                normal: barrier.normal,
                owed: (barrier.share - 1.0) * barrier.slack,
            });
        }
        self.counted = counted;
        self.trusted.push_back(trusting);
        self.program.solve(&self.planes, tiers, params.acceleration_max_mps2, wanted)
    }

    /// What is to be made of a neighbour. Whoever cannot evade, or has precedence and fails to, is kept clear of first, and
    /// whatever the others do; those behind this drone have to see to it that there is room. So is whoever has been pushed
    /// deep into the margin. Who is silent, but flies at this drone faster than this drone at it, is no body that hangs in
    /// the air, and has to brake itself: pressed from behind, nobody flies into what is ahead.
    fn count(&self, neighbour: Neighbour, velocity: Vec2, lag: usize) -> Counted {
        let params = &self.params;
        let of = |trusts: Option<&Vec<Trust>>| -> Option<Trust> {
            trusts.filter(|_| neighbour.sensed)?.iter().find(|trust| trust.id == neighbour.id).copied()
        };
        let due = self.trusted.len().checked_sub(lag + 1).and_then(|i| self.trusted.get(i));
        let theirs = velocity + neighbour.velocity_mps;
        let change = |trust: Trust| (theirs - trust.velocity) / params.dt_s;
        let braking = of(self.trusted.back()).map_or_else(Vec2::zeros, change);
        let missing = of(due).map_or(0.0, |trust| trust.missing(braking));
        let barrier = params.neighbour_barrier(&neighbour);
        let chased = barrier.normal.dot(&(velocity + theirs)) > 0.0;
        let pressed_m = params.keep_m(0.0) - PRESSED * params.margin_m();
        let first = (neighbour.share >= 1.0 && !chased)
            || (neighbour.share > 0.5 && missing > FAILING_MPS2)
            || (neighbour.sensed && neighbour.position_m.norm() < pressed_m);
        Counted { neighbour, barrier, braking, missing, first }
    }
}

/// A neighbour and what is made of it.
#[derive(Clone, Copy, Debug)]
struct Counted {
    neighbour: Neighbour,
    barrier: Barrier,
    /// Its acceleration as sensed, m/s².
    braking: Vec2,
    /// What it did less than its share, m/s².
    missing: f64,
    /// Whether it comes before others.
    first: bool,
}

impl Trust {
    /// What the neighbour did less than its share, m/s², when its acceleration in the tick in which it was due was `done`,
    /// m/s²: this drone makes up for it, whether the other is dead, brakes, or cannot evade. Sensed, not told.
    fn missing(&self, done: Vec2) -> f64 {
        (self.owed + done.dot(&self.normal)).max(0.0)
    }
}

/// The barrier between this drone and a neighbour.
#[derive(Clone, Copy, Debug)]
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
    fn margin_m(&self) -> f64 {
        (self.safe_distance_m * self.margin).max(LEAST_MARGIN_M)
    }

    /// Distance to keep from a drone whose state is known, or answered, so much too late, m.
    fn keep_m(&self, late_s: f64) -> f64 {
        self.safe_distance_m + self.margin_m() + late_s * (1.0 + self.acceleration_max_mps2 * late_s)
    }

    /// The speed at which two drones that fly at each other, and know of each other only once they are in ranging
    /// distance, can both stop in time, m/s.
    #[must_use]
    pub fn speed_on_sight_mps(&self) -> f64 {
        let (late_s, brake) = (self.reaction_time_s, self.acceleration_max_mps2);
        let room_m = (RANGING * self.safe_distance_m - self.keep_m(late_s)).max(0.0);
        (brake * late_s).hypot((brake * room_m).sqrt()) - brake * late_s
    }

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
        let alpha = self.acceleration_max_mps2;
        let unsensed_m = neighbour.least_m - self.keep_m(self.reaction_time_s);
        let beyond_m = (distance - self.keep_m(late_s)).max(unsensed_m);
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
mod tests;
