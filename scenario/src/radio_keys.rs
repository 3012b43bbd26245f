//! The keys of `[radio]`: how the radio delays, loses, copies and queues frames.

use crate::limits::MAX_DRONES;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the radio delays, loses, copies and queues frames. docs/radio.md explains the models and the presets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadioKeys {
    /// A named radio. It sets those of the keys below that the scenario does not write.
    pub preset: Option<Preset>,
    /// Mean delay of a frame. A frame takes at least one tick.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub delay_s: f64,
    /// Standard deviation of the delay. Above 0 it needs a `delay_model` other than `"fixed"`.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub jitter_s: f64,
    /// Distribution of the delay.
    pub delay_model: DelayModel,
    /// Probability that a receiver loses a frame, independent for each frame and receiver.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// Greatest distance at which frames are received; absent: no limit. With `shadowing_db` it is the distance at which
    /// half of the frames are received.
    #[schemars(range(max = 1e6), extend("exclusiveMinimum" = 0.0))]
    pub range_m: Option<f64>,
    /// Standard deviation of the shadowing, which makes the range gradual. With 0 the range is a hard limit.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub shadowing_db: f64,
    /// Exponent of the path loss; 2 in free space. A greater value makes a gradual range steeper.
    #[schemars(range(min = 1.0, max = 8.0))]
    pub path_loss_exponent: f64,
    /// Probability that a received frame is received a second time, after a delay of its own.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub duplicate: f64,
    /// Difference between the two directions of a link. Delay and loss are multiplied by a factor in one direction and
    /// divided by it in the other. The factor is drawn for each pair of drones, by the seed, log-uniformly from 1 to
    /// 1 + this.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub asymmetry: f64,
    /// Whether random numbers are keyed by link and time instead of the frame's number, so that strategies that send different
    /// frames meet the same air. Frames of one topic that a drone sends in one tick then share their fate at a receiver.
    pub keyed_by_time: bool,
    /// Bit rate of the channel that drones near each other share. Frames queue for it; absent: no limit.
    #[schemars(range(max = 1e12), extend("exclusiveMinimum" = 0.0))]
    pub rate_bps: Option<f64>,
    /// A drone waits for the channel while a drone within this distance transmits; absent: while any drone transmits.
    #[schemars(range(max = 1e6), extend("exclusiveMinimum" = 0.0))]
    pub carrier_sense_m: Option<f64>,
    /// A frame that would wait longer than this for the channel is dropped.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub queue_limit_s: f64,
    /// Burst losses (Gilbert-Elliott model).
    pub burst: Option<BurstKeys>,
    /// Other values for some topics, senders or receivers. A key that a rule does not write is as in `[radio]`. If several
    /// rules match a frame, the last one counts.
    #[serde(rename = "rule")]
    #[schemars(length(max = 64))]
    pub rules: Vec<RuleKeys>,
}

impl Default for RadioKeys {
    fn default() -> Self {
        Self {
            preset: None,
            delay_s: 0.0,
            jitter_s: 0.0,
            delay_model: DelayModel::Fixed,
            loss: 0.0,
            range_m: None,
            shadowing_db: 0.0,
            path_loss_exponent: 2.0,
            duplicate: 0.0,
            asymmetry: 0.0,
            keyed_by_time: false,
            rate_bps: None,
            carrier_sense_m: None,
            queue_limit_s: 1.0,
            burst: None,
            rules: Vec::new(),
        }
    }
}

/// A named radio.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// No frame is lost, and each takes one tick.
    Ideal,
    /// Ad-hoc 802.11 broadcast in open space.
    Wifi,
    /// A multi-hop 802.11 mesh in a city.
    MeshLossy,
    /// A cellular network, drone to drone through its base stations.
    Lte,
    /// The `wifi` preset with a jammer that is on half of the time.
    Jammed,
    /// A geostationary satellite, one hop.
    Satellite,
}

/// Distribution of the delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DelayModel {
    /// Always `delay_s`.
    Fixed,
    /// Uniform within `delay_s` ± √3 `jitter_s`.
    Uniform,
    /// Normal, without its negative part.
    Normal,
    /// Gamma: never negative, with a long tail.
    Gamma,
}

/// Burst losses: a link is in a burst or not, for exponentially distributed times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BurstKeys {
    /// Fraction of the time that is in a burst.
    #[schemars(range(min = 0.0, max = 0.99))]
    pub share: f64,
    /// Mean length of a burst.
    #[schemars(range(min = 0.001, max = 600.0))]
    pub length_s: f64,
    /// Probability that a frame is lost in a burst.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// Which links are in a burst together.
    pub scope: BurstScope,
}

impl Default for BurstKeys {
    fn default() -> Self {
        Self { share: 0.1, length_s: 0.5, loss: 1.0, scope: BurstScope::Direction }
    }
}

/// Which links are in a burst together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BurstScope {
    /// One direction of one link.
    Direction,
    /// Both directions of one link.
    Link,
    /// All links at once.
    Swarm,
}

/// Other values for the frames that match all conditions of this rule.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RuleKeys {
    /// Condition: the frame has one of these topics; absent: any topic. The built-in topics are `"pose"` (the position of a drone
    /// and what it obeys), `"obstacle"` (one that a drone sensed), `"leadership"` (a claim to lead, or a heartbeat), `"plan"`
    /// (of a leader), `"assignment"` (one drone's part in a plan), `"arrivals"` (when one member of a group can reach the next
    /// gate), `"passed"` (which drones are past which obstacle set), `"separation"` (lines that keep drones apart, without
    /// ranging) and `"presence"` (the states of drones that others heard of). All others are those that a `[[pilot]]` declares.
    #[schemars(length(min = 1, max = 16))]
    pub topics: Option<Vec<String>>,
    /// Condition: one of these drones sends the frame; absent: any drone.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(range(min = 0, max = MAX_DRONES - 1)))]
    pub from: Option<Vec<u32>>,
    /// Condition: one of these drones receives the frame; absent: any drone.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(range(min = 0, max = MAX_DRONES - 1)))]
    pub to: Option<Vec<u32>>,
    /// Instead of `radio.delay_s`.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub delay_s: Option<f64>,
    /// Instead of `radio.jitter_s`.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub jitter_s: Option<f64>,
    /// Instead of `radio.delay_model`.
    pub delay_model: Option<DelayModel>,
    /// Instead of `radio.loss`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: Option<f64>,
    /// Instead of `radio.range_m`.
    #[schemars(range(max = 1e6), extend("exclusiveMinimum" = 0.0))]
    pub range_m: Option<f64>,
    /// Instead of `radio.shadowing_db`.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub shadowing_db: Option<f64>,
    /// Instead of `radio.duplicate`.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub duplicate: Option<f64>,
    /// Instead of `radio.burst`. With a `share` of 0 there are no bursts.
    pub burst: Option<BurstKeys>,
}
