//! The keys of a scenario. Doc comments, ranges and defaults of these types make the JSON schema. The schema makes the
//! checks and the key reference.

use crate::energy_keys::EnergyKeys;
use crate::faults::{Fault, Faults};
use crate::guidance::Guidance;
use crate::hosts::HostKeys;
use crate::limits::{MAX_DRONES, MAX_FAULTS, MAX_HOSTS, MAX_OBSTACLES, MAX_PILOTS};
use crate::objective::Objective;
use crate::obstacle::Obstacle;
use crate::pilots::{FreeTable, PilotKeys};
use crate::radio_keys::RadioKeys;
use crate::sensors::Sensors;
use crate::strategy::Strategy;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Map;

/// A mission: the drones, their formation, the obstacles, the radio, the faults. SI units and radians. In the world
/// frame, x is east and y is north, m.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name of the scenario, also used in folder names. At most 64 letters, digits, `.`, `_` and `-`; the first character
    /// is a letter, a digit or `_`. The default is the file's name without its ending.
    #[serde(default)]
    #[schemars(regex(pattern = "^[A-Za-z0-9_][A-Za-z0-9._-]{0,63}$"))]
    pub name: String,
    /// Seed of all random numbers: radio, start jitter, faults. Equal seeds give equal runs.
    #[serde(default = "first_seed")]
    #[schemars(range(min = 0, max = 9_223_372_036_854_775_807_i64))]
    pub seed: u64,
    /// How a leader assigns drones to the routes past an obstacle set. `congestion-aware-paper`: the paper's rule.
    /// `congestion-aware`: the leader looks ahead: it simulates a few good groupings and the shortest paths, and takes the best by
    /// `objective`. `shortest-path`: every drone takes its shortest path. `fixed:L/R`: L drones pass the only obstacle on its left, R
    /// drones on its right.
    #[serde(default)]
    pub strategy: Strategy,
    /// What `congestion-aware` minimises.
    #[serde(default)]
    pub objective: Objective,
    /// Simulated time.
    #[serde(default)]
    pub time: Time,
    /// The number of drones, the shape of their formation, and where they start. Every scenario needs this table.
    pub formation: Formation,
    /// When the mission ends.
    #[serde(default)]
    pub mission: Mission,
    /// The limits of a drone.
    #[serde(default)]
    pub drone: Drone,
    /// What the power of a drone is computed from.
    #[serde(default)]
    pub energy: EnergyKeys,
    /// What a drone senses.
    #[serde(default)]
    pub sensors: Sensors,
    /// How the radio delays, loses, copies and queues frames.
    #[serde(default)]
    pub radio: RadioKeys,
    /// Distances to obstacles and between drones in a queue.
    #[serde(default)]
    pub avoidance: Avoidance,
    /// Periods and time-outs of the messages between drones.
    #[serde(default)]
    pub protocol: Protocol,
    /// The guidance law and the safety filter.
    #[serde(default)]
    pub guidance: Guidance,
    /// What a drone does after its process has died.
    #[serde(default)]
    pub faults: Faults,
    /// Scheduled faults, numbered from 0 in the order of the file.
    #[serde(default, rename = "fault")]
    #[schemars(length(max = MAX_FAULTS))]
    pub fault_plan: Vec<Fault>,
    /// Pilots, numbered from 0 in the order of the file.
    #[serde(default, rename = "pilot", skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = MAX_PILOTS))]
    pub pilots: Vec<PilotKeys>,
    /// The machines that fly the drones, numbered from 0 in the order of the file. The first one has the drones from number 0 on,
    /// the next one those that follow. All others fly on the launcher's machine.
    #[serde(default, rename = "host", skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = MAX_HOSTS))]
    pub hosts: Vec<HostKeys>,
    /// Keys of the user's own. Every pilot gets them with the scenario; Skein does not check them.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    #[schemars(extend("format" = "free"))]
    pub user: FreeTable,
    /// Obstacles, numbered from 0 in the order of the file.
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
    /// Length of a tick. In one tick at top speed, a drone may move at most a quarter of `avoidance.clearance_m` and of
    /// `drone.safe_distance_m`.
    #[schemars(range(min = 1e-4, max = 0.1))]
    pub dt_s: f64,
    /// Time limit. A mission that takes longer has failed. Default: 600 s, or five times what a smooth flight takes from the last slot
    /// past all obstacles and to the goal or the stop, one drone behind another, if that is longer, but
    /// at most 36000 s; at least `mission.duration_s`.
    #[schemars(range(max = 36_000.0), extend("exclusiveMinimum" = 0.0))]
    pub timeout_s: Option<f64>,
}

impl Default for Time {
    fn default() -> Self {
        Self { dt_s: 0.02, timeout_s: None }
    }
}

/// The number of drones, the shape of their formation, and where they start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Formation {
    /// Shape of the formation at the start and after every reformation.
    pub shape: Option<FormationShape>,
    /// Slots relative to the anchor, each [x, y], instead of `shape`: x along the course, y to its left. The first one is the front slot.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(inner(range(min = -1e6, max = 1e6))))]
    pub offsets_m: Option<Vec<[f64; 2]>>,
    /// Number of drones. With `offsets_m` it may be left out; if it is written, it must equal the number of slots.
    #[schemars(range(min = 1, max = MAX_DRONES))]
    pub drones: u32,
    /// Distance between neighbouring slots; at least `drone.safe_distance_m`.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub spacing_m: f64,
    /// Position of the front slot at the start, [x, y].
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub start_m: [f64; 2],
    /// Height above the ground at which the formation starts, at least `avoidance.clearance_m`. The paper's pilot keeps it.
    /// Default: 50 m, or `avoidance.clearance_m` if that is more.
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub altitude_m: Option<f64>,
    /// Radius of the disc around its slot in which each drone starts. The place is drawn uniformly, by the seed.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub start_jitter_m: f64,
}

impl Default for Formation {
    fn default() -> Self {
        Self {
            shape: Some(FormationShape::NestedV),
            offsets_m: None,
            drones: 8,
            spacing_m: 40.0,
            start_m: [0.0, 0.0],
            altitude_m: None,
            start_jitter_m: 0.0,
        }
    }
}

/// A shape for any number of drones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FormationShape {
    /// The paper's formation: chevrons of five drones, nested one behind the other.
    NestedV,
    /// One chevron with an angle of 90° at its tip.
    V,
    /// A row across the flight direction.
    Line,
    /// A row along the flight direction.
    Column,
    /// A square grid.
    Grid,
    /// A circle.
    Circle,
    /// A filled triangle with rows of 1, 2, 3, … drones behind its tip.
    Wedge,
}

/// When the mission ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// What ends the mission.
    pub end: End,
    /// With `end = "hold"`: what has to be in formation at the end.
    pub parts: Parts,
    /// With `end = "hold"`: the formation stops once the x of its anchor is at least this.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub stop_x_m: f64,
    /// Required with `end = "goal"`: the position of the front slot at the goal, [x, y]. Of the four directions +x, +y, −x and −y, the
    /// one nearest to the way from `formation.start_m` to the goal is the course. The formation faces along the course, and routes past
    /// obstacles lead along it. A mission without a goal flies along +x.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub goal_m: Option<[f64; 2]>,
    /// What groups do between two obstacle sets.
    pub between: Between,
    /// Required with `end = "time"`: how long the mission lasts.
    #[schemars(range(max = 36_000.0), extend("exclusiveMinimum" = 0.0))]
    pub duration_s: Option<f64>,
    /// Greatest speed while re-forming; at most `drone.speed_max_mps`. Default: the paper's v + δ, which is `drone.speed_mps`
    /// plus `drone.speed_change_mps`, or `drone.speed_max_mps` if that is less.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub reform_speed_max_mps: Option<f64>,
    /// Greatest distance to its slot at which a drone has arrived.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub arrival_error_m: f64,
    /// How slots are assigned to drones when the formation closes. Drones that are shut out of their slots for long get the slots that
    /// are best for all, as with `"optimal"`. If the goal lies in a bay of obstacles, their
    /// distances are those along the way, for up to 64 drones.
    pub reformation: Reformation,
    /// With `reformation = "tps"`: λ of the thin-plate spline (the paper's E6), m². A greater value keeps the order of the
    /// formation better. With 0, each drone maps to the closest slot, whatever the order.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub tps_lambda: f64,
}

impl Default for Mission {
    fn default() -> Self {
        Self {
            end: End::Hold,
            parts: Parts::One,
            stop_x_m: 100.0,
            goal_m: None,
            between: Between::CloseUp,
            duration_s: None,
            reform_speed_max_mps: None,
            arrival_error_m: 0.8,
            reformation: Reformation::Optimal,
            tps_lambda: 0.0,
        }
    }
}

/// What has to be in formation at the end of a mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Parts {
    /// All living drones, as one formation.
    One,
    /// Each part of the swarm by itself. A part is all living drones that their radios have connected for the last 10 s, over any number
    /// of hops: two drones hear each other if neither of them is mute or deaf, no partition separates them, and they are within
    /// `radio.range_m`. For a swarm that may be cut for ever.
    Each,
}

/// What groups do between two obstacle sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Between {
    /// They become one group again, and the formation closes.
    CloseUp,
    /// Each group flies on by itself to its part of the formation at the destination, which is `stop_x_m` or `goal_m`, and
    /// splits again before the next set. The formation closes once the swarm has flown as far as that.
    GoOn,
}

/// How slots are assigned to drones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Reformation {
    /// The least sum of squared distances.
    Optimal,
    /// The paper's annealed thin-plate mapping; above 200 drones the same as optimal.
    Tps,
    /// The closest pair of drone and slot first, then the next closest.
    Greedy,
    /// By the drones' ids.
    Identity,
}

/// What ends the mission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum End {
    /// All obstacles are passed and the formation is restored around its anchor. An obstacle that no drone ever senses does not have to
    /// be passed.
    Hold,
    /// Every drone is in a slot of the formation at `goal_m`. A slot beside which a dead drone hangs stays free.
    Goal,
    /// The mission has lasted `duration_s`, and a drone lives. It is a success if no invariant was broken.
    Time,
    /// The pilots of all living drones say that they are done. It is a success if no invariant was broken.
    Pilots,
}

/// The limits of a drone. A drone is a planar point mass at one altitude.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Drone {
    /// Nominal speed. A drone flies at this speed whenever possible.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub speed_mps: f64,
    /// Greatest change from the nominal speed when a drone has to fly slower or faster, the paper's δ; at most `speed_mps`.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub speed_change_mps: f64,
    /// Top speed. A drone never exceeds it.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub speed_max_mps: f64,
    /// Greatest acceleration in any direction.
    #[schemars(range(max = 1000.0), extend("exclusiveMinimum" = 0.0))]
    pub acceleration_max_mps2: f64,
    /// Least distance between the centres of two drones. It must hold at all times.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub safe_distance_m: f64,
    /// c_d in the braking distance v²/(2 g c_d) with g = 9.81 m/s² (the paper's E3), dimensionless. A drone that brakes fully
    /// decelerates with g·c_d, at most with `acceleration_max_mps2`. With the default, g·c_d is 5 m/s².
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub drag_coefficient: f64,
    /// Time to compute and react: the paper's t_c in the reaction distance v·t_c (E4).
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

/// Distances to obstacles and between drones in a queue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Avoidance {
    /// Least distance from a drone's centre to an obstacle. It must hold at all times.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub clearance_m: f64,
    /// Distance that planned paths keep from obstacles; at least `clearance_m`.
    #[schemars(range(max = 10_000.0), extend("exclusiveMinimum" = 0.0))]
    pub planning_distance_m: f64,
    /// Time between two drones in a queue, as a multiple of safe distance / nominal speed.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub headway_factor: f64,
}

impl Default for Avoidance {
    fn default() -> Self {
        Self { clearance_m: 15.0, planning_distance_m: 20.0, headway_factor: 1.1 }
    }
}

/// Periods and time-outs of the messages between drones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Protocol {
    /// Time between two pose beacons of a drone. Default: 0.1 s. Where `radio.rate_bps` limits the bandwidth, the default is longer
    /// if the beacons of all drones would take more than a quarter of it, up to a third of `peer_timeout_s`. It is also
    /// longer, up to the same bound, for a drone that hears more than 32 others and passes messages on
    /// ([leading.md](leading.md#beyond-one-hop)).
    #[schemars(range(max = 60.0), extend("exclusiveMinimum" = 0.0))]
    pub beacon_period_s: Option<f64>,
    /// Time between two heartbeats of a leader; at most `leader_timeout_s`.
    #[schemars(range(max = 60.0), extend("exclusiveMinimum" = 0.0))]
    pub heartbeat_period_s: f64,
    /// Time between two repetitions of a plan, an assignment, an obstacle or a passage.
    #[schemars(range(max = 60.0), extend("exclusiveMinimum" = 0.0))]
    pub repeat_period_s: f64,
    /// How long a claimant waits for objections to its claim.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub election_wait_s: f64,
    /// A drone suspects a leader that it has not heard for this long.
    #[schemars(range(max = 600.0), extend("exclusiveMinimum" = 0.0))]
    pub leader_timeout_s: f64,
    /// A drone that has not been heard for this long is no member any more; at least `beacon_period_s`.
    #[schemars(range(max = 600.0), extend("exclusiveMinimum" = 0.0))]
    pub peer_timeout_s: f64,
    /// How long a leader collects new obstacles before it plans.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub debounce_s: f64,
}

impl Default for Protocol {
    fn default() -> Self {
        Self {
            beacon_period_s: None,
            heartbeat_period_s: 0.2,
            repeat_period_s: 0.2,
            election_wait_s: 0.2,
            leader_timeout_s: 1.0,
            peer_timeout_s: 1.5,
            debounce_s: 0.1,
        }
    }
}
