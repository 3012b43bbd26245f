//! The parameters of a world. SI units, world frame.

use crate::energy_model::EnergyModel;
use crate::fault_plan::FaultPlan;
use crate::sensor_errors::SensorErrors;
use skein_protocol::formation::Shape;
use skein_protocol::nearby::Locality;
use skein_protocol::radio::SharedChannel;
use skein_protocol::shape::ShapeError;
use skein_protocol::{Course, DroneId, Vec2};
use thiserror::Error;

/// What a drone without a process does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failsafe {
    /// Brakes to a stop and stays there.
    Hover,
    /// Brakes to a stop and descends. Once it is down, it is no body any more.
    Land,
}

/// What has to be in formation at the end of a mission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PartsRule {
    /// All living drones, as one formation.
    One,
    /// Each part of the swarm by itself. Drones are in one part if their radios connect them, over any number of hops.
    Each {
        /// Greatest distance of two drones that hear each other, m.
        reach_m: f64,
    },
}

/// When the mission is over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum End {
    /// The formation is closed and slow, every drone has been past every obstacle, and the front slot is far enough.
    Hold {
        /// The least abscissa of the front slot, m.
        stop_x_m: f64,
    },
    /// The living drones stand in fixed slots.
    Goal {
        /// The position of the front slot, m.
        front_m: Vec2,
    },
    /// The mission has lasted long enough, and a drone lives.
    Time {
        /// How long, s.
        duration_s: f64,
    },
    /// The pilots of all living drones say that they are done.
    Pilots,
}

/// The parameters of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldParams {
    /// Length of a tick, ns; positive.
    pub dt_ns: i64,
    /// The mission ends after this time, s.
    pub timeout_s: f64,
    /// The drones that have no way to their destination, by id. If there is one, the mission ends as stuck in its first tick.
    pub without_way: Vec<DroneId>,
    /// Greatest speed of a drone, m/s.
    pub speed_max_mps: f64,
    /// Greatest acceleration of a drone in any direction, m/s².
    pub acceleration_max_mps2: f64,
    /// Deceleration of a drone that brakes fully, m/s².
    pub braking_mps2: f64,
    /// Time from a command to its effect, s. Until the first command takes effect, the autopilot flies straight on.
    pub reaction_time_s: f64,
    /// Least distance of two bodies, m.
    pub safe_distance_m: f64,
    /// Least distance of a body to an obstacle, m.
    pub clearance_m: f64,
    /// Distance that planned paths keep from obstacles, m. Obstacles whose extents along the flight are closer than twice
    /// this form one set.
    pub planning_distance_m: f64,
    /// Greatest distance at which a drone senses the nearest point of an obstacle, m.
    pub detection_range_m: f64,
    /// Greatest distance at which a drone senses a neighbour, m; `None`: drones sense no neighbours.
    pub ranging_m: Option<f64>,
    /// The errors of sensors and clocks.
    pub sensors: SensorErrors,
    /// The channel that all drones share; `None`: bandwidth is no limit.
    pub channel: Option<SharedChannel>,
    /// Which frames can only be received near by. The downlink indexes those by place.
    pub locality: Locality,
    /// What a drone without a process does.
    pub failsafe: Failsafe,
    /// When the mission is over.
    pub end: End,
    /// What has to be in formation then, with [`End::Hold`].
    pub parts: PartsRule,
    /// Largest slot error of a closed formation, m.
    pub arrival_error_m: f64,
    /// Greatest speed of a drone in a formation that is held, m/s.
    pub hold_speed_mps: f64,
    /// The direction in which the mission flies. The formation faces it.
    pub course: Course,
    /// The shape of the formation.
    pub shape: Shape,
    /// The spacing of the formation, m.
    pub spacing_m: f64,
    /// What the power of a drone is computed from.
    pub energy: EnergyModel,
    /// The scheduled faults.
    pub faults: FaultPlan,
    /// Names of the drones' pilots, by id, for events.
    pub pilots: Vec<String>,
}

/// Why a world cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum WorldError {
    /// The length of a tick is not positive.
    #[error("dt_ns is {0}, expected more than 0")]
    Tick(i64),
    /// A parameter is negative or not a number.
    #[error("{name} is {value}, expected a number of at least 0")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The channel's bit rate is not positive.
    #[error("channel.rate_bps is {0}, expected more than 0")]
    Rate(f64),
    /// The start position or velocity of this drone is not finite.
    #[error("drone {0} starts at a position or with a velocity that is not finite, expected finite numbers")]
    Start(usize),
    /// An obstacle has an invalid shape.
    #[error("obstacle {index}: {error}")]
    Obstacle {
        /// Its number, from 0.
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

    /// Name of a drone's pilot.
    #[must_use]
    pub fn pilot_of(&self, id: DroneId) -> &str {
        self.pilots.get(id.index()).map_or("unknown", String::as_str)
    }

    /// Checks all parameters.
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
            ("braking_mps2", self.braking_mps2),
            ("safe_distance_m", self.safe_distance_m),
            ("clearance_m", self.clearance_m),
            ("planning_distance_m", self.planning_distance_m),
            ("reaction_time_s", self.reaction_time_s),
            ("detection_range_m", self.detection_range_m),
            ("ranging_m", self.ranging_m.unwrap_or(0.0)),
            ("arrival_error_m", self.arrival_error_m),
            ("hold_speed_mps", self.hold_speed_mps),
            ("spacing_m", self.spacing_m),
            ("energy.wind_mps", self.energy.wind_mps.norm()),
        ];
        let mut named = named.into_iter().chain(self.sensors.named());
        let rate = self.channel.map_or(1.0, |channel| channel.rate_bps);
        if rate.is_nan() || rate <= 0.0 {
            return Err(WorldError::Rate(rate));
        }
        let bad = named.find(|(_, value)| value.is_nan() || *value < 0.0);
        bad.map_or(Ok(()), |(name, value)| Err(WorldError::Parameter { name, value }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::params;

    #[test]
    fn an_invalid_parameter_is_named() {
        assert_eq!(params().check(), Ok(()));
        assert_eq!(WorldParams { dt_ns: 0, ..params() }.check(), Err(WorldError::Tick(0)));
        let channel = Some(SharedChannel { seed: 1, rate_bps: 0.0, limit_s: 1.0, carrier_sense_m: f64::INFINITY });
        assert_eq!(WorldParams { channel, ..params() }.check(), Err(WorldError::Rate(0.0)));
        let error = WorldParams { clearance_m: -1.0, ..params() }.check().unwrap_err();
        assert_eq!(error.to_string(), "clearance_m is -1, expected a number of at least 0");
        assert!(WorldParams { ranging_m: Some(f64::NAN), ..params() }.check().is_err());
        let sensors = SensorErrors { obstacle_error_max_m: -1.0, ..SensorErrors::default() };
        let error = WorldParams { sensors, ..params() }.check().unwrap_err();
        assert_eq!(error.to_string(), "obstacle_error_max_m is -1, expected a number of at least 0");
    }
}
