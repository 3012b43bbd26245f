//! Crowds of drones that all follow the safety rule of `skein_agent::braking_filter`, for any commands that they want.
#![allow(clippy::unwrap_used, dead_code)]

pub(crate) mod words;

use skein_agent::braking_filter::{BrakingFilter, BrakingFilterParams, Moving, OwnMotion};
use skein_agent::braking_path::{BrakingLaw, BrakingPath};
use skein_leader::geometry::nearest;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{SimTime, Vec2};
use std::collections::VecDeque;

fn law(params: &BrakingFilterParams) -> BrakingLaw {
    BrakingLaw { deceleration_mps2: params.braking_mps2, dt_s: params.dt_s }
}

/// Acceleration of full braking, m/s².
fn braking(params: &BrakingFilterParams, velocity: Vec2) -> Vec2 {
    let (speed, step) = (velocity.norm(), params.braking_mps2 * params.dt_s);
    if speed > step { velocity * (-params.braking_mps2 / speed) } else { -velocity / params.dt_s }
}

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
        let mut crowd = Self { params, tick, bodies: Vec::new(), lag, pending: Vec::new(), obstacles };
        for _ in 0..drones * 20 {
            let position = Vec2::new(random.within(-side_m, side_m), random.within(-side_m, side_m));
            let body = (position, random.disc(params.speed_max_mps));
            if crowd.bodies.len() < drones && crowd.admits(body) {
                crowd.bodies.push(body);
                // The first `lag` commands of each drone are full braking.
                let (mut velocity, mut pending) = (body.1, VecDeque::new());
                for _ in 0..lag {
                    let braking = braking(&params, velocity);
                    velocity += braking * params.dt_s;
                    pending.push_back(braking);
                }
                crowd.pending.push(pending);
            }
        }
        crowd
    }

    /// Whether the braking path of a body keeps all distances from the obstacles and the drones so far.
    fn admits(&self, (position, velocity): (Vec2, Vec2)) -> bool {
        let law = law(&self.params);
        let path = BrakingPath::new(position, velocity, law);
        let keep_m = self.params.safe_distance_m + self.params.margin_m();
        let clear_m = self.params.clearance_m + 0.01;
        let clear = |shape: &ConvexShape| {
            let along = path.end() - path.start();
            (0..=100).all(|k| {
                shape_distance_m(shape, path.start() + along * (f64::from(k) / 100.0)) >= clear_m + along.norm() / 100.0
            })
        };
        let apart = |other: &(Vec2, Vec2)| {
            let other_path = BrakingPath::new(other.0, other.1, law);
            (0..=path.ticks().max(other_path.ticks())).all(|k| (path.at(k) - other_path.at(k)).norm() >= keep_m)
        };
        self.obstacles.iter().all(clear) && self.bodies.iter().all(apart)
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

    /// One tick of all drones. Each drone decides by what it senses at the start of the tick.
    fn step(&mut self, filters: &mut [BrakingFilter], wish: Wish, random: &mut Keyed) {
        let before = self.bodies.clone();
        for (i, filter) in filters.iter_mut().enumerate() {
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
                speed_limit_mps: f64::INFINITY,
                lag: self.lag,
            };
            let obstacles = self.obstacles.iter().map(|shape| (shape, shape_distance_m(shape, position)));
            let neighbours = before.iter().enumerate().filter(|(j, _)| *j != i);
            let neighbours = neighbours.map(|(_, b)| Moving { position_m: b.0 - before[i].0, velocity_mps: b.1 });
            let wanted = self.wish(i, wish, random);
            let acceleration = filter.filter(&own, wanted, obstacles, neighbours, std::iter::empty());
            assert!(acceleration.norm() <= self.params.acceleration_max_mps2 * (1.0 + 1e-9));
            self.pending[i].push_back(acceleration);
            let command = self.pending[i].pop_front().unwrap();
            self.bodies[i] = self.fly(before[i], command);
            assert!(self.bodies[i].1.norm() <= self.params.speed_max_mps + 1e-6);
        }
        self.tick += 1;
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

/// Flies a crowd. Returns the least distance beyond the distance to keep, m, and the number of drone-ticks flown.
pub(crate) fn fly(seed: u64, drones: usize, density: f64, ticks: usize, wish: Wish, lag: u32) -> (f64, usize) {
    let mut crowd = Crowd::random(seed, drones, density, lag);
    let mut random = Keyed(seed ^ 0xabcdef);
    let mut filters = vec![BrakingFilter::new(crowd.params); crowd.bodies.len()];
    let mut least_m = crowd.least_m();
    for _ in 0..ticks {
        crowd.step(&mut filters, wish, &mut random);
        least_m = least_m.min(crowd.least_m());
    }
    (least_m, ticks * crowd.bodies.len())
}
