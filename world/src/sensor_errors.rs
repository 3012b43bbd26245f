//! The errors of all sensors and clocks, as parameters. The default is no error. docs/sensors.md names the sources.

/// How the sensors and clocks of all drones differ from ideal ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorErrors {
    /// Key of all draws.
    pub seed: u64,
    /// The position that a drone reads of itself.
    pub position: PositionError,
    /// What a drone senses of its neighbours.
    pub ranging: RangingErrors,
    /// Greatest displacement of a sensed outline, m. It is drawn anew in each tick, for each drone and obstacle.
    pub obstacle_error_max_m: f64,
    /// With a distance, m: of an outline, only the part in view up to that distance is sensed. `None`: the whole outline, as soon as
    /// any part of it is in range.
    pub view_m: Option<f64>,
    /// The drones' clocks.
    pub clock: ClockErrors,
}

impl SensorErrors {
    /// Whether all sensors and clocks are exact.
    pub(crate) fn is_ideal(&self) -> bool {
        let exact = self.position.std_m == 0.0 && self.position.max_m == 0.0 && self.obstacle_error_max_m == 0.0;
        exact && self.view_m.is_none() && self.ranging.is_ideal() && self.clock.is_exact()
    }
}

/// A first-order Gauss-Markov process that is cut off at a bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PositionError {
    /// Standard deviation of each coordinate, m.
    pub std_m: f64,
    /// Time after which the correlation has fallen to 1/e, s; 0: the error is drawn anew in each tick.
    pub correlation_s: f64,
    /// Greatest length of the error, m.
    pub max_m: f64,
}

/// Errors of the sensor that ranges neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangingErrors {
    /// Standard deviation of the distance, m.
    pub std_m: f64,
    /// Standard deviation of the direction, rad.
    pub bearing_std_rad: f64,
    /// Standard deviation of each coordinate of the velocity, m/s.
    pub velocity_std_mps: f64,
    /// Share of the measurements whose distance is too long, because the signal took a detour.
    pub outlier_share: f64,
    /// Mean excess of such a distance, m; it is uniform from 0 to twice that.
    pub outlier_m: f64,
    /// Share of the measurements that are missing.
    pub dropout_share: f64,
    /// Age of a measurement when the drone reads it, s.
    pub latency_s: f64,
    /// Width of the field of view, rad. It is centred on the direction of flight, and on +x at rest.
    pub field_rad: f64,
    /// Whether obstacles hide the neighbours behind them.
    pub occlusion: bool,
}

impl Default for RangingErrors {
    fn default() -> Self {
        Self {
            std_m: 0.0,
            bearing_std_rad: 0.0,
            velocity_std_mps: 0.0,
            outlier_share: 0.0,
            outlier_m: 0.0,
            dropout_share: 0.0,
            latency_s: 0.0,
            field_rad: std::f64::consts::TAU,
            occlusion: false,
        }
    }
}

impl RangingErrors {
    /// Whether the sensor is ideal.
    #[must_use]
    pub fn is_ideal(&self) -> bool {
        *self == Self { outlier_m: self.outlier_m, ..Self::default() }
    }

    /// Of each error, the worse one of the two: the greater number, the narrower field of view, and occlusion if one of them has it.
    #[must_use]
    pub(crate) fn or_worse(&self, other: &Self) -> Self {
        Self {
            std_m: self.std_m.max(other.std_m),
            bearing_std_rad: self.bearing_std_rad.max(other.bearing_std_rad),
            velocity_std_mps: self.velocity_std_mps.max(other.velocity_std_mps),
            outlier_share: self.outlier_share.max(other.outlier_share),
            outlier_m: self.outlier_m.max(other.outlier_m),
            dropout_share: self.dropout_share.max(other.dropout_share),
            latency_s: self.latency_s.max(other.latency_s),
            field_rad: self.field_rad.min(other.field_rad),
            occlusion: self.occlusion || other.occlusion,
        }
    }
}

/// Errors of the clocks. Each drone has a constant offset and a constant drift, drawn uniformly by the seed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClockErrors {
    /// Greatest offset at the start, s.
    pub offset_max_s: f64,
    /// Greatest drift, in millionths.
    pub drift_max_ppm: f64,
}

impl ClockErrors {
    /// Whether all clocks are exact.
    pub(crate) fn is_exact(&self) -> bool {
        *self == Self::default()
    }
}

impl SensorErrors {
    /// Finite numbers of at least 0, with their names.
    pub(crate) fn named(&self) -> [(&'static str, f64); 12] {
        let (position, ranging, clock) = (self.position, self.ranging, self.clock);
        [
            ("position.std_m", position.std_m),
            ("position.correlation_s", position.correlation_s),
            ("position.max_m", position.max_m),
            ("ranging.std_m", ranging.std_m),
            ("ranging.bearing_std_rad", ranging.bearing_std_rad),
            ("ranging.velocity_std_mps", ranging.velocity_std_mps),
            ("ranging.outlier_m", ranging.outlier_m),
            ("ranging.latency_s", ranging.latency_s),
            ("ranging.field_rad", ranging.field_rad),
            ("obstacle_error_max_m", self.obstacle_error_max_m),
            ("clock.offset_max_s", clock.offset_max_s),
            ("clock.drift_max_ppm", clock.drift_max_ppm),
        ]
    }
}
