//! Crowds of drones that all follow the safety rule of `skein_agent::braking_filter`, for any commands that they want.
#![allow(clippy::unwrap_used, dead_code)]

pub(crate) mod blind;
pub(crate) mod errors;
pub(crate) mod words;

use skein_agent::braking_filter::{BrakingFilter, BrakingFilterParams, Moving, OwnMotion};
use skein_agent::braking_path::BrakingPath;
use skein_leader::geometry::nearest;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{DroneId, SimTime, Vec2};
use std::collections::VecDeque;

/// A crowd whose drones all follow the rule.
#[derive(Clone, Debug)]
pub(crate) struct Crowd {
    params: BrakingFilterParams,
    tick: u64,
    /// Position, m, and velocity, m/s, of each drone.
    bodies: Vec<(Vec2, Vec2)>,
    /// Delay from a command to its effect, ticks.
    lag: u32,
    /// Commands of each drone that have not taken effect yet, m/s², the oldest first.
    pending: Vec<VecDeque<Vec2>>,
    /// For each drone, the tick in which it comes back; in the past if its process runs.
    frozen: Vec<u64>,
    /// Drones sense each other within this distance, m.
    ranging_m: f64,
    /// Greatest speed of a drone that senses so far, m/s.
    speed_limit_mps: f64,
    obstacles: Vec<ConvexShape>,
}

/// The commands that the drones of a crowd want. Each kind tries to violate the distances.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wish {
    /// All drones fly to one point.
    Gather,
    /// Each drone flies towards a point beyond the drone with the mirrored index.
    Swap,
    /// Each drone flies straight at the nearest other one.
    Chase,
    /// Half of the drones circle the origin to the left, the other half to the right.
    Rotate,
    /// Full acceleration in a direction that changes at random.
    Erratic,
}

/// A linear congruential generator (Knuth, MMIX). A seed gives the same crowd on every machine.
pub(crate) struct Keyed(pub u64);

impl Keyed {
    /// Next number, from 0 to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / (1u64 << 53) as f64
    }

    /// Next number, from `low` to `high`.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Next point, uniformly distributed in a disc around the origin.
    fn disc(&mut self, radius: f64) -> Vec2 {
        let (angle, r) = (self.within(0.0, std::f64::consts::TAU), radius * self.unit().sqrt());
        Vec2::new(angle.cos(), angle.sin()) * r
    }
}

/// Distance between a point and a shape, m.
fn shape_distance_m(shape: &ConvexShape, point: Vec2) -> f64 {
    let core: Vec<Vec2> = shape.vertices().collect();
    (nearest(&core, point) - point).norm() - shape.radius_m
}

impl Crowd {
    /// A crowd in random states whose braking paths keep all distances. It has at most `drones` drones; fewer if they do not fit.
    fn random(seed: u64, drones: usize, density: f64, lag: u32) -> Self {
        let mut random = Keyed(seed);
        random.unit();
        let safe_distance_m = random.within(1.0, 40.0);
        let acceleration_max_mps2 = random.within(1.0, 10.0);
        let params = BrakingFilterParams {
            safe_distance_m,
            clearance_m: random.within(0.5, 20.0),
            acceleration_max_mps2,
            braking_mps2: acceleration_max_mps2 * random.within(0.5, 1.0),
            speed_max_mps: random.within(2.0, 25.0),
            dt_s: [0.005, 0.01, 0.02, 0.05, 0.1][(random.unit() * 5.0) as usize],
        };
        let side_m = (drones as f64).sqrt() * safe_distance_m * density;
        let obstacles = (0..(random.unit() * 4.0) as usize)
            .map(|_| {
                let centre = Vec2::new(random.within(-side_m, side_m), random.within(-side_m, side_m));
                let half = Vec2::new(random.within(1.0, 30.0), random.within(1.0, 30.0));
                if random.unit() < 0.5 {
                    ConvexShape::circle(centre, half.x).unwrap()
                } else {
                    ConvexShape::rectangle(centre, half, random.within(0.0, 3.0)).unwrap()
                }
            })
            .collect();
        let tick = (random.unit() * 1e4) as u64;
        let stop_m = params.speed_max_mps * params.speed_max_mps / (2.0 * params.braking_mps2);
        let room_m = if random.unit() < 0.5 { f64::INFINITY } else { stop_m * random.within(0.2, 1.5) };
        let speed_limit_mps = params.speed_within_mps(room_m, lag).min(params.speed_max_mps);
        let mut crowd = Self {
            params,
            tick,
            bodies: Vec::new(),
            lag,
            pending: Vec::new(),
            frozen: Vec::new(),
            ranging_m: params.keep_m() + 2.0 * room_m,
            speed_limit_mps,
            obstacles,
        };
        for _ in 0..drones * 20 {
            let position = Vec2::new(random.within(-side_m, side_m), random.within(-side_m, side_m));
            let body = (position, random.disc(speed_limit_mps));
            if crowd.bodies.len() < drones && crowd.admits(body) {
                crowd.bodies.push(body);
                crowd.pending.push(crowd.braking_commands(body.1));
                crowd.frozen.push(0);
            }
        }
        crowd
    }

    /// As many commands as are late: full braking.
    fn braking_commands(&self, mut velocity: Vec2) -> VecDeque<Vec2> {
        let law = self.params.law();
        let next = |_| {
            let braking = law.braking(velocity);
            velocity += braking * law.dt_s;
            braking
        };
        (0..self.lag).map(next).collect()
    }

    /// Whether the braking path of a body keeps all distances from the obstacles and the drones so far.
    fn admits(&self, (position, velocity): (Vec2, Vec2)) -> bool {
        let law = self.params.law();
        let path = BrakingPath::new(position, velocity, law);
        let keep_m = self.params.safe_distance_m + self.params.margin_m();
        let apart = |other: &(Vec2, Vec2)| {
            let other_path = BrakingPath::new(other.0, other.1, law);
            (0..=path.ticks().max(other_path.ticks())).all(|k| (path.at(k) - other_path.at(k)).norm() >= keep_m)
        };
        self.is_clear(path.start(), path.end()) && self.bodies.iter().all(apart)
    }

    /// Whether a straight way keeps the clearance from all obstacles.
    fn is_clear(&self, from: Vec2, to: Vec2) -> bool {
        let (clear_m, along) = (self.params.clearance_m + 0.01, to - from);
        let is_clear = |shape: &ConvexShape, k: i32| {
            shape_distance_m(shape, from + along * (f64::from(k) / 100.0)) >= clear_m + along.norm() / 100.0
        };
        self.obstacles.iter().all(|shape| (0..=100).all(|k| is_clear(shape, k)))
    }

    /// The acceleration that drone `i` wants, m/s².
    fn wish(&self, i: usize, wish: Wish, random: &mut Keyed) -> Vec2 {
        let (position, velocity) = self.bodies[i];
        let towards = |target: Vec2| (target - position) * 2.0 - velocity;
        match wish {
            Wish::Gather => towards(Vec2::zeros()),
            Wish::Swap => towards(-self.bodies[self.bodies.len() - 1 - i].0 * 1.5),
            Wish::Chase => {
                let others = self.bodies.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, body)| body.0);
                let nearest = others.min_by(|a, b| (a - position).norm().total_cmp(&(b - position).norm()));
                towards(nearest.unwrap_or_default()) * 10.0
            }
            Wish::Rotate => {
                let turn = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
                Vec2::new(-position.y, position.x) * turn - velocity
            }
            Wish::Erratic => random.disc(1.0).normalize() * 100.0,
        }
    }

    /// Position and velocity after one tick.
    fn fly(&self, (position, velocity): (Vec2, Vec2), acceleration: Vec2) -> (Vec2, Vec2) {
        let next = velocity + acceleration * self.params.dt_s;
        (position + (velocity + next) * (self.params.dt_s / 2.0), next)
    }

    /// Each drone obeys its oldest pending command for a tick. Returns the length of all ways together, m.
    fn fly_pending(&mut self) -> f64 {
        let mut flown_m = 0.0;
        for i in 0..self.bodies.len() {
            let command = self.pending[i].pop_front().unwrap();
            let next = self.fly(self.bodies[i], command);
            flown_m += (next.0 - self.bodies[i].0).norm();
            self.bodies[i] = next;
        }
        self.tick += 1;
        flown_m
    }

    /// One tick of all drones. Each drone decides by what it senses at the start of the tick. `freezes`: share of the time in which the
    /// process of a drone is stopped. The body of such a drone brakes fully, and its commands are void.
    fn step(&mut self, filters: &mut [BrakingFilter], wish: Wish, freezes: f64, random: &mut Keyed) {
        let before = self.bodies.clone();
        for (i, filter) in filters.iter_mut().enumerate() {
            let begins = random.unit() < freezes / f64::from(FROZEN_TICKS);
            if begins && self.frozen[i] < self.tick {
                self.frozen[i] = self.tick + (random.unit() * 2.0 * f64::from(FROZEN_TICKS)) as u64;
            }
            if self.tick <= self.frozen[i] {
                self.bodies[i] = self.fly(before[i], self.params.law().braking(before[i].1));
                self.pending[i] = self.braking_commands(self.bodies[i].1);
                if self.tick == self.frozen[i] {
                    filter.forget();
                }
                continue;
            }
            let command = self.command(i, filter, &before, wish, random);
            assert!(command.norm() <= self.params.acceleration_max_mps2 * (1.0 + 1e-9));
            self.pending[i].push_back(command);
            let command = self.pending[i].pop_front().unwrap();
            self.bodies[i] = self.fly(before[i], command);
            assert!(self.bodies[i].1.norm() <= self.params.speed_max_mps + 1e-6);
        }
        self.tick += 1;
    }

    /// The command of drone `i`, m/s². `before`: the states that it senses.
    fn command(
        &self,
        i: usize,
        filter: &mut BrakingFilter,
        before: &[(Vec2, Vec2)],
        wish: Wish,
        random: &mut Keyed,
    ) -> Vec2 {
        let (mut position, mut velocity) = before[i];
        for command in &self.pending[i] {
            (position, velocity) = self.fly((position, velocity), *command);
        }
        let own = OwnMotion {
            tick: self.tick,
            now: SimTime::ZERO,
            sensed_position: before[i].0,
            sensed_velocity: before[i].1,
            position,
            velocity,
            speed_limit_mps: self.speed_limit_mps,
            lag: self.lag,
        };
        let obstacles = self.obstacles.iter().map(|shape| (shape, shape_distance_m(shape, position)));
        let near = |b: Vec2| (b - before[i].0).norm() <= self.ranging_m;
        let neighbours = before.iter().enumerate().filter(|(j, b)| *j != i && near(b.0));
        let neighbours =
            neighbours.map(|(j, b)| Moving { id: DroneId(j as u32), position_m: b.0 - before[i].0, velocity_mps: b.1 });
        filter.filter(&own, self.wish(i, wish, random), obstacles, neighbours, std::iter::empty())
    }

    /// Least distance beyond the distance to keep, over all pairs of drones and all drones and obstacles, m.
    fn least_m(&self) -> f64 {
        let mut least_m = f64::INFINITY;
        for (i, (position, _)) in self.bodies.iter().enumerate() {
            for (other, _) in &self.bodies[i + 1..] {
                least_m = least_m.min((position - other).norm() - self.params.safe_distance_m);
            }
            for shape in &self.obstacles {
                least_m = least_m.min(shape_distance_m(shape, *position) - self.params.clearance_m);
            }
        }
        least_m
    }
}

pub(crate) const WISHES: [Wish; 5] = [Wish::Gather, Wish::Swap, Wish::Chase, Wish::Rotate, Wish::Erratic];

/// Mean time for which a process is stopped, ticks.
const FROZEN_TICKS: u32 = 20;

/// How a crowd was flown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flown {
    /// Least distance beyond the distance to keep, m.
    pub(crate) least_m: f64,
    /// Number of drone-ticks.
    pub(crate) drone_ticks: usize,
    /// Mean distance that a drone has flown, m.
    pub(crate) mean_m: f64,
}

/// Flies a crowd. `freezes`: share of the time in which the process of a drone is stopped.
pub(crate) fn fly(
    seed: u64,
    (drones, density): (usize, f64),
    ticks: usize,
    (wish, lag): (Wish, u32),
    freezes: f64,
) -> Flown {
    let mut crowd = Crowd::random(seed, drones, density, lag);
    let mut random = Keyed(seed ^ 0xabcdef);
    let mut filters = vec![BrakingFilter::new(crowd.params); crowd.bodies.len()];
    let (mut least_m, mut sum_m) = (crowd.least_m(), 0.0);
    for _ in 0..ticks {
        let before = crowd.bodies.clone();
        crowd.step(&mut filters, wish, freezes, &mut random);
        sum_m += before.iter().zip(&crowd.bodies).map(|(a, b)| (a.0 - b.0).norm()).sum::<f64>();
        least_m = least_m.min(crowd.least_m());
    }
    let n = crowd.bodies.len();
    Flown { least_m, drone_ticks: ticks * n, mean_m: sum_m / n.max(1) as f64 }
}
