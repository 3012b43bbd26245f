//! The errors of all sensors and clocks in the current tick.

use crate::body::Body;
use crate::faults::keyed_rng::KeyedRng;
use crate::geometry::Outline;
use crate::params::WorldParams;
use crate::sensor_errors::{PositionError, RangingErrors, SensorErrors};
use crate::view::in_view;
use skein_protocol::shape::ConvexShape;
use skein_protocol::{Course, SimTime, Tick, Vec2, Vec3};
use std::collections::VecDeque;

/// What a draw is for. Draws for different purposes are independent.
#[derive(Clone, Copy)]
enum Purpose {
    Position = 1,
    Ranging,
    Obstacle,
    Clock,
}

/// Position, m, and velocity, m/s, of each body in one tick, world frame.
type Motions = Vec<(Vec3, Vec3)>;

/// The errors, and what they depend on of the ticks before.
#[derive(Clone, Debug)]
pub(crate) struct SensorModel {
    /// Where the field of view of a drone at rest is centred.
    course: Course,
    errors: SensorErrors,
    /// Whether what is measured of neighbours is exact.
    exact_ranging: bool,
    dt_s: f64,
    tick: Tick,
    /// The error of each drone's position, m; empty without such errors.
    positions_m: Vec<Vec2>,
    /// Where the bodies were in the last ticks, the newest last; empty unless measurements can be late.
    past: VecDeque<Motions>,
    /// Greatest number of ticks that a measurement can be late, by the sensors or by a fault.
    most_late: usize,
    /// Offset, s, and drift of each drone's clock; empty for exact clocks.
    clocks: Vec<(f64, f64)>,
}

/// What a drone measures of a neighbour: position, m, and velocity, m/s, relative to the drone.
pub(crate) type Measured = (Vec3, Vec3);

impl SensorModel {
    /// The errors of a world with these parameters before the first tick, for this number of drones.
    pub(crate) fn new(params: &WorldParams, drones: usize) -> Self {
        let (errors, dt_s) = (params.sensors, params.dt_s());
        let latency_max_s = errors.ranging.latency_s.max(params.faults.ranging_latency_max_s());
        let clock = errors.clock;
        let exact = clock.is_exact();
        let mut model = Self {
            course: params.course,
            errors,
            exact_ranging: errors.ranging.is_ideal(),
            dt_s,
            tick: 0,
            positions_m: Vec::new(),
            past: VecDeque::new(),
            most_late: ticks(latency_max_s, dt_s),
            clocks: Vec::new(),
        };
        if !exact {
            let of_drone = |drone: usize| {
                let mut rng = model.rng(Purpose::Clock, drone as u64, 0);
                (clock.offset_max_s * rng.symmetric(), clock.drift_max_ppm * 1e-6 * rng.symmetric())
            };
            model.clocks = (0..drones).map(of_drone).collect();
        }
        model
    }

    /// Begins a tick, in which the bodies are here. Call it once per tick.
    pub(crate) fn begin(&mut self, tick: Tick, bodies: &[Body]) {
        self.tick = tick;
        let error = self.errors.position;
        if error.std_m > 0.0 {
            let before = std::mem::take(&mut self.positions_m);
            let next = |drone: usize| {
                let draw = self.rng(Purpose::Position, drone as u64, tick).vector(error.std_m);
                error.next_m(before.get(drone).copied(), draw, self.dt_s)
            };
            self.positions_m = (0..bodies.len()).map(next).collect();
        }
        if self.most_late > 0 {
            let mut motions =
                if self.past.len() > self.most_late { self.past.pop_front() } else { None }.unwrap_or_default();
            motions.clear();
            motions.extend(bodies.iter().map(|body| (body.position(), body.velocity())));
            self.past.push_back(motions);
        }
    }

    /// The error of the position that a drone reads of itself, m.
    pub(crate) fn position_m(&self, drone: usize) -> Vec2 {
        self.positions_m.get(drone).copied().unwrap_or_default()
    }

    /// What a drone's clock is ahead of the time of the mission, ns.
    pub(crate) fn clock_ns(&self, drone: usize, now: SimTime) -> i64 {
        let error_s = |(offset_s, drift): &(f64, f64)| offset_s + drift * now.secs();
        self.clocks.get(drone).map_or(0, |clock| (error_s(clock) * 1e9).round() as i64)
    }

    /// How far a drone senses an outline from where it is relative to the drone, m; `None` if all outlines are exact.
    pub(crate) fn obstacle_m(&self, drone: usize, obstacle: u32) -> Option<Vec2> {
        let max_m = self.errors.obstacle_error_max_m;
        let key = (drone as u64) << 32 | u64::from(obstacle);
        (max_m > 0.0).then(|| self.rng(Purpose::Obstacle, key, self.tick).disc(max_m))
    }

    /// Whether each drone has its own picture of every outline: it measures outlines relative to itself.
    pub(crate) fn draws_own_outlines(&self) -> bool {
        let SensorErrors { obstacle_error_max_m, position, view_m, .. } = self.errors;
        obstacle_error_max_m > 0.0 || position.max_m > 0.0 || view_m.is_some()
    }

    /// What a drone at `from` senses of an outline, both in the world frame, m.
    pub(crate) fn outline(&self, whole: &ConvexShape, from: Vec2) -> ConvexShape {
        self.errors.view_m.map_or(*whole, |range_m| in_view(whole, from, range_m))
    }

    /// What a drone measures of a neighbour; `None` if nothing. `fault`: errors of this drone's sensor, as far as they are worse.
    pub(crate) fn range(
        &self,
        (drone, other): (usize, usize),
        fault: &RangingErrors,
        bodies: &[Body],
        outlines: &[Outline],
    ) -> Option<Measured> {
        if self.exact_ranging && fault.is_ideal() {
            let (own, other) = (&bodies[drone], &bodies[other]);
            return Some((other.position() - own.position(), other.velocity() - own.velocity()));
        }
        let errors = self.errors.ranging.or_worse(fault);
        let past = self.past(errors.latency_s);
        let motion = |body: usize| {
            let past = past.and_then(|motions| motions.get(body).copied());
            past.unwrap_or_else(|| (bodies[body].position(), bodies[body].velocity()))
        };
        let ((here, own), (there, theirs)) = (motion(drone), motion(other));
        let (position, velocity) = (there - here, theirs - own);
        let ahead = own.xy().try_normalize(1e-6).unwrap_or(self.course.direction());
        if !sees(errors.field_rad, ahead, position.xy()) {
            return None;
        }
        if errors.occlusion && outlines.iter().any(|outline| outline.hides(here, there)) {
            return None;
        }
        let key = (drone as u64) << 32 | other as u64;
        let mut rng = self.rng(Purpose::Ranging, key, self.tick);
        let (dropped, detour, excess) = (rng.unit(), rng.unit(), rng.unit());
        if dropped < errors.dropout_share {
            return None;
        }
        let error = rng.vector(1.0);
        let excess_m = if detour < errors.outlier_share { 2.0 * errors.outlier_m * excess } else { 0.0 };
        let distance_m = position.norm();
        let measured_m = (distance_m + errors.std_m * error.x + excess_m).max(0.0);
        let turn = errors.bearing_std_rad * error.y;
        let flat = position.xy() + Vec2::new(-position.y, position.x) * turn;
        let stretch = measured_m / flat.push(position.z).norm().max(1e-9);
        let velocity = velocity + rng.vector(errors.velocity_std_mps).push(0.0);
        Some((flat.push(position.z) * stretch, velocity))
    }

    /// How the bodies moved this long ago, s; in the first tick if the mission is younger. `None` if no measurement can be late.
    fn past(&self, latency_s: f64) -> Option<&Motions> {
        let newest = self.past.len().checked_sub(1)?;
        self.past.get(newest.saturating_sub(ticks(latency_s, self.dt_s)))
    }

    fn rng(&self, purpose: Purpose, key: u64, tick: Tick) -> KeyedRng {
        KeyedRng::new(self.errors.seed, [purpose as u64 | 0x5e45_0000_0000, key, tick])
    }
}

impl PositionError {
    /// The error of the next tick. `draw`: a vector of two normal numbers with the standard deviation of the process, m.
    fn next_m(&self, before: Option<Vec2>, draw: Vec2, dt_s: f64) -> Vec2 {
        // The exact discretisation of the process.
        let keeps = if self.correlation_s > 0.0 { libm::exp(-dt_s / self.correlation_s) } else { 0.0 };
        let error = before.map_or(draw, |before| before * keeps + draw * (1.0 - keeps * keeps).sqrt());
        let length_m = error.norm();
        if length_m > self.max_m { error * (self.max_m / length_m) } else { error }
    }
}

/// The number of ticks in this time, s.
fn ticks(seconds: f64, dt_s: f64) -> usize {
    (seconds / dt_s).round() as usize
}

/// Whether a neighbour in this direction is in a field of view of this width (rad) around `ahead`, which has length 1.
fn sees(field_rad: f64, ahead: Vec2, towards: Vec2) -> bool {
    field_rad >= std::f64::consts::TAU || ahead.dot(&towards) >= towards.norm() * libm::cos(field_rad / 2.0)
}

#[cfg(test)]
mod tests;
