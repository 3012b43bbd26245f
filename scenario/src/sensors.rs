//! The keys of sensors and clocks. docs/sensors.md describes the models and names their sources.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The position error is cut off at this many standard deviations.
const POSITION_BOUND: f64 = 3.0;

/// What a drone senses, and how its sensors and its clock differ from ideal ones (docs/sensors.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sensors {
    /// Greatest distance at which a drone senses the nearest point of an obstacle. At least the stopping distance at
    /// nominal speed (the paper's E2) plus `avoidance.clearance_m`.
    #[schemars(range(max = 100_000.0), extend("exclusiveMinimum" = 0.0))]
    pub detection_range_m: f64,
    /// What a drone senses of an outline that is at least partly in range.
    pub outline: OutlineSensing,
    /// Greatest displacement of a sensed outline. It is drawn anew in each tick, for each drone and obstacle.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub obstacle_error_max_m: f64,
    /// Whether drones sense their neighbours (id, relative position and velocity) within `sensors.ranging_m`.
    /// Without it, or where it is not ideal, they keep their distances by messages (docs/safety.md).
    pub ranging: bool,
    /// Greatest distance at which drones sense neighbours. Absent: enough for two drones that fly at each other at the greatest
    /// speed of the mission to stop at the safe distance (the safe distance plus v²/a, and what they fly until they brake), and
    /// at least twice the safe distance.
    #[schemars(range(max = 100_000.0), extend("exclusiveMinimum" = 0.0))]
    pub ranging_m: Option<f64>,
    /// Standard deviation of the distance to a neighbour.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub ranging_std_m: f64,
    /// Standard deviation of the direction to a neighbour.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ranging_bearing_std_rad: f64,
    /// Standard deviation of each coordinate of a neighbour's velocity.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub ranging_velocity_std_mps: f64,
    /// Share of the measurements whose distance is too long, because the signal took a detour (no line of sight).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ranging_outlier_share: f64,
    /// With `ranging_outlier_share`: mean excess of such a distance. It is uniform from 0 to twice this.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub ranging_outlier_m: f64,
    /// Share of the measurements that are missing. Each neighbour and tick has a draw of its own.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ranging_dropout_share: f64,
    /// Age of a measurement when the drone reads it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub ranging_latency_s: f64,
    /// Width of the field of view in which neighbours are sensed, centred on the direction of flight (at rest on the course). The default is
    /// the full circle.
    #[schemars(range(max = TAU), extend("exclusiveMinimum" = 0.0))]
    pub ranging_field_rad: f64,
    /// Whether obstacles hide the neighbours behind them.
    pub ranging_occlusion: bool,
    /// Standard deviation of each coordinate of the position that a drone reads of itself: a first-order Gauss-Markov process, as of
    /// satellite navigation.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub position_std_m: f64,
    /// Time after which the correlation of that error has fallen to 1/e. With 0 it is drawn anew in each tick.
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub position_correlation_s: f64,
    /// Greatest error of that position: the process is cut off there, and the safety rule counts with it. Absent: three times
    /// `position_std_m`, and what the `gnss` faults of one drone can add. In a scenario with such faults the process is cut off at three
    /// times `position_std_m` at the latest.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub position_error_max_m: Option<f64>,
    /// Greatest offset of a drone's clock at the start. Each drone has an offset of its own, drawn by the seed.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clock_offset_max_s: f64,
    /// Greatest drift of a drone's clock, in millionths. Each drone has a drift of its own, drawn by the seed.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clock_drift_max_ppm: f64,
    /// Greatest difference between a drone's clock and the time of the mission that the safety rule counts with. Absent: what offset
    /// and drift make up to the time limit of the mission, and what the `clock` faults of one drone can add.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clock_error_max_s: Option<f64>,
}

/// What a drone senses of an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OutlineSensing {
    /// All of it.
    Whole,
    /// The part that faces the drone and is in range.
    Seen,
}

impl Default for Sensors {
    fn default() -> Self {
        Self {
            detection_range_m: 90.0,
            outline: OutlineSensing::Whole,
            obstacle_error_max_m: 0.0,
            ranging: true,
            ranging_m: None,
            ranging_std_m: 0.0,
            ranging_bearing_std_rad: 0.0,
            ranging_velocity_std_mps: 0.0,
            ranging_outlier_share: 0.0,
            ranging_outlier_m: 0.0,
            ranging_dropout_share: 0.0,
            ranging_latency_s: 0.0,
            ranging_field_rad: TAU,
            ranging_occlusion: false,
            position_std_m: 0.0,
            position_correlation_s: 100.0,
            position_error_max_m: None,
            clock_offset_max_s: 0.0,
            clock_drift_max_ppm: 0.0,
            clock_error_max_s: None,
        }
    }
}

impl Sensors {
    /// Whether neighbours are sensed at once and without error, in every direction and behind every obstacle.
    fn ranges_ideally(&self) -> bool {
        let errors = [
            self.ranging_std_m,
            self.ranging_bearing_std_rad,
            self.ranging_velocity_std_mps,
            self.ranging_outlier_share,
            self.ranging_dropout_share,
            self.ranging_latency_s,
        ];
        errors.iter().all(|error| *error == 0.0) && self.ranging_field_rad >= TAU && !self.ranging_occlusion
    }

    /// Whether what drones range of their neighbours keeps them apart: they have a sensor for it, and it is ideal.
    #[must_use]
    pub fn ranges_enough(&self) -> bool {
        self.ranging && self.ranges_ideally()
    }

    /// The bound of the position error by its standard deviation alone, m.
    #[must_use]
    pub fn position_spread_m(&self) -> f64 {
        POSITION_BOUND * self.position_std_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_that_is_not_ideal_leaves_the_distances_to_words() {
        assert!(Sensors::default().ranges_enough());
        assert!(!Sensors { ranging: false, ..Sensors::default() }.ranges_enough());
        assert!(!Sensors { ranging_std_m: 0.1, ..Sensors::default() }.ranges_enough());
        assert!(!Sensors { ranging_field_rad: 6.0, ..Sensors::default() }.ranges_enough());
        assert!(!Sensors { ranging_occlusion: true, ..Sensors::default() }.ranges_enough());
        let own = Sensors { position_std_m: 1.0, clock_offset_max_s: 1.0, ..Sensors::default() };
        assert!(own.ranges_enough(), "what it ranges needs neither its position nor its clock");
        assert_eq!((own.position_spread_m(), Sensors::default().position_spread_m()), (3.0, 0.0));
    }
}
