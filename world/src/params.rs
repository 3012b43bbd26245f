//! What a mission is made of, beside its drones and obstacles. SI units, world frame.

use crate::faults::FaultPlan;
use skein_protocol::Vec2;
use skein_protocol::formation::Shape;
use skein_protocol::nearby::Locality;
use skein_protocol::radio::SharedChannel;
use skein_protocol::shape::ShapeError;
use thiserror::Error;

/// What a drone does whose process is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failsafe {
    /// Brakes to a stop and stays there.
    Hover,
    /// Brakes to a stop, descends, and is gone as a body once it is down.
    Land,
}

/// How long a landing drone stays a body once it stands still, s.
#[must_use]
pub fn landing_s() -> f64 {
    crate::body::ALTITUDE_M / crate::body::DESCENT_MPS
}

/// When the mission is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The formation is closed, slow, past every obstacle, and its front slot beyond an abscissa.
    Hold {
        /// That abscissa, m.
        stop_x_m: f64,
    },
    /// The living drones stand in fixed slots.
    Goal {
        /// Where the front slot is, m.
        front_m: Vec2,
    },
}

/// The parameters of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldParams {
    /// Length of a tick, ns; positive.
    pub dt_ns: i64,
    /// The mission ends after this time, s.
    pub timeout_s: f64,
    /// No drone flies faster, m/s.
    pub speed_max_mps: f64,
    /// No drone accelerates or brakes harder, m/s².
    pub acceleration_max_mps2: f64,
    /// Least distance of two bodies, m.
    pub safe_distance_m: f64,
    /// Least distance of a body to an obstacle, m.
    pub clearance_m: f64,
    /// Distance that paths keep from obstacles, m. Obstacles closer than twice this in flight direction are one set.
    pub planning_distance_m: f64,
    /// An obstacle with a point within this distance is sensed, m.
    pub detection_range_m: f64,
    /// Neighbours within this distance are sensed, m; `None`: no ranging.
    pub ranging_m: Option<f64>,
    /// The channel that all drones share; `None`: its bandwidth is no limit.
    pub channel: Option<SharedChannel>,
    /// Which frames are heard in a neighbourhood alone: they are sorted for their receivers.
    pub locality: Locality,
    /// What a drone does whose process is gone.
    pub failsafe: Failsafe,
    /// When the mission is over.
    pub end: End,
    /// Largest slot error of a closed formation, m.
    pub arrival_error_m: f64,
    /// The formation.
    pub shape: Shape,
    /// Its spacing, m.
    pub spacing_m: f64,
    /// What is to go wrong.
    pub faults: FaultPlan,
}

/// Why no world can be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum WorldError {
    /// The length of a tick is not positive.
    #[error("a tick lasts {0} ns, expected more than 0")]
    Tick(i64),
    /// A parameter is negative or not a number.
    #[error("{name} is {value}, expected a number of at least 0")]
    Parameter {
        /// Which.
        name: &'static str,
        /// What it is.
        value: f64,
    },
    /// The channel's bit rate is not positive.
    #[error("the channel has {0} bit/s, expected more than 0")]
    Rate(f64),
    /// A start is not finite.
    #[error("drone {0} starts at a position or with a velocity that is not finite")]
    Start(usize),
    /// An obstacle is none.
    #[error("obstacle {index}: {error}")]
    Obstacle {
        /// Which, from 0.
        index: usize,
        /// What is wrong with it.
        error: ShapeError,
    },
}

impl WorldParams {
    /// Length of a tick, s.
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        self.dt_ns as f64 * 1e-9
    }

    /// Checks what a world relies on.
    ///
    /// # Errors
    /// [`WorldError::Tick`], [`WorldError::Rate`], [`WorldError::Parameter`].
    pub fn check(&self) -> Result<(), WorldError> {
        if self.dt_ns <= 0 {
            return Err(WorldError::Tick(self.dt_ns));
        }
        let named = [
            ("timeout_s", self.timeout_s),
            ("speed_max_mps", self.speed_max_mps),
            ("acceleration_max_mps2", self.acceleration_max_mps2),
            ("safe_distance_m", self.safe_distance_m),
            ("clearance_m", self.clearance_m),
            ("planning_distance_m", self.planning_distance_m),
            ("detection_range_m", self.detection_range_m),
            ("ranging_m", self.ranging_m.unwrap_or(0.0)),
            ("arrival_error_m", self.arrival_error_m),
            ("spacing_m", self.spacing_m),
        ];
        let rate = self.channel.map_or(1.0, |channel| channel.rate_bps);
        if rate.is_nan() || rate <= 0.0 {
            return Err(WorldError::Rate(rate));
        }
        let bad = named.into_iter().find(|(_, value)| value.is_nan() || *value < 0.0);
        bad.map_or(Ok(()), |(name, value)| Err(WorldError::Parameter { name, value }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::params;

    #[test]
    fn bad_parameters_are_named() {
        assert_eq!(params().check(), Ok(()));
        assert_eq!(WorldParams { dt_ns: 0, ..params() }.check(), Err(WorldError::Tick(0)));
        let channel = Some(SharedChannel { seed: 1, rate_bps: 0.0, limit_s: 1.0 });
        assert_eq!(WorldParams { channel, ..params() }.check(), Err(WorldError::Rate(0.0)));
        let error = WorldParams { clearance_m: -1.0, ..params() }.check().unwrap_err();
        assert_eq!(error.to_string(), "clearance_m is -1, expected a number of at least 0");
        assert!(WorldParams { ranging_m: Some(f64::NAN), ..params() }.check().is_err());
    }
}
