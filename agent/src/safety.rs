//! The safety filter keeps a drone's distance from obstacles and neighbours. It uses only the drone's own sensors and received
//! beacons, and depends on no leader.
//!
//! For each obstacle and neighbour the filter forms a barrier h = √(2 α x) + ẋ and keeps it from falling faster than γ h (a
//! control barrier function on the braking distance). x is the distance beyond the distance to keep, and α is the assumed
//! deceleration. Each barrier bounds the acceleration along the line of sight: a half-plane for [`Program`].

use crate::few::{FEW, Few};
use crate::program::{HalfPlane, Program};
use skein_leader::geometry::nearest;
use skein_protocol::scale::Scale;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, Vec2, prefetch};
use smallvec::SmallVec;
use std::collections::VecDeque;

/// Constants of the filter. The lengths and speeds in this file are those at full [`Scale`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyParams {
    /// Least distance between two drones, m.
    pub safe_distance_m: f64,
    /// Least distance of a drone's centre to an obstacle, m.
    pub clearance_m: f64,
    /// Largest acceleration, m/s².
    pub acceleration_max_mps2: f64,
    /// Deceleration of full braking, m/s²; at most the largest acceleration.
    pub braking_mps2: f64,
    /// γ: largest rate at which a barrier may fall, 1/s.
    pub gain_per_s: f64,
    /// Margin on the safe distance, as a share of it; at least [`MIN_MARGIN_M`], of a small swarm less.
    pub margin: f64,
    /// Reaction time t_c, s.
    pub reaction_time_s: f64,
    /// Time between two calls of the filter, s.
    pub dt_s: f64,
    /// How small the swarm is.
    pub scale: Scale,
}

/// Obstacles farther away than the clearance plus this distance are ignored, m.
const OBSTACLE_REACH_M: f64 = 60.0;
/// Margin on the clearance, m. It covers what happens within a tick, and `TANGENT_M`.
const OBSTACLE_MARGIN_M: f64 = 0.1;
/// Shortfall above which a neighbour is treated as non-cooperative, m/s².
const NON_COOPERATIVE_MPS2: f64 = 2.0;
/// Share of the margin that a neighbour may enter before it is avoided with priority.
const INTRUSION: f64 = 0.5;
/// Lower bound on the speed limit behind another drone, m/s. Below it the limit would be arbitrarily steep.
const MIN_LIMIT_MPS: f64 = 0.5;
/// Share of the acceleration that is assumed for braking before an obstacle. The rest is left for turning.
const OBSTACLE_BRAKING: f64 = 0.7;
/// Two obstacles are the sides of a gap if the product of their unit normals is below this.
const OPPOSITE: f64 = -0.7;
/// Least margin on the safe distance, m. It covers what happens within a tick, and the small distance by which a
/// drone that is pushed may pass the border.
pub const MIN_MARGIN_M: f64 = 0.25;
/// Below this x, √x is continued by its tangent, m: near 0 it would be arbitrarily steep, and below 0 it does not exist. A
/// drone that is pushed against the border comes to rest this far beyond it.
const TANGENT_M: f64 = 0.05;

/// An obstacle as sensed.
#[derive(Clone, Copy, Debug)]
pub struct NearObstacle {
    /// Nearest point of the surface, relative to the drone, m.
    pub nearest_m: Vec2,
    /// Distance to it, negative inside, m.
    pub distance_m: f64,
}

impl NearObstacle {
    /// The obstacle of this shape, as seen from `position`. Both in the world frame, m.
    #[must_use]
    pub fn seen_from(position: Vec2, shape: &ConvexShape) -> Self {
        let core: Vec<Vec2> = shape.vertices().collect();
        let to_core = nearest(&core, position) - position;
        let distance_m = to_core.norm() - shape.radius_m;
        Self { nearest_m: to_core * (distance_m / to_core.norm().max(1e-9)), distance_m }
    }

    /// The same obstacle, if it is `error_m` nearer than it seems, m.
    #[must_use]
    pub fn nearer_by(self, error_m: f64) -> Self {
        let distance_m = self.distance_m - error_m;
        if error_m == 0.0 || self.distance_m == 0.0 {
            return self;
        }
        Self { nearest_m: self.nearest_m * (distance_m / self.distance_m), distance_m }
    }

    /// Unit vector from the obstacle to the drone.
    fn normal(&self) -> Vec2 {
        let away = -self.nearest_m / self.distance_m.abs().max(1e-9);
        if self.distance_m < 0.0 { -away } else { away }
    }
}

/// A neighbour, sensed or known from its beacon.
#[derive(Clone, Copy, Debug)]
pub struct Neighbour {
    /// Id of the neighbour.
    pub id: DroneId,
    /// Its position relative to the drone, m.
    pub position_m: Vec2,
    /// Its velocity relative to the drone, m/s.
    pub velocity_mps: Vec2,
    /// Age of its beacon when the command takes effect, s; 0 if sensed.
    pub age_s: f64,
    /// Whether it is sensed. If not, it is known only from its beacon.
    pub sensed: bool,
    /// Lower bound on its distance, m. A neighbour nearer than this would be sensed.
    pub least_m: f64,
    /// This drone's share of an evasion, 0 to 1.
    pub share: f64,
}

/// A neighbour in an earlier tick, and what was expected of it.
#[derive(Clone, Copy, Debug)]
struct Expectation {
    id: DroneId,
    /// Its velocity, world frame, m/s.
    velocity: Vec2,
    /// Unit vector from it to this drone.
    normal: Vec2,
    /// The share of the acceleration away from this drone that was due from it, m/s².
    due: f64,
}

/// The filter and its memory of earlier ticks.
#[derive(Clone, Debug)]
pub struct Safety {
    params: SafetyParams,
    /// The reaction time, ticks.
    lag: usize,
    program: Program,
    /// Expectations of the neighbours, the newest last. One entry per tick, kept until the commands of that tick have taken
    /// effect.
    expected: VecDeque<Vec<Expectation>>,
}

impl Safety {
    /// Creates a filter with these constants and an empty memory.
    #[must_use]
    pub fn new(params: SafetyParams) -> Self {
        Self { params, lag: params.lag(), program: Program::default(), expected: VecDeque::new() }
    }

    /// Fetches what [`Self::filter`] reads into the cache: call it a short time before.
    pub(crate) fn warm(&self) {
        // The newest one tells how fast the neighbours flew. The oldest one is due, and then written anew.
        let read = [self.expected.front(), self.expected.back()];
        read.into_iter().flatten().for_each(|expected| prefetch(expected.as_slice()));
    }

    /// The present constants of the filter.
    #[must_use]
    pub fn params(&self) -> &SafetyParams {
        &self.params
    }

    /// Sets the reaction time from now on, s.
    pub fn set_reaction_time(&mut self, reaction_time_s: f64) {
        if self.params.reaction_time_s != reaction_time_s {
            self.params.reaction_time_s = reaction_time_s;
            self.lag = self.params.lag();
        }
    }

    /// Returns the safe acceleration nearest to `wanted`, world frame, m/s². `velocity`: the drone's own, world frame, m/s. If
    /// no acceleration keeps every distance, obstacles come first, then neighbours with priority (for example those that cannot
    /// evade), then all other neighbours.
    pub fn filter(
        &mut self,
        wanted: Vec2,
        velocity: Vec2,
        obstacles: impl Iterator<Item = NearObstacle>,
        neighbours: impl Iterator<Item = Neighbour>,
    ) -> Vec2 {
        let params = self.params;
        let reach_m = params.clearance_m + OBSTACLE_REACH_M;
        // Each list is filled where it stays: to collect one is to copy all of its room on the stack.
        let mut near = Few::<NearObstacle>::new();
        near.extend(obstacles.filter(|obstacle| obstacle.distance_m <= reach_m));
        let mut planes = SmallVec::<[HalfPlane; 2 * FEW]>::new();
        planes.extend(near.iter().map(|o| params.obstacle_plane(o, velocity, &near)));
        let before_neighbours = planes.len();
        let mut others = SmallVec::<[HalfPlane; 2 * FEW]>::new();
        let mut expectations = Few::<Expectation>::new();
        let memory = self.memory();
        for (at, neighbour) in neighbours.enumerate() {
            let Assessed { barrier, braking, missing, first } = params.assess(&neighbour, velocity, memory, at);
            let tier = if first { &mut planes } else { &mut others };
            if let Some(plane) = params.following_plane(&neighbour, &barrier, velocity, braking) {
                tier.push(plane);
            }
            tier.push(HalfPlane { normal: barrier.normal, bound: missing - barrier.share * barrier.slack });
            expectations.push(Expectation {
                id: neighbour.id,
                velocity: velocity + neighbour.velocity_mps,
                normal: barrier.normal,
                due: (barrier.share - 1.0) * barrier.slack,
            });
        }
        self.expect(&expectations);
        let tiers = [before_neighbours, planes.len()];
        let all = if planes.is_empty() {
            &others
        } else {
            planes.extend_from_slice(&others);
            &planes
        };
        self.program.solve(all, tiers, params.acceleration_max_mps2, wanted)
    }

    /// What it remembers of the neighbours.
    fn memory(&self) -> Memory<'_> {
        let due = self.expected.len().checked_sub(self.lag + 1).and_then(|i| self.expected.get(i));
        Memory { last: self.expected.back().map_or(&[], Vec::as_slice), due: due.map_or(&[], Vec::as_slice) }
    }

    /// Remembers what is expected of the neighbours in this tick.
    fn expect(&mut self, expectations: &[Expectation]) {
        let full = self.expected.len() > self.lag;
        let mut oldest = if full { self.expected.pop_front().unwrap_or_default() } else { Vec::new() };
        oldest.clear();
        oldest.extend_from_slice(expectations);
        self.expected.push_back(oldest);
    }
}

/// The entry that `is_it` accepts. It is usually the one at the index `guess`.
fn find<T>(list: &[T], guess: usize, is_it: impl Fn(&T) -> bool) -> Option<&T> {
    list.get(guess).filter(|one| is_it(one)).or_else(|| list.iter().find(|one| is_it(one)))
}

/// What is remembered of the neighbours.
#[derive(Clone, Copy)]
struct Memory<'a> {
    /// As they were in the last tick.
    last: &'a [Expectation],
    /// What was expected of them in the tick whose commands take effect now.
    due: &'a [Expectation],
}

/// The assessment of a neighbour.
#[derive(Clone, Copy, Debug)]
struct Assessed {
    barrier: Barrier,
    /// Its acceleration as sensed, m/s².
    braking: Vec2,
    /// Shortfall of its acceleration against its share, m/s².
    missing: f64,
    /// Whether it has priority over other neighbours.
    first: bool,
}

impl Expectation {
    /// Shortfall of the neighbour's acceleration against its share, m/s². `sensed`: its sensed acceleration in the tick in
    /// which its share was due, m/s². This drone makes up for the shortfall, whether the neighbour is dead, brakes, or cannot
    /// evade.
    fn missing(&self, sensed: Vec2) -> f64 {
        (self.due + sensed.dot(&self.normal)).max(0.0)
    }
}

/// The barrier between this drone and a neighbour.
#[derive(Clone, Copy, Debug)]
struct Barrier {
    /// Unit vector from the neighbour to this drone.
    normal: Vec2,
    /// Largest allowed acceleration of the two drones towards each other, m/s². If negative, they have to accelerate apart.
    slack: f64,
    /// This drone's share of `slack`.
    share: f64,
    /// Distance beyond the distance to keep, m.
    beyond_m: f64,
}

impl SafetyParams {
    /// The reaction time, ticks.
    fn lag(&self) -> usize {
        (self.reaction_time_s / self.dt_s).round() as usize
    }

    /// Margin on the safe distance, m.
    fn margin_m(&self) -> f64 {
        (self.safe_distance_m * self.margin).max(self.scale.length(MIN_MARGIN_M))
    }

    /// Distance to keep from a drone whose state is known with a delay of `late_s`, m.
    pub(crate) fn keep_m(&self, late_s: f64) -> f64 {
        self.safe_distance_m + self.margin_m() + late_s * (1.0 + self.acceleration_max_mps2 * late_s)
    }

    /// Half-plane that keeps the drone clear of an obstacle. `all`: the obstacles in reach.
    fn obstacle_plane(&self, obstacle: &NearObstacle, velocity: Vec2, all: &[NearObstacle]) -> HalfPlane {
        let normal = obstacle.normal();
        let alpha = OBSTACLE_BRAKING * self.braking_mps2;
        let beyond_m = obstacle.distance_m - self.clearance_m - self.obstacle_margin_m(obstacle, all);
        let (root, slope) = self.root(alpha, beyond_m);
        let speed = normal.dot(&velocity);
        HalfPlane { normal, bound: -(self.gain_per_s * (root + speed) + slope * speed) }
    }

    /// The margin on the clearance from one obstacle, m. In a gap whose two sides leave less room than two margins, each side
    /// gets half of the room, so that the drone can fly through the middle.
    fn obstacle_margin_m(&self, obstacle: &NearObstacle, all: &[NearObstacle]) -> f64 {
        let opposite = all.iter().filter(|other| other.normal().dot(&obstacle.normal()) < OPPOSITE);
        let narrowest_m = opposite.map(|other| obstacle.distance_m + other.distance_m).fold(f64::INFINITY, f64::min);
        self.scale.length(OBSTACLE_MARGIN_M).min((narrowest_m / 2.0 - self.clearance_m).max(0.0))
    }

    /// A lower bound on the distance of a neighbour beyond the distance to keep, m, that does not depend on how old its beacon is.
    fn beyond_unsensed_m(&self, neighbour: &Neighbour) -> f64 {
        let keep_m = self.keep_m(self.reaction_time_s);
        // Where drones range each other less far than they keep apart, one that is not ranged needs no more room than one that is.
        let is_short = 0.0 < neighbour.least_m && neighbour.least_m < keep_m;
        let least_m = if is_short { neighbour.position_m.norm().max(neighbour.least_m) } else { neighbour.least_m };
        least_m - keep_m
    }

    /// Assesses a neighbour. Three kinds have priority over the others: a neighbour that cannot evade, one that has
    /// precedence in a queue and is non-cooperative, and one that has come deep into the margin. A silent neighbour that
    /// closes in faster than this drone does is not a hovering body and has to brake itself. It has no priority, so that a
    /// drone chased from behind does not fly into what is ahead. `at`: its index among the neighbours.
    fn assess(&self, neighbour: &Neighbour, velocity: Vec2, memory: Memory<'_>, at: usize) -> Assessed {
        let other_velocity = velocity + neighbour.velocity_mps;
        let (mut braking, mut missing) = (Vec2::zeros(), 0.0);
        if neighbour.sensed {
            let is_it = |expected: &Expectation| expected.id == neighbour.id;
            let before = find(memory.last, at, is_it);
            braking = before.map_or_else(Vec2::zeros, |before| (other_velocity - before.velocity) / self.dt_s);
            missing = find(memory.due, at, is_it).map_or(0.0, |expected| expected.missing(braking));
        }
        let barrier = self.neighbour_barrier(neighbour);
        let chased = barrier.normal.dot(&(velocity + other_velocity)) > 0.0;
        let intruded_m = self.keep_m(0.0) - INTRUSION * self.margin_m();
        let first = (neighbour.share >= 1.0 && !chased)
            || (neighbour.share > 0.5 && missing > self.scale.length(NON_COOPERATIVE_MPS2))
            || (neighbour.sensed && neighbour.position_m.norm() < intruded_m);
        Assessed { barrier, braking, missing, first }
    }

    fn neighbour_barrier(&self, neighbour: &Neighbour) -> Barrier {
        let distance = neighbour.position_m.norm().max(1e-6);
        let normal = -neighbour.position_m / distance;
        let velocity = -neighbour.velocity_mps;
        // The state is old and the reaction is late. Meanwhile the neighbour may have turned.
        let late_s = neighbour.age_s + if neighbour.sensed { self.reaction_time_s } else { 0.0 };
        let alpha = self.braking_mps2;
        let unsensed_m = self.beyond_unsensed_m(neighbour);
        let beyond_m = (distance - self.keep_m(late_s)).max(unsensed_m);
        let (root, slope) = self.root(alpha, beyond_m);
        let speed = normal.dot(&velocity);
        let turning = (velocity.norm_squared() - speed * speed) / distance;
        let slack = self.gain_per_s * (root + speed) + turning + slope * speed;
        // The two drones share remaining room equally. They share an evasion by precedence.
        let share = if slack < 0.0 { neighbour.share } else { neighbour.share.min(0.5) };
        Barrier { normal, slack, share, beyond_m }
    }

    /// Half-plane that keeps this drone far enough behind a drone that flies away, so that it can stop if the other brakes:
    /// v ≤ √(u² + 2 a x). v and u are the speeds of this drone and of the other along the line between them. `braking`: the
    /// other's sensed acceleration, m/s². `None` if one of the two does not fly in that direction.
    fn following_plane(&self, other: &Neighbour, barrier: &Barrier, own: Vec2, braking: Vec2) -> Option<HalfPlane> {
        let (normal, other_velocity) = (barrier.normal, own + other.velocity_mps);
        let (own_speed, other_speed) = (-own.dot(&normal), -other_velocity.dot(&normal));
        if other_speed <= 0.0 || own_speed <= 0.0 {
            return None;
        }
        let stop = self.braking_mps2;
        let least_mps = self.scale.speed(MIN_LIMIT_MPS);
        let limit = (other_speed * other_speed + 2.0 * stop * barrier.beyond_m).max(least_mps * least_mps).sqrt();
        let apart = -other.velocity_mps;
        let turn = (apart - normal * apart.dot(&normal)) / other.position_m.norm().max(1e-6);
        let slowing = other_speed * (-braking.dot(&normal) - other_velocity.dot(&turn)) + stop * apart.dot(&normal);
        let bound = -self.gain_per_s * (limit - own_speed) - own.dot(&turn) - slowing / limit;
        Some(HalfPlane { normal, bound })
    }

    /// √(2 α x), m/s, and its slope, 1/s. Below `TANGENT_M` the root is continued by its tangent.
    fn root(&self, alpha: f64, x: f64) -> (f64, f64) {
        let tangent_m = self.scale.length(TANGENT_M);
        if x < tangent_m {
            let least = (2.0 * alpha * tangent_m).sqrt();
            let slope = alpha / least;
            return (least + slope * (x - tangent_m), slope);
        }
        let root = (2.0 * alpha * x).sqrt();
        (root, alpha / root)
    }
}

#[cfg(test)]
mod tests;
