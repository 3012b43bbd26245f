//! The keys of faults: the failsafe of dead drones, and the scheduled faults.

use crate::limits::MAX_DRONES;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use skein_protocol::GroupId;
use skein_protocol::ids::GROUP_DEPTH;
use skein_protocol::link_faults::MAX_SIDES;
use std::borrow::Cow;
use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// What a drone does after its process has died.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// The failsafe of a drone whose process has died.
    pub failsafe: Failsafe,
}

impl Default for Faults {
    fn default() -> Self {
        Self { failsafe: Failsafe::Hover }
    }
}

/// The failsafe of a drone whose process has died.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Failsafe {
    /// It brakes and hovers.
    Hover,
    /// It brakes and lands.
    Land,
}

/// One scheduled fault: its kind, its time (`at_s`, or `on` with `after_s`), its targets (`drone`, `drones` or `target`)
/// and its duration (`for_s`). See docs/faults.md.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// What happens.
    pub kind: FaultKind,
    /// Time of the fault: it begins in the first tick at or after this time. Write either this or `on`.
    #[schemars(range(min = 0.0, max = 36_000.0))]
    pub at_s: Option<f64>,
    /// The event that starts the fault. The world looks for it in the true state and in what drones report of themselves.
    /// Write either this or `at_s`.
    pub on: Option<FaultEvent>,
    /// With `on`: the delay after the event.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 36_000.0))]
    pub after_s: f64,
    /// With `on`: which obstacle set the event is about, from 0, in flight order. For elections: which election, from 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 1023))]
    pub stage: u32,
    /// The target: the drone with this id.
    #[schemars(range(min = 0, max = MAX_DRONES - 1))]
    pub drone: Option<u32>,
    /// The targets: the drones with these ids.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(range(min = 0, max = MAX_DRONES - 1)))]
    pub drones: Option<Vec<u32>>,
    /// The target by role: `"leader"`, `"group-leader:N1"`, `"first-in-queue"`, `"last-in-queue"`, `"member"` (the lowest
    /// id that leads no group), `"random"` (chosen by the seed), `"all"`. The role is looked up when the fault begins. The
    /// fault waits while no drone has the role.
    pub target: Option<FaultTarget>,
    /// With `kind = "host-down"` and `kind = "host-cut"`: the name of the host whose drones are the targets.
    pub host: Option<String>,
    /// Duration of the fault; absent: to the end of the mission. Required with `kind = "host-cut"`, and with `kind = "freeze"` and `kind = "restart"`:
    /// afterwards the process continues, or a new one starts. It lasts at least one tick.
    #[schemars(range(min = 0.0, max = 36_000.0))]
    pub for_s: Option<f64>,
    /// Required with `kind = "slow"`: the time that is added to the drone's reaction time.
    #[schemars(range(max = 2.0), extend("exclusiveMinimum" = 0.0))]
    pub reaction_time_s: Option<f64>,
    /// Required with `kind = "partition"`: lists of drone ids between which no frame passes. `"halves"` is the first half
    /// of the ids and the second half. A drone in no list exchanges frames with all drones.
    pub sides: Option<PartitionSides>,
    /// With `kind = "blind"`: the sensor that measures nothing; absent: both.
    pub sensor: Option<Sensor>,
    /// With `kind = "ranging"`: standard deviation of the distance to a neighbour. Of this and the other `ranging_` keys, the
    /// worst of `[sensors]` and of the faults in force counts: the greatest number, and the narrowest field of view.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub ranging_std_m: Option<f64>,
    /// With `kind = "ranging"`: standard deviation of the direction to a neighbour.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ranging_bearing_std_rad: Option<f64>,
    /// With `kind = "ranging"`: standard deviation of each coordinate of a neighbour's velocity.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub ranging_velocity_std_mps: Option<f64>,
    /// With `kind = "ranging"`: share of the measurements whose distance is too long.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ranging_outlier_share: Option<f64>,
    /// With `kind = "ranging"`: mean excess of such a distance.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub ranging_outlier_m: Option<f64>,
    /// With `kind = "ranging"`: share of the measurements that are missing. With 1, the drone senses no neighbours and does not know it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub ranging_dropout_share: Option<f64>,
    /// With `kind = "ranging"`: age of a measurement when the drone reads it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub ranging_latency_s: Option<f64>,
    /// With `kind = "ranging"`: width of the field of view in which neighbours are sensed, centred on the direction of flight (at rest on the course).
    #[schemars(range(max = TAU), extend("exclusiveMinimum" = 0.0))]
    pub ranging_field_rad: Option<f64>,
    /// With `kind = "ranging"`: whether obstacles hide the neighbours behind them.
    pub ranging_occlusion: Option<bool>,
    /// With `kind = "noise"` and `kind = "gnss"`: constant error of the position that the drone reads of itself, [x, y].
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub position_bias_m: Option<[f64; 2]>,
    /// With `kind = "noise"`: standard deviation of each coordinate of that position, drawn anew in each tick.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub position_std_m: Option<f64>,
    /// With `kind = "noise"`: constant error of the velocity that the drone reads of itself, [x, y].
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub velocity_bias_mps: Option<[f64; 2]>,
    /// With `kind = "noise"`: standard deviation of each coordinate of that velocity, drawn anew in each tick.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub velocity_std_mps: Option<f64>,
    /// With `kind = "gnss"`: what is added to the error of the position in each second of the fault, [x, y].
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub position_drift_mps: Option<[f64; 2]>,
    /// With `kind = "gnss"`: greatest error of the position by this fault: it grows no further. Absent: what bias and drift make in
    /// the duration of the fault, or up to the time limit of the mission.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub position_error_max_m: Option<f64>,
    /// With `kind = "clock"`: what the drone's clock jumps ahead when the fault begins; negative: back.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub clock_offset_s: Option<f64>,
    /// With `kind = "clock"`: what the clock gains from then on, in millionths; negative: loses.
    #[schemars(range(min = -10_000.0, max = 10_000.0))]
    pub clock_drift_ppm: Option<f64>,
    /// With `kind = "wind"`: the acceleration that is added to the commanded one, [x, y].
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub wind_mps2: Option<[f64; 2]>,
    /// With `kind = "wind"`: standard deviation of each coordinate of the gusts, drawn for each drone and gust.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub gust_mps2: Option<f64>,
    /// With `gust_mps2`: duration of a gust; absent: 1.
    #[schemars(range(max = 36_000.0), extend("exclusiveMinimum" = 0.0))]
    pub gust_s: Option<f64>,
}

impl Fault {
    /// A fault of one drone that begins at `at_s`, s from the start of the mission, and lasts `for_s`, s; to the end of the
    /// mission without it.
    #[must_use]
    pub fn of_drone(kind: FaultKind, drone: u32, at_s: f64, for_s: Option<f64>) -> Self {
        Self {
            kind,
            at_s: Some(at_s),
            on: None,
            after_s: 0.0,
            stage: 0,
            drone: Some(drone),
            drones: None,
            target: None,
            host: None,
            for_s,
            reaction_time_s: None,
            sides: None,
            sensor: None,
            ranging_std_m: None,
            ranging_bearing_std_rad: None,
            ranging_velocity_std_mps: None,
            ranging_outlier_share: None,
            ranging_outlier_m: None,
            ranging_dropout_share: None,
            ranging_latency_s: None,
            ranging_field_rad: None,
            ranging_occlusion: None,
            position_bias_m: None,
            position_std_m: None,
            velocity_bias_mps: None,
            velocity_std_mps: None,
            position_drift_mps: None,
            position_error_max_m: None,
            clock_offset_s: None,
            clock_drift_ppm: None,
            wind_mps2: None,
            gust_mps2: None,
            gust_s: None,
        }
    }
}

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// The process is killed.
    Kill,
    /// The process is stopped, and continued after `for_s`.
    Freeze,
    /// The process is killed, and a new one started after `for_s`.
    Restart,
    /// The reaction time of the drone is longer.
    Slow,
    /// The drone receives no frames.
    Deaf,
    /// No drone receives its frames.
    Mute,
    /// No frame passes between the sides.
    Partition,
    /// The drone senses no obstacles, no neighbours, or neither.
    Blind,
    /// What the drone ranges of its neighbours is worse or missing. It does not know that.
    Ranging,
    /// The position that the drone reads of itself is biased, or drifts. It does not know that.
    Gnss,
    /// The drone's clock jumps, or drifts. It does not know that.
    Clock,
    /// The drone reads a wrong position and velocity of itself.
    Noise,
    /// Wind accelerates the drone.
    Wind,
    /// The host is gone: the processes of all its drones are killed. With `for_s`, new ones start afterwards.
    HostDown,
    /// The host's cable is cut: the processes of all its drones are stopped, and continued after `for_s`.
    HostCut,
}

impl FaultKind {
    /// The word in the scenario file.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::Freeze => "freeze",
            Self::Restart => "restart",
            Self::Slow => "slow",
            Self::Deaf => "deaf",
            Self::Mute => "mute",
            Self::Partition => "partition",
            Self::Blind => "blind",
            Self::Ranging => "ranging",
            Self::Gnss => "gnss",
            Self::Clock => "clock",
            Self::Noise => "noise",
            Self::Wind => "wind",
            Self::HostDown => "host-down",
            Self::HostCut => "host-cut",
        }
    }
}

/// The event that starts a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultEvent {
    /// A living drone senses the obstacle set for the first time.
    Detected,
    /// A drone obeys a plan to avoid the set.
    Grouped,
    /// A drone has a place in a queue past the set.
    Queued,
    /// The first living drone is past the mean centre of the set.
    Gate,
    /// The last living drone is past the mean centre of the set.
    Passed,
    /// A drone past the set obeys a plan to re-form.
    Reforming,
    /// A drone begins to lead a group.
    LeaderElected,
    /// A drone begins to lead a subgroup.
    GroupLeaderElected,
}

/// A sensor of a drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sensor {
    /// The obstacle sensor.
    Obstacles,
    /// The ranging sensor, which measures neighbours.
    Ranging,
}

/// The target of a fault by role. Written as one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum FaultTarget {
    /// The leader of the shallowest group.
    Leader,
    /// The leader of this group.
    GroupLeader(GroupId),
    /// The drone with the lowest rank in a queue.
    FirstInQueue,
    /// The drone with the highest rank in a queue.
    LastInQueue,
    /// The drone with the lowest id that leads no group.
    Member,
    /// One living drone, chosen by the seed.
    Random,
    /// All living drones.
    All,
}

impl FaultTarget {
    const WORDS: [(&str, Self); 6] = [
        ("leader", Self::Leader),
        ("first-in-queue", Self::FirstInQueue),
        ("last-in-queue", Self::LastInQueue),
        ("member", Self::Member),
        ("random", Self::Random),
        ("all", Self::All),
    ];
}

/// The word is not a target.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "found {0:?}, expected one of \"leader\", \"first-in-queue\", \"last-in-queue\", \"member\", \"random\", \"all\", or \
     \"group-leader:N1\" with a group's name: N, then a digit from 1 to 9 for each split"
)]
pub struct TargetError(String);

impl FromStr for FaultTarget {
    type Err = TargetError;

    fn from_str(text: &str) -> Result<Self, TargetError> {
        let word = Self::WORDS.iter().find(|(word, _)| *word == text).map(|(_, target)| *target);
        let group = || text.strip_prefix("group-leader:").and_then(group).map(Self::GroupLeader);
        word.or_else(group).ok_or_else(|| TargetError(text.to_owned()))
    }
}

/// Reads a group's name: `N`, `N1`, `N12`. `2` is short for `N2`.
fn group(name: &str) -> Option<GroupId> {
    let digits = name.strip_prefix('N').unwrap_or(name);
    let known = digits.len() <= GROUP_DEPTH && digits.bytes().all(|b| (b'1'..=b'9').contains(&b)) && !name.is_empty();
    known.then(|| digits.bytes().fold(GroupId::ALL, |group, digit| group.child(digit - b'0')))
}

impl fmt::Display for FaultTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::GroupLeader(group) => write!(f, "group-leader:{group}"),
            _ => {
                let word = Self::WORDS.iter().find(|(_, target)| target == self).map(|(word, _)| *word);
                f.write_str(word.unwrap_or_default())
            }
        }
    }
}

impl TryFrom<String> for FaultTarget {
    type Error = TargetError;

    fn try_from(text: String) -> Result<Self, TargetError> {
        text.parse()
    }
}

impl From<FaultTarget> for String {
    fn from(target: FaultTarget) -> Self {
        target.to_string()
    }
}

impl JsonSchema for FaultTarget {
    fn schema_name() -> Cow<'static, str> {
        "FaultTarget".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let words = Self::WORDS.map(|(word, _)| word);
        json_schema!({
            "type": "string",
            "format": "fault-target",
            "anyOf": [{ "enum": words }, { "pattern": "^group-leader:(N[1-9]{0,8}|[1-9]{1,8})$" }],
        })
    }
}

/// The sides of a partition.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum PartitionSides {
    /// A word.
    Word(SidesWord),
    /// The ids of the drones on each side.
    Lists(Vec<Vec<u32>>),
}

/// A word for the sides of a partition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SidesWord {
    /// `"halves"`: the first half of the ids and the second half. With an odd number of drones the first half is larger.
    Halves,
}

impl PartitionSides {
    /// The ids of the drones on each side, in a swarm of this number of drones.
    #[must_use]
    pub fn of(&self, drones: u32) -> Vec<Vec<u32>> {
        match self {
            Self::Word(SidesWord::Halves) => {
                let middle = drones.div_ceil(2);
                vec![(0..middle).collect(), (middle..drones).collect()]
            }
            Self::Lists(sides) => sides.clone(),
        }
    }
}

impl JsonSchema for PartitionSides {
    fn schema_name() -> Cow<'static, str> {
        "PartitionSides".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "format": "sides",
            "anyOf": [
                { "const": "halves" },
                {
                    "type": "array", "minItems": 2, "maxItems": MAX_SIDES,
                    "items": {
                        "type": "array", "minItems": 1, "maxItems": MAX_DRONES,
                        "items": { "type": "integer", "minimum": 0, "maximum": MAX_DRONES - 1 }
                    }
                }
            ],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_read_and_written_as_words() {
        for word in ["leader", "first-in-queue", "last-in-queue", "member", "random", "all", "group-leader:N12"] {
            assert_eq!(word.parse::<FaultTarget>().unwrap().to_string(), word);
        }
        assert_eq!("group-leader:2".parse(), Ok(FaultTarget::GroupLeader(GroupId::ALL.child(2))));
        assert_eq!("group-leader:N".parse(), Ok(FaultTarget::GroupLeader(GroupId::ALL)));
        for word in ["", "leaders", "group-leader:", "group-leader:N0", "group-leader:N123456789", "group-leader:x"] {
            assert!(word.parse::<FaultTarget>().unwrap_err().to_string().contains("group-leader:N1"), "{word}");
        }
    }

    #[test]
    fn halves_are_made_by_id() {
        assert_eq!(PartitionSides::Word(SidesWord::Halves).of(5), [vec![0, 1, 2], vec![3, 4]]);
    }
}
