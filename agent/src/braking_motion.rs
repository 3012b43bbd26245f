//! What the safety rule of [`crate::braking_filter`] starts from: its constants, and the motions of a drone and of its neighbours.

use crate::braking_path::BrakingLaw;
use skein_protocol::{DroneId, SimTime, Vec2};

/// The share of the room between two braking paths that each of the two drones may use in a tick.
pub(crate) const SHARE: f64 = 0.5;
/// Margin for the loss of distance between the compared ticks, as a share of the safe distance.
const MARGIN_SHARE: f64 = 0.01;
/// Added to the clearance, m, so that rounding errors do not break it.
const CLEARANCE_ROUNDING_M: f64 = 1e-3;

/// Constants of the rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrakingFilterParams {
    /// Least distance between two drones, m.
    pub safe_distance_m: f64,
    /// Least distance of a drone's centre to an obstacle, m.
    pub clearance_m: f64,
    /// Greatest acceleration, m/s².
    pub acceleration_max_mps2: f64,
    /// Deceleration of a drone that brakes fully, m/s²; at most the greatest acceleration.
    pub braking_mps2: f64,
    /// Greatest speed of any drone, m/s.
    pub speed_max_mps: f64,
    /// Length of a tick, s.
    pub dt_s: f64,
}

/// A neighbour as sensed now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moving {
    /// Which drone it is. Only drones whose commands take effect late need to know.
    pub id: DroneId,
    /// Position relative to the drone's present position, m.
    pub position_m: Vec2,
    /// Velocity in the world frame, m/s.
    pub velocity_mps: Vec2,
}

/// The drone's own state, to which the rule is applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnMotion {
    /// Number of the present tick, in which neighbours are sensed.
    pub tick: u64,
    /// The present time.
    pub now: SimTime,
    /// Position now, world frame, m.
    pub sensed_position: Vec2,
    /// Velocity now, world frame, m/s.
    pub sensed_velocity: Vec2,
    /// Position when the command takes effect, world frame, m.
    pub position: Vec2,
    /// Velocity when the command takes effect, world frame, m/s.
    pub velocity: Vec2,
    /// Greatest speed from which the drone can stop within its sensing range, m/s.
    pub speed_limit_mps: f64,
    /// Delay from a command to its effect, ticks.
    pub lag: u32,
}

/// A bound on how two drones come together while both brake.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gap {
    /// At least by so much they stay farther apart than they have to, m.
    room_m: f64,
    /// Both rest after this time, also if one of them first carries out a command for a tick, s.
    stop_s: f64,
}

impl Gap {
    /// Whether a command leaves room enough if it makes the velocity differ from that of full braking by so much after its tick, m/s. Full
    /// braking from then on does not make two velocities differ more.
    pub(crate) fn leaves_room(&self, change_mps: f64) -> bool {
        SHARE * self.room_m >= change_mps * self.stop_s
    }
}

impl BrakingFilterParams {
    /// Margin on the safe distance for the loss of distance between the compared ticks, m.
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        MARGIN_SHARE * self.safe_distance_m
    }

    /// Number of ticks between two comparisons of braking paths. Let h be the time between two comparisons. Between them, the
    /// distance of two paths falls by at most h²/8 · (v²/D + 2a) below the smaller of the two compared distances. v is the
    /// relative speed, at most twice the greatest speed.
    #[must_use]
    pub fn stride(&self) -> u32 {
        let relative_mps = 2.0 * self.speed_max_mps;
        let bend = relative_mps * relative_mps / self.safe_distance_m + 2.0 * self.acceleration_max_mps2;
        ((8.0 * self.margin_m() / bend).sqrt() / self.dt_s).max(1.0) as u32
    }

    /// The distance that two drones keep, m.
    #[must_use]
    pub fn keep_m(&self) -> f64 {
        self.safe_distance_m + self.margin_m()
    }

    /// How a drone brakes.
    #[must_use]
    pub fn law(&self) -> BrakingLaw {
        BrakingLaw { deceleration_mps2: self.braking_mps2, dt_s: self.dt_s }
    }

    /// Greatest speed from which a drone stops within `room_m`, m/s. The drone flies on at this speed for `lag` + 2 ticks before
    /// it brakes.
    #[must_use]
    pub fn speed_within_mps(&self, room_m: f64, lag: u32) -> f64 {
        let late_s = f64::from(lag + 2) * self.dt_s;
        let brake = self.braking_mps2;
        (brake * late_s).hypot((2.0 * brake * room_m.max(0.0)).sqrt()) - brake * late_s
    }

    /// Speed limit after this tick, m/s. It is never lower than the speed that full braking reaches.
    pub(crate) fn speed_limit_mps(&self, own: &OwnMotion) -> f64 {
        let braked = own.velocity.norm() - self.braking_mps2 * self.dt_s;
        own.speed_limit_mps.min(self.speed_max_mps).max(braked)
    }

    /// The distance from the outline of an obstacle that is allowed without a further look, m.
    pub(crate) fn clear_m(&self) -> f64 {
        self.clearance_m + CLEARANCE_ROUNDING_M
    }

    /// Upper bound on the distance that a drone flies until it stops, if it may accelerate for `ticks` ticks, m.
    /// `speed_squared`: square of its speed, m²/s².
    pub(crate) fn reach_m(&self, speed_squared: f64, ticks: u32) -> f64 {
        let span_s = f64::from(ticks) * self.dt_s;
        let speed_mps = speed_squared.sqrt() + self.acceleration_max_mps2 * span_s;
        speed_mps * speed_mps / (2.0 * self.braking_mps2) + speed_mps * span_s
    }

    /// The gap to a neighbour; `None` if the two cannot reach each other.
    pub(crate) fn gap_while_braking(&self, own: &OwnMotion) -> impl Fn(&Moving) -> Option<Gap> + use<> {
        let (params, own_velocity, keep_m) = (*self, own.velocity, self.keep_m());
        let own_speed2 = own_velocity.norm_squared();
        let own_reach_m = self.reach_m(own_speed2, 1);
        // The tick of a command, the time in which the speed falls by what it rose in that tick, and the last tick of braking.
        let command_s = (2.0 + self.acceleration_max_mps2 / self.braking_mps2) * self.dt_s;
        move |other| {
            let (distance2, speed2) = (other.position_m.norm_squared(), other.velocity_mps.norm_squared());
            let apart_m = keep_m + own_reach_m + params.reach_m(speed2, 1);
            if distance2 > apart_m * apart_m {
                return None;
            }
            // Full braking is a projection, and projections do not increase distances. So the distance of two braking
            // paths changes by at most the relative speed times the time until both drones are at rest.
            let stop_s = own_speed2.max(speed2).sqrt() / params.braking_mps2 + command_s;
            let room_m = distance2.sqrt() - keep_m - (other.velocity_mps - own_velocity).norm() * stop_s;
            Some(Gap { room_m, stop_s })
        }
    }

    /// The same for a drone at `speed_mps` that obeys the speed limit of `own`, m.
    pub(crate) fn late_reach_m(&self, own: &OwnMotion, speed_mps: f64, ticks: u32) -> f64 {
        let span_s = f64::from(ticks) * self.dt_s;
        let limit_mps = own.speed_limit_mps.min(self.speed_max_mps).max(speed_mps);
        let speed_mps = (speed_mps + self.acceleration_max_mps2 * span_s).min(limit_mps);
        // The last tick of full braking brakes less.
        let last_m = self.braking_mps2 * self.dt_s * self.dt_s / 8.0;
        speed_mps * speed_mps / (2.0 * self.braking_mps2) + speed_mps * span_s + last_m
    }
}
