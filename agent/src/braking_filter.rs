//! The safety rule: no command may move the drone's braking path towards a neighbour's by more than its share of the room
//! between the two, nor into an obstacle. `docs/safety.md` states and proves it.
//!
//! Let B be the path of a drone that brakes fully from now on. Two drones are safe if their braking paths keep the safe
//! distance at every time. A command changes the drone's braking path from B to B'. With n(t) the unit vector from the
//! neighbour's braking path to B at time t, and D(t) their distance, a command is allowed if for all t
//! n(t) · (B'(t) − B(t)) ≥ −s (D(t) − d). If both keep to this with s = ½, the new braking paths are at least d apart.
//! Full braking leaves B as it is, and is therefore always allowed.
//!
//! Braking paths are compared at ticks whose number is a multiple of a stride, the same ticks for all drones, so that the
//! invariant is exact there; [`BrakingFilterParams::margin_m`] bounds what can happen between them.

use crate::braking_path::{BrakingLaw, BrakingPath};
use crate::program::{HalfPlane, Program};
use skein_protocol::Vec2;
use skein_protocol::shape::{ConvexShape, MAX_VERTICES};

/// Constants of the rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingFilterParams {
    /// Least distance between two drones, m.
    pub safe_distance_m: f64,
    /// Least distance of a drone's centre to an obstacle, m.
    pub clearance_m: f64,
    /// Greatest acceleration, and deceleration of a drone that brakes fully, m/s².
    pub acceleration_max_mps2: f64,
    /// Greatest speed of any drone, m/s.
    pub speed_max_mps: f64,
    /// Length of a tick, s.
    pub dt_s: f64,
}

/// A neighbour as sensed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// Position relative to the drone, m.
    pub position_m: Vec2,
    /// Velocity in the world frame, m/s.
    pub velocity_mps: Vec2,
}

/// What the rule is applied to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnMotion {
    /// Number of the tick in which the command takes effect.
    pub tick: u64,
    /// Position, world frame, m.
    pub position: Vec2,
    /// Velocity, world frame, m/s.
    pub velocity: Vec2,
    /// The speed up to which the drone can stop within what it senses, m/s.
    pub speed_limit_mps: f64,
    /// Ticks that a command takes until it has effect.
    pub lag: u32,
}

/// The share of the room between two braking paths that each of the two drones may use in a tick.
const SHARE: f64 = 0.5;
/// Greatest margin for what happens between the compared ticks, as a share of the safe distance.
const MARGIN_SHARE: f64 = 0.01;
/// Obstacles are kept so much farther away than the clearance, m: what is rounded must not count.
const CLEARANCE_ROUNDING_M: f64 = 1e-3;
/// Rounds of adding half-planes, before the command is moved towards full braking.
const ROUNDS: usize = 8;
/// Halvings of the interval between full braking and the command that was found.
const HALVINGS: usize = 10;
/// A condition that is missed by less is met, m.
const MET_M: f64 = 1e-9;

impl BrakingFilterParams {
    /// Added to the safe distance for what happens between the compared ticks, m.
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        MARGIN_SHARE * self.safe_distance_m
    }

    /// Every how many ticks two braking paths are compared. Between two compared times, h apart, the distance of two
    /// paths is by at most h²/8 · (v²/D + 2a) less than at the nearer one, with v the relative speed, at most twice the
    /// greatest speed.
    fn stride(&self) -> u32 {
        let relative_mps = 2.0 * self.speed_max_mps;
        let bend = relative_mps * relative_mps / self.safe_distance_m + 2.0 * self.acceleration_max_mps2;
        ((8.0 * self.margin_m() / bend).sqrt() / self.dt_s).max(1.0) as u32
    }

    fn law(&self) -> BrakingLaw {
        BrakingLaw { deceleration_mps2: self.acceleration_max_mps2, dt_s: self.dt_s }
    }

    /// The speed from which a drone stops within `room_m`, if it first flies on for a tick and `lag` more, m/s.
    #[must_use]
    pub fn speed_within_mps(&self, room_m: f64, lag: u32) -> f64 {
        let late_s = f64::from(lag + 2) * self.dt_s;
        let brake = self.acceleration_max_mps2;
        (brake * late_s).hypot((2.0 * brake * room_m.max(0.0)).sqrt()) - brake * late_s
    }

    /// Distance that a drone flies until it hangs, at most, if it may accelerate for one more tick, m.
    fn reach_m(&self, speed_squared: f64) -> f64 {
        let step_mps = self.acceleration_max_mps2 * self.dt_s;
        let speed_mps = speed_squared.sqrt() + step_mps;
        speed_mps * speed_mps / (2.0 * self.acceleration_max_mps2) + speed_mps * self.dt_s
    }
}

/// Two braking paths at one compared tick.
#[derive(Clone, Copy, Debug)]
struct Sample {
    ticks: u32,
    /// From the neighbour's path to this drone's, unit vector.
    normal: Vec2,
    /// This drone's position on its own braking path, relative to now, m.
    own_m: Vec2,
    /// How far the path may move towards the other, m.
    room_m: f64,
}

/// The filter and its memory. One per drone.
#[derive(Clone, Debug)]
pub struct BrakingFilter {
    params: BrakingFilterParams,
    stride: u32,
    samples: Vec<Sample>,
    /// Where the samples of each near neighbour end.
    ends: Vec<usize>,
    planes: Vec<HalfPlane>,
    program: Program,
}

/// A command, and the braking path that it leaves.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    acceleration: Vec2,
    /// From the end of this tick on; relative to the drone's position now.
    path: BrakingPath,
}

impl BrakingFilter {
    /// A filter with these constants.
    #[must_use]
    pub fn new(params: BrakingFilterParams) -> Self {
        let stride = params.stride();
        Self { params, stride, samples: Vec::new(), ends: Vec::new(), planes: Vec::new(), program: Program::default() }
    }

    /// Its constants.
    #[must_use]
    pub fn params(&self) -> &BrakingFilterParams {
        &self.params
    }

    /// The allowed acceleration nearest to `wanted` that is found, m/s²: `wanted` itself if it is allowed, full braking at
    /// worst. `obstacles` in the world frame.
    pub fn filter<'a>(
        &mut self,
        own: &OwnMotion,
        wanted: Vec2,
        obstacles: impl Iterator<Item = (&'a ConvexShape, f64)> + Clone,
        neighbours: impl Iterator<Item = Moving>,
    ) -> Vec2 {
        self.compare(own, neighbours);
        let reach_m = self.params.reach_m(own.velocity.norm_squared()) + self.params.clearance_m + CLEARANCE_ROUNDING_M;
        let near = obstacles.filter(move |(_, distance_m)| *distance_m <= reach_m).map(|(shape, _)| shape);
        let limit = self.params.acceleration_max_mps2;
        let wanted = if wanted.norm() > limit { wanted * (limit / wanted.norm()) } else { wanted };
        let mut candidate = self.candidate(own, wanted);
        self.planes.clear();
        for _ in 0..ROUNDS {
            let before = self.planes.len();
            self.cut(own, &candidate, near.clone());
            if self.planes.len() == before {
                return candidate.acceleration;
            }
            let next = self.program.solve(&self.planes, [0; 2], limit, wanted);
            candidate = self.candidate(own, next);
        }
        self.towards_braking(own, candidate.acceleration, near)
    }

    fn candidate(&self, own: &OwnMotion, acceleration: Vec2) -> Candidate {
        let dt_s = self.params.dt_s;
        let velocity = own.velocity + acceleration * dt_s;
        let start = (own.velocity + velocity) * (dt_s / 2.0);
        Candidate { acceleration, path: BrakingPath::new(start, velocity, self.params.law()) }
    }

    /// Full braking, m/s².
    fn braking(&self, velocity: Vec2) -> Vec2 {
        let (speed, step) = (velocity.norm(), self.params.acceleration_max_mps2 * self.params.dt_s);
        if speed > step {
            velocity * (-self.params.acceleration_max_mps2 / speed)
        } else {
            -velocity / self.params.dt_s
        }
    }

    /// Compares the braking paths of neighbours that any command could bring too close.
    fn compare(&mut self, own: &OwnMotion, neighbours: impl Iterator<Item = Moving>) {
        let params = self.params;
        self.samples.clear();
        self.ends.clear();
        let late_s = f64::from(own.lag) * params.dt_s;
        let late_m = late_s * (1.0 + params.acceleration_max_mps2 * late_s);
        let keep_m = params.safe_distance_m + params.margin_m() + late_m;
        let (own_speed2, limit) = (own.velocity.norm_squared(), params.acceleration_max_mps2);
        let own_reach_m = params.reach_m(own_speed2);
        let path = BrakingPath::new(Vec2::zeros(), own.velocity, params.law());
        for other in neighbours {
            let (distance2, speed2) = (other.position_m.norm_squared(), other.velocity_mps.norm_squared());
            let apart_m = keep_m + own_reach_m + params.reach_m(speed2);
            if distance2 > apart_m * apart_m {
                continue;
            }
            // Full braking is a projection, and projections bring nothing farther apart: the distance of two braking
            // paths changes by at most the relative speed times the time until both hang.
            let stop_s = own_speed2.max(speed2).sqrt() / limit + 2.0 * params.dt_s;
            let room_m = distance2.sqrt() - keep_m - (other.velocity_mps - own.velocity).norm() * stop_s;
            if SHARE * room_m >= 2.0 * limit * params.dt_s * stop_s {
                continue;
            }
            let theirs = BrakingPath::new(other.position_m, other.velocity_mps, params.law());
            self.sample(own.tick, &path, &theirs, keep_m);
        }
    }

    fn sample(&mut self, tick: u64, own: &BrakingPath, theirs: &BrakingPath, keep_m: f64) {
        let stride = u64::from(self.stride);
        // A command may prolong the own path by a tick.
        let last = own.ticks().max(theirs.ticks()) + 2;
        let mut ticks = 1;
        loop {
            let (here, there) = (own.at(ticks), theirs.at(ticks));
            let (offset, distance_m) = (here - there, (here - there).norm());
            let normal = if distance_m > 1e-9 { offset / distance_m } else { Vec2::x() };
            let room_m = SHARE * (distance_m - keep_m).max(0.0);
            self.samples.push(Sample { ticks, normal, own_m: here, room_m });
            if ticks >= last {
                break;
            }
            let next = (tick + u64::from(ticks)) / stride * stride + stride - tick;
            ticks = next as u32;
        }
        self.ends.push(self.samples.len());
    }

    /// Adds a half-plane for each condition that the candidate breaks.
    fn cut<'a>(&mut self, own: &OwnMotion, candidate: &Candidate, obstacles: impl Iterator<Item = &'a ConvexShape>) {
        let dt_s = self.params.dt_s;
        let mut plane = |normal: Vec2, slope: Vec2, missing_m: f64| {
            // To first order the condition grows by `slope` · change of the acceleration.
            let gradient = (slope + normal * (dt_s / 2.0)) * dt_s;
            let steepness = gradient.norm();
            if steepness > 1e-12 {
                let bound = (gradient.dot(&candidate.acceleration) + missing_m) / steepness;
                self.planes.push(HalfPlane { normal: gradient / steepness, bound });
            }
        };
        let mut first = 0;
        for &end in &self.ends {
            let missing = |s: &Sample| -s.room_m - s.normal.dot(&(candidate.path.at(s.ticks - 1) - s.own_m));
            let worst =
                self.samples[first..end].iter().map(|s| (missing(s), s)).reduce(|a, b| if b.0 > a.0 { b } else { a });
            first = end;
            if let Some((missing_m, s)) = worst.filter(|(missing_m, _)| *missing_m > MET_M) {
                plane(s.normal, candidate.path.pull_back(s.ticks - 1, s.normal), missing_m);
            }
        }
        for shape in obstacles {
            if let Some(hit) = self.params.hit(own, candidate, shape) {
                plane(hit.normal, candidate.path.pull_back_at(hit.share, hit.normal), hit.missing_m);
            }
        }
        let speed_limit_mps = self.params.speed_limit_mps(own);
        let velocity = own.velocity + candidate.acceleration * dt_s;
        let speed = velocity.norm();
        if speed > speed_limit_mps + MET_M {
            let normal = -velocity / speed;
            let bound = (normal.dot(&candidate.acceleration) * dt_s + (speed - speed_limit_mps)) / dt_s;
            self.planes.push(HalfPlane { normal, bound });
        }
    }

    /// The command nearest to `found` between it and full braking that is allowed, as far as halving finds it.
    fn towards_braking<'a>(
        &mut self,
        own: &OwnMotion,
        found: Vec2,
        obstacles: impl Iterator<Item = &'a ConvexShape> + Clone,
    ) -> Vec2 {
        let braking = self.braking(own.velocity);
        let (mut allowed, mut forbidden) = (0.0, 1.0);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let candidate = self.candidate(own, braking + (found - braking) * share);
            self.planes.clear();
            self.cut(own, &candidate, obstacles.clone());
            if self.planes.is_empty() {
                allowed = share;
            } else {
                forbidden = share;
            }
            if allowed >= 1.0 {
                break;
            }
            share = (allowed + forbidden) / 2.0;
        }
        braking + (found - braking) * allowed
    }
}

/// A braking path that comes too close to an obstacle.
struct Hit {
    /// Away from the obstacle.
    normal: Vec2,
    /// At which share of the path.
    share: f64,
    missing_m: f64,
}

impl BrakingFilterParams {
    fn speed_limit_mps(&self, own: &OwnMotion) -> f64 {
        let braked = own.velocity.norm() - self.acceleration_max_mps2 * self.dt_s;
        own.speed_limit_mps.min(self.speed_max_mps).max(braked)
    }

    fn hit(&self, own: &OwnMotion, candidate: &Candidate, shape: &ConvexShape) -> Option<Hit> {
        let (from, to) = (own.position + candidate.path.start(), own.position + candidate.path.end());
        let nearest = segment_to_core(shape, from, to);
        let keep_m = self.clearance_m + CLEARANCE_ROUNDING_M;
        let distance_m = nearest.distance_m - shape.radius_m;
        if distance_m >= keep_m {
            return None;
        }
        let braked = BrakingPath::new(own.position, own.velocity, self.law());
        // Who is too close already may come no closer than by braking.
        let braked_m = segment_to_core(shape, braked.start(), braked.end()).distance_m - shape.radius_m;
        let missing_m = keep_m.min(braked_m) - distance_m;
        (missing_m > MET_M).then_some(Hit { normal: nearest.normal, share: nearest.share, missing_m })
    }
}

/// A segment's point that is nearest to the core of a shape.
struct Nearest {
    distance_m: f64,
    /// From the core to the segment.
    normal: Vec2,
    /// Where on the segment, 0 to 1.
    share: f64,
}

/// Distance of a segment to the polygon of a shape's vertices, without the rounding; negative if it enters it. m.
pub(crate) fn core_distance_m(shape: &ConvexShape, from: Vec2, to: Vec2) -> f64 {
    segment_to_core(shape, from, to).distance_m
}

/// The core of a shape is the polygon of its vertices, without the rounding.
fn segment_to_core(shape: &ConvexShape, from: Vec2, to: Vec2) -> Nearest {
    let along = to - from;
    let length2 = along.norm_squared();
    let count = (shape.count as usize).min(MAX_VERTICES);
    let vertex = |i: usize| Vec2::from(shape.vertices_m[i % count]);
    let mut best = Nearest { distance_m: f64::INFINITY, normal: Vec2::x(), share: 0.0 };
    let mut take = |on_core: Vec2, share: f64| {
        let offset = from + along * share - on_core;
        let distance_m = offset.norm();
        if distance_m < best.distance_m {
            let normal = if distance_m > 1e-9 { offset / distance_m } else { best.normal };
            best = Nearest { distance_m, normal, share };
        }
    };
    let mut crossing = None;
    let mut inside = count >= 3;
    for i in 0..count {
        let a = vertex(i);
        let edge = vertex(i + 1) - a;
        let share = if length2 > 0.0 { ((a - from).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        take(a, share);
        for (end, share) in [(from, 0.0), (to, 1.0)] {
            let edge2 = edge.norm_squared();
            let t = if edge2 > 0.0 { ((end - a).dot(&edge) / edge2).clamp(0.0, 1.0) } else { 0.0 };
            take(a + edge * t, share);
        }
        inside &= edge.perp(&(from - a)) >= 0.0;
        let (turn, reach) = (along.perp(&edge), a - from);
        if turn.abs() > 1e-12 {
            let (t, u) = (reach.perp(&edge) / turn, reach.perp(&along) / turn);
            if (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&u) && crossing.is_none_or(|(earlier, _)| t < earlier) {
                crossing = Some((t, Vec2::new(edge.y, -edge.x).normalize()));
            }
        }
    }
    match crossing {
        // Vertices are counter-clockwise: the outer normal is to the right of an edge. Depth counts as negative distance.
        Some((t, normal)) if !inside => {
            let depth_m = -normal.dot(&(along * (1.0 - t)));
            Nearest { distance_m: -depth_m.max(0.0), normal, share: 1.0 }
        }
        _ if inside => Nearest { distance_m: -best.distance_m, normal: -best.normal, share: best.share },
        _ => best,
    }
}

#[cfg(test)]
mod tests;
