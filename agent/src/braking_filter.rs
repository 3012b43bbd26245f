//! The safety rule: no command may move the drone's braking path towards a neighbour's braking path by more than the drone's
//! share of the room between the two, nor into an obstacle. `docs/safety.md` states and proves the rule.
//!
//! Let B be the path of a drone that brakes fully from now on. Two drones are safe if their braking paths keep the safe
//! distance at every time. A command changes the drone's braking path from B to B'. With n(t) the unit vector from the
//! neighbour's braking path to B at time t, D(t) their distance, and d the distance to keep, a command is allowed if for all t
//! n(t) · (B'(t) − B(t)) ≥ −s (D(t) − d). If both drones obey this with s = ½, their new braking paths are at least d apart.
//! Full braking leaves B unchanged and is therefore always allowed.
//!
//! If commands take effect late, the filter remembers what it has sensed, and keeps to lines that both drones compute from it: see
//! `docs/safety.md`, "Reaction time". It is then called once per tick.
//!
//! Braking paths are compared at ticks whose number is a multiple of a stride. These ticks are the same for all drones, so the
//! invariant is exact there. [`BrakingFilterParams::margin_m`] covers the loss of distance between the compared ticks.
//!
//! A drone that senses no neighbours keeps to the lines of [`crate::separation`] instead.
//!
//! # Example
//!
//! Two drones fly at each other at 10 m/s and wish to accelerate. The rule makes this one brake in time.
//!
//! ```
//! use skein_agent::braking_filter::{BrakingFilter, BrakingFilterParams, Moving, OwnMotion};
//! use skein_protocol::{DroneId, SimTime, Vec2};
//!
//! let mut filter = BrakingFilter::new(BrakingFilterParams {
//!     safe_distance_m: 10.0,
//!     clearance_m: 5.0,
//!     acceleration_max_mps2: 5.0,
//!     braking_mps2: 5.0,
//!     speed_max_mps: 20.0,
//!     dt_s: 0.02,
//! });
//! let (position, velocity) = (Vec2::zeros(), Vec2::new(10.0, 0.0));
//! let own = OwnMotion {
//!     tick: 0,
//!     now: SimTime::ZERO,
//!     sensed_position: position,
//!     sensed_velocity: velocity,
//!     position,
//!     velocity,
//!     speed_limit_mps: 20.0,
//!     lag: 0,
//! };
//! let wish = Vec2::new(5.0, 0.0);
//! let mut command = |ahead_m: f64| {
//!     let other = Moving { id: DroneId(1), position_m: Vec2::new(ahead_m, 0.0), velocity_mps: -velocity };
//!     filter.filter(&own, wish, [].into_iter(), [other].into_iter(), [].into_iter())
//! };
//! assert_eq!(command(500.0), wish, "there is room");
//! assert!(command(30.15).x < -4.0, "each needs 10 m to stop, and 10 m must remain");
//! ```

use crate::braking_motion::SHARE;
pub use crate::braking_motion::{BrakingFilterParams, Moving, OwnMotion};
use crate::braking_path::BrakingPath;
use crate::program::{HalfPlane, Program};
use crate::sensing_errors::SensingErrors;
use crate::separation::separating_line::{SeparatingLine, Side};
use crate::sights::Sights;
use skein_leader::nearest_on_segment::{NearestOnSegment, core_distance_m};
use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;
use std::cell::LazyCell;

/// Rounds in which half-planes are added. After them the command is moved towards full braking.
const ROUNDS: usize = 8;
/// Number of halvings of the interval between full braking and the command that was found.
const HALVINGS: usize = 10;
/// Tolerance of a condition, m (of the speed limit: m/s). A condition that is missed by at most this counts as met.
const MET_M: f64 = 1e-9;

/// Two braking paths at one compared tick.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Ticks from when the command takes effect.
    ticks: u32,
    /// Unit vector from the neighbour's path to this drone's path.
    normal: Vec2,
    /// Position on this drone's braking path from now on, relative to the position at which its command takes effect, m.
    own_m: Vec2,
    /// How far this drone's path may move towards the neighbour's path, m.
    room_m: f64,
}

/// The filter and its work buffers. One per drone.
#[derive(Clone, Debug)]
pub struct BrakingFilter {
    params: BrakingFilterParams,
    errors: SensingErrors,
    stride: u32,
    samples: Vec<Sample>,
    /// For each near neighbour, the end index of its samples in `samples`.
    ends: Vec<usize>,
    planes: Vec<HalfPlane>,
    program: Program,
    /// Only used while commands take effect late.
    sights: Sights,
}

/// A command, and the braking path after its tick.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    acceleration: Vec2,
    /// Braking path from the end of the command's tick on, relative to the position at which the command takes effect.
    path: BrakingPath,
}

impl BrakingFilter {
    /// Creates a filter with these constants.
    #[must_use]
    pub fn new(params: BrakingFilterParams) -> Self {
        let stride = params.stride();
        Self {
            params,
            errors: SensingErrors::default(),
            stride,
            samples: Vec::new(),
            ends: Vec::new(),
            planes: Vec::new(),
            program: Program::default(),
            sights: Sights::default(),
        }
    }

    /// The same filter for a drone whose senses have errors up to these bounds (docs/safety.md, "Real sensors").
    #[must_use]
    pub fn with_errors(self, errors: SensingErrors) -> Self {
        Self { errors, ..self }
    }

    /// Sets how far outlines are displaced from now on, relative to the drone, m.
    pub fn set_obstacle_error_m(&mut self, error_m: f64) {
        self.errors.obstacle_m = error_m;
    }

    /// The constants of the filter.
    #[must_use]
    pub fn params(&self) -> &BrakingFilterParams {
        &self.params
    }

    /// Returns the allowed acceleration nearest to `wanted` that the search finds, world frame, m/s². The norm of `wanted` is
    /// first limited to the greatest acceleration. The result is `wanted` itself if it is allowed, and full braking in the worst
    /// case. `obstacles`: each shape in the world frame, and its distance from where the drone's centre is when the command takes
    /// effect, m. `lines`: each line to which the drone is bound, and the drone's side of it.
    pub fn filter<'a>(
        &mut self,
        own: &OwnMotion,
        wanted: Vec2,
        obstacles: impl Iterator<Item = (&'a ConvexShape, f64)> + Clone,
        neighbours: impl Iterator<Item = Moving> + Clone,
        lines: impl Iterator<Item = (&'a SeparatingLine, Side)>,
    ) -> Vec2 {
        self.samples.clear();
        self.ends.clear();
        self.planes.clear();
        // With a reaction time the drone looks from elsewhere.
        let aside_m = if self.errors.partial_outlines { (own.position - own.sensed_position).norm() } else { 0.0 };
        let reach_m = self.params.reach_m(own.velocity.norm_squared(), 1).max(aside_m) + self.clear_m();
        let near = obstacles.filter(move |(_, distance_m)| *distance_m <= reach_m).map(|(shape, _)| shape);
        let limit = self.params.acceleration_max_mps2;
        let wanted = if wanted.norm() > limit { wanted * (limit / wanted.norm()) } else { wanted };
        let mut lines = lines.peekable();
        if own.lag == 0 && lines.peek().is_none() && self.is_far_from_all(own, wanted, neighbours.clone()) {
            let is_clear = near.clone().next().is_none() && self.too_fast(own, wanted).is_none();
            if is_clear || self.is_met(own, wanted, near.clone()) {
                return wanted;
            }
        }
        let mut candidate = self.candidate(own, wanted);
        if own.lag == 0 {
            self.compare(own, neighbours);
        } else if self.remember(own, neighbours) {
            return self.params.law().braking(own.velocity);
        }
        self.keep_to(own, lines);
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

    /// The distance from a sensed outline that is allowed without a further look, m.
    fn clear_m(&self) -> f64 {
        self.params.clear_m() + self.errors.obstacle_m
    }

    fn candidate(&self, own: &OwnMotion, acceleration: Vec2) -> Candidate {
        let dt_s = self.params.dt_s;
        let velocity = own.velocity + acceleration * dt_s;
        let start = (own.velocity + velocity) * (dt_s / 2.0);
        Candidate { acceleration, path: BrakingPath::new(start, velocity, self.params.law()) }
    }

    /// Whether this command is allowed with each neighbour, by a bound that needs no look at braking paths.
    fn is_far_from_all(
        &self,
        own: &OwnMotion,
        acceleration: Vec2,
        mut neighbours: impl Iterator<Item = Moving>,
    ) -> bool {
        let params = self.params;
        let change_mps = (acceleration - params.law().braking(own.velocity)).norm() * params.dt_s;
        let gap = params.gap_while_braking(own);
        neighbours.all(|other| gap(&other).is_none_or(|gap| gap.leaves_room(change_mps)))
    }

    /// Whether a command meets all conditions apart from those of the samples, of which there are none.
    fn is_met<'a>(&mut self, own: &OwnMotion, wanted: Vec2, near: impl Iterator<Item = &'a ConvexShape>) -> bool {
        self.cut(own, &self.candidate(own, wanted), near);
        let is_met = self.planes.is_empty();
        self.planes.clear();
        is_met
    }

    /// The velocity after a command's tick and the speed limit, m/s, if the velocity exceeds the limit.
    fn too_fast(&self, own: &OwnMotion, acceleration: Vec2) -> Option<(Vec2, f64)> {
        let (velocity, limit_mps) = (own.velocity + acceleration * self.params.dt_s, self.params.speed_limit_mps(own));
        (velocity.norm() > limit_mps + MET_M).then_some((velocity, limit_mps))
    }

    /// Samples the braking paths of this drone and of each neighbour that some command could bring too close.
    fn compare(&mut self, own: &OwnMotion, neighbours: impl Iterator<Item = Moving>) {
        let params = self.params;
        let change_mps = 2.0 * params.acceleration_max_mps2 * params.dt_s;
        let path = LazyCell::new(|| BrakingPath::new(Vec2::zeros(), own.velocity, params.law()));
        let gap = params.gap_while_braking(own);
        for other in neighbours {
            if gap(&other).is_none_or(|gap| gap.leaves_room(change_mps)) {
                continue;
            }
            let other_path = BrakingPath::new(other.position_m, other.velocity_mps, params.law());
            self.sample(own, &path, &other_path, params.keep_m());
        }
    }

    fn sample(&mut self, own: &OwnMotion, own_path: &BrakingPath, other_path: &BrakingPath, keep_m: f64) {
        // A command can lengthen this drone's path by one tick.
        let last = own_path.ticks().max(other_path.ticks()) + 2;
        self.sample_ticks(own, last, |ticks| {
            let (own_m, there) = (own_path.at(ticks), other_path.at(ticks));
            let (offset, distance_m) = (own_m - there, (own_m - there).norm());
            let normal = if distance_m > 1e-9 { offset / distance_m } else { Vec2::x() };
            Sample { ticks, normal, own_m, room_m: SHARE * (distance_m - keep_m).max(0.0) }
        });
    }

    /// Commands take effect late: samples the braking path of this drone for each line between it and a near neighbour. Returns
    /// whether there is a neighbour with which no line is common. The drone brakes then.
    fn remember(&mut self, own: &OwnMotion, neighbours: impl Iterator<Item = Moving>) -> bool {
        let mut sights = std::mem::take(&mut self.sights);
        sights.look(own, neighbours, &self.params, self.stride);
        let here_m = sights.flown_m() + own.position - own.sensed_position;
        let path = BrakingPath::new(Vec2::zeros(), own.velocity, self.params.law());
        for line in sights.lines() {
            let rests = line.rests().saturating_sub(own.tick) as u32;
            // A command can lengthen this drone's path by one tick.
            let last = (path.ticks() + own.lag + 2).max(rests);
            self.sample_ticks(own, last, |ticks| {
                let (own_m, line) = (path.at(ticks - own.lag), line.bisector(own.tick + u64::from(ticks)));
                let room_m = line.normal.dot(&(here_m + own_m)) - line.offset_m - line.keep_m;
                Sample { ticks: ticks - own.lag, normal: line.normal, own_m, room_m: room_m.max(0.0) }
            });
        }
        let must_brake = sights.must_brake();
        self.sights = sights;
        must_brake
    }

    /// Forgets what it knows of the neighbours. Call it after ticks in which the drone did not fly as commanded.
    pub fn forget(&mut self) {
        self.sights.forget();
    }

    /// Samples the braking path of this drone for each line that some command could bring too near.
    fn keep_to<'a>(&mut self, own: &OwnMotion, lines: impl Iterator<Item = (&'a SeparatingLine, Side)>) {
        let half_m = self.params.keep_m() / 2.0 + self.errors.position_m;
        let reach_m = self.params.reach_m(own.velocity.norm_squared(), 1);
        let law = self.params.law();
        let path = LazyCell::new(|| BrakingPath::new(Vec2::zeros(), own.velocity, law));
        let clock_s = self.errors.clock_s;
        let dt_s = self.params.dt_s;
        for (line, side) in lines {
            let inward = line.normal() * side.sign();
            let here_m = inward.dot(&own.position);
            let beyond_m = |offset_m: f64| here_m - side.sign() * offset_m - half_m;
            let begins_m = beyond_m(line.nearest_offset_m(side, own.now, f64::from(own.lag) * dt_s, clock_s));
            if begins_m.min(beyond_m(line.stop_m())) > reach_m {
                continue;
            }
            // Each command can lengthen this drone's path by one tick.
            let rests = ((line.rests_after_s(own.now) + clock_s) / dt_s).ceil() as u32;
            let last = (path.ticks() + own.lag + 2).max(rests);
            self.sample_ticks(own, last, |ticks| {
                let own_m = path.at(ticks - own.lag);
                let offset_m = line.nearest_offset_m(side, own.now, f64::from(ticks) * dt_s, clock_s);
                let room_m = (beyond_m(offset_m) + inward.dot(&own_m)).max(0.0);
                Sample { ticks: ticks - own.lag, normal: inward, own_m, room_m }
            });
        }
    }

    /// Adds a sample for the first tick that a command can change, for each compared tick after it, and for one at `last` or later.
    fn sample_ticks(&mut self, own: &OwnMotion, last: u32, sample: impl Fn(u32) -> Sample) {
        let (stride, tick) = (u64::from(self.stride), own.tick);
        let mut ticks = own.lag + 1;
        loop {
            self.samples.push(sample(ticks));
            if ticks >= last {
                break;
            }
            let next = (tick + u64::from(ticks)) / stride * stride + stride - tick;
            ticks = next as u32;
        }
        self.ends.push(self.samples.len());
    }

    /// Adds a half-plane for each condition that the candidate violates.
    fn cut<'a>(&mut self, own: &OwnMotion, candidate: &Candidate, obstacles: impl Iterator<Item = &'a ConvexShape>) {
        let (params, errors) = (self.params, self.errors);
        let dt_s = params.dt_s;
        let mut plane = |normal: Vec2, slope: Vec2, missing_m: f64| {
            // The gradient is the first-order change of the condition with the acceleration.
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
            for hit in candidate.hits(&params, &errors, own, shape).into_iter().flatten() {
                plane(hit.normal, candidate.path.pull_back_at(hit.share, hit.normal), hit.missing_m);
            }
        }
        if let Some((velocity, limit_mps)) = self.too_fast(own, candidate.acceleration) {
            let speed_mps = velocity.norm();
            let normal = -velocity / speed_mps;
            let bound = (normal.dot(&candidate.acceleration) * dt_s + (speed_mps - limit_mps)) / dt_s;
            self.planes.push(HalfPlane { normal, bound });
        }
    }

    /// Searches between full braking and `found` by bisection. Returns the allowed command nearest to `found` that it meets.
    fn towards_braking<'a>(
        &mut self,
        own: &OwnMotion,
        found: Vec2,
        obstacles: impl Iterator<Item = &'a ConvexShape> + Clone,
    ) -> Vec2 {
        let braking = self.params.law().braking(own.velocity);
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

/// The point at which a braking path comes too close to an obstacle.
#[derive(Clone, Copy, Debug)]
struct Hit {
    /// Unit vector away from the obstacle.
    normal: Vec2,
    /// Share of the path's length at this point, 0 to 1.
    share: f64,
    /// By how much the distance to keep is missed, m.
    missing_m: f64,
}

impl Candidate {
    /// How the candidate's braking path violates the distance to an outline that is sensed with errors: in up to four ways.
    fn hits(
        &self,
        params: &BrakingFilterParams,
        errors: &SensingErrors,
        own: &OwnMotion,
        shape: &ConvexShape,
    ) -> [Option<Hit>; 4] {
        if *errors == SensingErrors::default() {
            return [self.hit(params, own, shape), None, None, None];
        }
        let keep_m = params.clear_m() + errors.obstacle_m;
        let (from, to) = (own.position + self.path.start(), own.position + self.path.end());
        // Only a convex set that holds the place from which the drone looks is certainly nearest to a point in view.
        let looks = errors.partial_outlines.then_some(own.sensed_position);
        let nearest = swept_to_core(shape, looks, from, to);
        let distance_m = nearest.distance_m - shape.radius_m;
        if distance_m >= keep_m {
            return Default::default();
        }
        let braked = BrakingPath::new(own.position, own.velocity, params.law());
        let near = swept_to_core(shape, looks, braked.start(), braked.end());
        let braked_m = near.distance_m - shape.radius_m;
        if errors.obstacle_m > 0.0 && braked_m < keep_m {
            if looks.is_some() && own.lag > 0 {
                let hit = Hit { normal: nearest.normal, share: nearest.share, missing_m: keep_m - distance_m };
                return [(hit.missing_m > MET_M).then_some(hit), None, None, None];
            }
            let way_m = (braked.end() - braked.start()).norm();
            let moved = [(0.0, from - braked.at(1)), (1.0, to - braked.end())];
            return aside(&near, errors.obstacle_m + way_m, moved);
        }
        let hit = Hit { normal: nearest.normal, share: nearest.share, missing_m: keep_m.min(braked_m) - distance_m };
        [(hit.missing_m > MET_M).then_some(hit), None, None, None]
    }

    /// The violation of the distance to `shape` by the candidate's braking path, if there is one.
    fn hit(&self, params: &BrakingFilterParams, own: &OwnMotion, shape: &ConvexShape) -> Option<Hit> {
        let (from, to) = (own.position + self.path.start(), own.position + self.path.end());
        let nearest = NearestOnSegment::to_core(shape, from, to);
        let keep_m = params.clear_m();
        let distance_m = nearest.distance_m - shape.radius_m;
        if distance_m >= keep_m {
            return None;
        }
        let braked = BrakingPath::new(own.position, own.velocity, params.law());
        // A drone that is already too close may come no closer than full braking brings it.
        let braked_m = NearestOnSegment::to_core(shape, braked.start(), braked.end()).distance_m - shape.radius_m;
        let missing_m = keep_m.min(braked_m) - distance_m;
        (missing_m > MET_M).then_some(Hit { normal: nearest.normal, share: nearest.share, missing_m })
    }
}

/// The outline is nearer than it can be, or full braking leads too near. Only ways that lead away from it, wherever it is within
/// `error_m` of the braking path, are allowed. Returns the ways that do not. `moved`: two shares of the path, and by how much
/// the path moves there, m.
fn aside(nearest: &NearestOnSegment, error_m: f64, moved: [(f64, Vec2); 2]) -> [Option<Hit>; 4] {
    let sin = if nearest.distance_m > 0.0 { error_m / nearest.distance_m } else { 1.0 };
    let cos = (1.0 - sin * sin).max(0.0).sqrt();
    let across = Vec2::new(-nearest.normal.y, nearest.normal.x) * sin.min(1.0);
    let limits = [nearest.normal * cos + across, nearest.normal * cos - across];
    let hit = |normal: Vec2, (share, by): (f64, Vec2)| {
        let missing_m = if sin < 1.0 { -normal.dot(&by) } else { by.norm() };
        (missing_m > MET_M).then_some(Hit { normal, share, missing_m })
    };
    let [begin, end] = moved;
    [hit(limits[0], begin), hit(limits[1], begin), hit(limits[0], end), hit(limits[1], end)]
}

/// The nearest point to the core of a shape on the segment, or on the sides of the triangle of it and the place from which the drone `looks`.
fn swept_to_core(shape: &ConvexShape, looks: Option<Vec2>, from: Vec2, to: Vec2) -> NearestOnSegment {
    let sides = looks.into_iter().flat_map(|looks| [(looks, to), (looks, from)]);
    sides
        .map(|(from, to)| NearestOnSegment::to_core(shape, from, to))
        .fold(NearestOnSegment::to_core(shape, from, to), |a, b| if b.distance_m < a.distance_m { b } else { a })
}

/// Distance between a segment and a shape, m. Negative if the segment enters the shape.
#[must_use]
pub fn distance_m(shape: &ConvexShape, from: Vec2, to: Vec2) -> f64 {
    core_distance_m(shape, from, to) - shape.radius_m
}

#[cfg(test)]
mod tests;
