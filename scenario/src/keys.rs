//! The keys of a scenario. These types are the one source of truth: their doc comments, ranges and defaults make the
//! JSON schema, which makes the checks and the key reference.

use crate::faults::{Fault, Faults, MAX_FAULTS};
use crate::guidance::Guidance;
use crate::objective::Objective;
use crate::obstacle::Obstacle;
use crate::radio::RadioKeys;
use crate::strategy::Strategy;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Greatest number of drones.
pub const MAX_DRONES: u32 = 10_000;

/// Greatest number of obstacles.
pub const MAX_OBSTACLES: usize = 1024;

/// A mission: who flies, where, past what, with which radio. SI units, radians; world frame x = flight direction,
/// y = left, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name of the scenario, also in folder names: letters, digits, `.`, `_` and `-`, 64 at most, a letter, digit or
    /// `_` first. Default: the file's name without its ending.
    #[serde(default)]
    #[schemars(regex(pattern = "^[A-Za-z0-9_][A-Za-z0-9._-]{0,63}$"))]
    pub name: String,
    /// Seed of everything random: radio, start jitter, faults. Equal seeds give equal runs.
    #[serde(default = "first_seed")]
    #[schemars(range(min = 0, max = 9_223_372_036_854_775_807_i64))]
    pub seed: u64,
    /// How drones are shared out to the routes round an obstacle set: `congestion-aware` (the best few groupings and the
    /// shortest paths flown ahead by the leader, the best by `objective` taken), `congestion-aware-paper` (the paper's
    /// rule), `shortest-path`, or `fixed:L/R` (L drones to the left, R to the right of the only obstacle).
    #[serde(default)]
    pub strategy: Strategy,
    /// What `congestion-aware` makes least.
    #[serde(default)]
    pub objective: Objective,
    /// Simulated time.
    #[serde(default)]
    pub time: Time,
    /// How many drones, in which shape, from where. The one table that every scenario needs.
    pub formation: Formation,
    /// When the mission is over.
    #[serde(default)]
    pub mission: Mission,
    /// What a drone can do.
    #[serde(default)]
    pub drone: Drone,
    /// What a drone senses.
    #[serde(default)]
    pub sensors: Sensors,
    /// What the air does to frames.
    #[serde(default)]
    pub radio: RadioKeys,
    /// Distances kept from obstacles and in queues.
    #[serde(default)]
    pub avoidance: Avoidance,
    /// Periods and time-outs of what drones say to each other.
    #[serde(default)]
    pub protocol: Protocol,
    /// The guidance law and the safety filter.
    #[serde(default)]
    pub guidance: Guidance,
    /// What becomes of drones that fail.
    #[serde(default)]
    pub faults: Faults,
    /// What goes wrong on purpose, numbered from 0 in the file's order.
    #[serde(default, rename = "fault")]
    #[schemars(length(max = MAX_FAULTS))]
    pub fault_plan: Vec<Fault>,
    /// Obstacles, numbered from 0 in the file's order.
    #[serde(default, rename = "obstacle")]
    #[schemars(length(max = MAX_OBSTACLES))]
    pub obstacles: Vec<Obstacle>,
}

fn first_seed() -> u64 {
    1
}

/// Simulated time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Time {
    /// Length of a tick. In a tick at top speed a drone may move a quarter of the clearance and of the safe distance
    /// at most.
    #[schemars(range(min = 1e-4, max = 0.1))]
    pub dt_s: f64,
    /// The mission has failed when it takes longer than this.
    #[schemars(range(max = 36_000.0), extend("exclusiveMinimum" = 0.0))]
    pub timeout_s: f64,
}

impl Default for Time {
    fn default() -> Self {
        Self { dt_s: 0.02, timeout_s: 180.0 }
    }
}

/// How many drones, in which shape, from where.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Formation {
    /// Shape of the formation, at the start and after every reformation.
    pub shape: Option<FormationShape>,
    /// Slots relative to the anchor, [x, y] each, instead of `shape`; the first is the front slot.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(inner(range(min = -1e6, max = 1e6))))]
    pub offsets_m: Option<Vec<[f64; 2]>>,
    /// Number of drones; with `offsets_m` it may be left out and has to agree otherwise.
    #[schemars(range(min = 1, max = MAX_DRONES))]
    pub drones: u32,
    /// Distance between neighbouring slots, at least the safe distance.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub spacing_m: f64,
    /// Where the front slot is at the start, [x, y].
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub start_m: [f64; 2],
    /// Each drone starts at a place drawn (by the seed) uniformly from the disc of this radius around its slot.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub start_jitter_m: f64,
}

impl Default for Formation {
    fn default() -> Self {
        Self {
            shape: Some(FormationShape::NestedV),
            offsets_m: None,
            drones: 8,
            spacing_m: 35.0,
            start_m: [0.0, 0.0],
            start_jitter_m: 0.0,
        }
    }
}

/// A shape that can be made for any number of drones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FormationShape {
    /// The paper's: chevrons of five, nested one behind the other.
    NestedV,
    /// One chevron, 90° at its tip.
    V,
    /// Abreast, across the flight direction.
    Line,
    /// One behind the other.
    Column,
    /// Rows as wide as the formation is deep.
    Grid,
    /// On a circle.
    Circle,
    /// A filled triangle: rows of 1, 2, 3, … behind the tip.
    Wedge,
}

/// When the mission is over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// What ends the mission.
    pub end: End,
    /// With end = "hold": a moving anchor stops once its x is at least this.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub stop_x_m: f64,
    /// With end = "goal", which needs it: the front slot of the fixed goal slots, [x, y].
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub goal_m: Option<[f64; 2]>,
    /// Greatest speed while reforming, at most the drone's top speed.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub reform_speed_max_mps: f64,
    /// A drone has arrived when it is as near as this to its slot.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub arrival_error_m: f64,
    /// How slots are given to drones when the formation closes.
    pub reformation: Reformation,
    /// λ of the spline with reformation = "tps" (the paper's E6), m²: the greater, the more the formation keeps its
    /// order; with 0 each drone maps to the closest slot, shape counts for nothing.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tps_lambda: f64,
}

impl Default for Mission {
    fn default() -> Self {
        Self {
            end: End::Hold,
            stop_x_m: 100.0,
            goal_m: None,
            reform_speed_max_mps: 20.0,
            arrival_error_m: 0.8,
            reformation: Reformation::Optimal,
            tps_lambda: 0.0,
        }
    }
}

/// How slots are given to drones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reformation {
    /// Least sum of squared distances.
    Optimal,
    /// The paper's annealed thin-plate mapping; above 200 drones as optimal.
    Tps,
    /// The closest pair of drone and slot first.
    Greedy,
    /// In the order of the drones' numbers.
    Identity,
}

/// What ends the mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// All obstacles passed and the formation restored around its anchor.
    Hold,
    /// Every drone in a slot of the formation at `goal_m`.
    Goal,
}

/// What a drone can do. A planar point mass at one altitude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drone {
    /// Nominal speed, held whenever possible.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub speed_mps: f64,
    /// How much slower or faster than nominal a drone flies where it has to, the paper's δ.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub speed_change_mps: f64,
    /// Top speed, never exceeded.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub speed_max_mps: f64,
    /// Greatest acceleration in any direction.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub acceleration_max_mps2: f64,
    /// Distance between drones that must never be undercut, centre to centre.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub safe_distance_m: f64,
    /// c_d in the braking distance v²/(2 g c_d) with g = 9.81 m/s² (the paper's E3), dimensionless. The default
    /// brakes with g·c_d = 5 m/s².
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub drag_coefficient: f64,
    /// Time to compute or react, the paper's t_c in the reaction distance v·t_c (E4).
    #[schemars(range(min = 0.0, max = 2.0))]
    pub reaction_time_s: f64,
}

impl Default for Drone {
    fn default() -> Self {
        Self {
            speed_mps: 10.0,
            speed_change_mps: 5.0,
            speed_max_mps: 20.0,
            acceleration_max_mps2: 5.0,
            safe_distance_m: 35.0,
            drag_coefficient: 5.0 / 9.81,
            reaction_time_s: 0.0,
        }
    }
}

/// What a drone senses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Sensors {
    /// An obstacle with any point as near as this to a drone is sensed. At least the stopping distance at nominal
    /// speed (the paper's E2) plus the clearance.
    #[schemars(range(max = 100_000.0), extend("exclusiveMinimum" = 0.0))]
    pub detection_range_m: f64,
    /// Whether drones sense neighbours (identity, relative position and velocity) within twice the safe distance.
    pub ranging: bool,
}

impl Default for Sensors {
    fn default() -> Self {
        Self { detection_range_m: 90.0, ranging: true }
    }
}

/// Distances kept from obstacles and in queues.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Avoidance {
    /// Least distance from a drone's centre to an obstacle.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub clearance_m: f64,
    /// Obstacles are inflated by this where paths are planned; at least the clearance.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub planning_distance_m: f64,
    /// Headway between drones in a queue, in units of safe distance over nominal speed.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub headway_factor: f64,
}

impl Default for Avoidance {
    fn default() -> Self {
        Self { clearance_m: 15.0, planning_distance_m: 20.0, headway_factor: 1.1 }
    }
}

/// Periods and time-outs of what drones say to each other.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Protocol {
    /// Between two pose beacons of a drone.
    #[schemars(range(max = 60.0), extend("exclusiveMinimum" = 0.0))]
    pub beacon_period_s: f64,
    /// Between two heartbeats of a leader; at most `leader_timeout_s`.
    #[schemars(range(max = 60.0), extend("exclusiveMinimum" = 0.0))]
    pub heartbeat_period_s: f64,
    /// Between two repeats of plans, assignments, obstacles and passages.
    #[schemars(range(max = 60.0), extend("exclusiveMinimum" = 0.0))]
    pub repeat_period_s: f64,
    /// How long a claimant waits for objections.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub election_wait_s: f64,
    /// A leader that was not heard for this long is suspected.
    #[schemars(range(max = 600.0), extend("exclusiveMinimum" = 0.0))]
    pub leader_timeout_s: f64,
    /// A drone that was not heard for this long is no longer counted; at least `beacon_period_s`.
    #[schemars(range(max = 600.0), extend("exclusiveMinimum" = 0.0))]
    pub peer_timeout_s: f64,
    /// New obstacles are collected for this long before a leader plans anew.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub debounce_s: f64,
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            beacon_period_s: 0.1,
            heartbeat_period_s: 0.2,
            repeat_period_s: 0.2,
            election_wait_s: 0.2,
            leader_timeout_s: 1.0,
            peer_timeout_s: 1.5,
            debounce_s: 0.1,
        }
    }
}
