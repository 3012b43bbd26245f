//! What becomes of drones that fail, and what goes wrong on purpose.

use crate::keys::MAX_DRONES;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use skein_protocol::GroupId;
use skein_protocol::ids::GROUP_DEPTH;
use skein_protocol::link_faults::MAX_SIDES;
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Greatest number of faults.
pub const MAX_FAULTS: usize = 1024;

/// What becomes of drones that fail.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// What a drone does whose process is dead.
    pub failsafe: Failsafe,
}

impl Default for Faults {
    fn default() -> Self {
        Self { failsafe: Failsafe::Hover }
    }
}

/// What a drone does whose process is dead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Failsafe {
    /// Brakes and hovers.
    Hover,
    /// Brakes and lands.
    Land,
}

/// One fault: what, when (`at_s`, or `on` with `after_s`), whom (`drone`, `drones` or `target`), for how long. See
/// docs/faults.md.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// What happens.
    pub kind: FaultKind,
    /// When: in the first tick at or after this time. Either this or `on`.
    #[schemars(range(min = 0.0, max = 36_000.0))]
    pub at_s: Option<f64>,
    /// When: after an event, by the world's truth and what drones say of themselves. Either this or `at_s`.
    pub on: Option<FaultEvent>,
    /// With `on`: so long after the event.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 36_000.0))]
    pub after_s: f64,
    /// With `on`: of which obstacle set, from 0, in flight order; of the elections, which one, from 0.
    #[serde(default)]
    #[schemars(range(min = 0, max = 1023))]
    pub stage: u32,
    /// Whom: this drone.
    #[schemars(range(min = 0, max = MAX_DRONES - 1))]
    pub drone: Option<u32>,
    /// Whom: these drones.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(range(min = 0, max = MAX_DRONES - 1)))]
    pub drones: Option<Vec<u32>>,
    /// Whom: by role, found when the fault happens and waited for if nobody has it: `"leader"`, `"group-leader:N1"`,
    /// `"first-in-queue"`, `"last-in-queue"`, `"member"` (the lowest number that leads nobody), `"random"` (by the
    /// seed), `"all"`.
    pub target: Option<FaultTarget>,
    /// For how long; absent: to the end. Required with freeze and restart: until the process goes on, or a new one
    /// starts. At least a tick.
    #[schemars(range(min = 0.0, max = 36_000.0))]
    pub for_s: Option<f64>,
    /// With kind = "slow", which needs it: added to the drone's reaction time.
    #[schemars(range(max = 2.0), extend("exclusiveMinimum" = 0.0))]
    pub reaction_time_s: Option<f64>,
    /// With kind = "partition", which needs it: sets of drones between which no frame passes; `"halves"`: the first
    /// half of the numbers and the second. Who is in no set hears and is heard by all.
    pub sides: Option<PartitionSides>,
    /// With kind = "blind": which sensor tells nothing; absent: both.
    pub sensor: Option<Sensor>,
    /// With kind = "noise": added to what the drone is told of its own position, [x, y].
    #[schemars(inner(range(min = -1000.0, max = 1000.0)))]
    pub position_bias_m: Option<[f64; 2]>,
    /// With kind = "noise": standard deviation of each coordinate of the position, drawn anew in each tick.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub position_std_m: Option<f64>,
    /// With kind = "noise": added to what the drone is told of its own velocity, [x, y].
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub velocity_bias_mps: Option<[f64; 2]>,
    /// With kind = "noise": standard deviation of each coordinate of the velocity, drawn anew in each tick.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub velocity_std_mps: Option<f64>,
    /// With kind = "wind": an acceleration on top of the commanded one, [x, y].
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub wind_mps2: Option<[f64; 2]>,
    /// With kind = "wind": standard deviation of each coordinate of the gusts on top, drawn for each drone.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub gust_mps2: Option<f64>,
    /// With `gust_mps2`: how long a gust lasts; absent: 1.
    #[schemars(range(max = 36_000.0), extend("exclusiveMinimum" = 0.0))]
    pub gust_s: Option<f64>,
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
    /// The drone reacts later.
    Slow,
    /// It hears nobody.
    Deaf,
    /// Nobody hears it.
    Mute,
    /// No frame passes between sets of drones.
    Partition,
    /// It senses no obstacles, no neighbours, or neither.
    Blind,
    /// It is told a wrong position and velocity of its own.
    Noise,
    /// It is blown about.
    Wind,
}

impl FaultKind {
    /// As it is written.
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
            Self::Noise => "noise",
            Self::Wind => "wind",
        }
    }
}

/// What a fault waits for.
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
    /// The last living drone is.
    Passed,
    /// A drone past the set obeys a plan to re-form.
    Reforming,
    /// A drone takes up leading a group.
    LeaderElected,
    /// A drone takes up leading a subgroup.
    GroupLeaderElected,
}

/// Which sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Sensor {
    /// Of obstacles.
    Obstacles,
    /// Of neighbours.
    Ranging,
}

/// Whom a fault meets, by role. Written as one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum FaultTarget {
    /// Who leads most.
    Leader,
    /// Who leads this group.
    GroupLeader(GroupId),
    /// Who has the lowest rank in a queue.
    FirstInQueue,
    /// Who has the highest rank in a queue.
    LastInQueue,
    /// The lowest number that leads nobody.
    Member,
    /// Anybody, by the seed.
    Random,
    /// Everybody.
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

/// A word that names no target.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "found {0:?}, expected one of \"leader\", \"first-in-queue\", \"last-in-queue\", \"member\", \"random\", \"all\", or \
     \"group-leader:N1\" with a group's name: N and a digit from 1 to 9 for each split"
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

/// `N`, `N1`, `N12`; `2` is short for `N2`.
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
    /// The first half of the numbers, the larger if they are odd, and the second: written `"halves"`.
    Word(SidesWord),
    /// The drones of each side.
    Lists(Vec<Vec<u32>>),
}

/// The only word for sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SidesWord {
    /// Two halves, by number.
    Halves,
}

impl PartitionSides {
    /// The drones of each side in a swarm of so many.
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
    fn targets_are_words() {
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
    fn halves_are_by_number() {
        assert_eq!(PartitionSides::Word(SidesWord::Halves).of(5), [vec![0, 1, 2], vec![3, 4]]);
    }
}
