//! `[radio]`: what the air does to frames, by preset, by key, by rule.

mod resolve;
mod rules;

pub(crate) use resolve::fill_preset;
pub(crate) use rules::broken;

use crate::keys::MAX_DRONES;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the air does to frames: delay, loss, range, copies, bandwidth; `docs/radio.md` has the models and the presets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RadioKeys {
    /// A named radio: sets the keys below that are not written; those that are override it.
    pub preset: Option<Preset>,
    /// Mean time on the air; a frame takes one tick at least.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub delay_s: f64,
    /// Standard deviation of the time on the air; above 0 it needs a `delay_model` that varies.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub jitter_s: f64,
    /// How the time on the air is distributed.
    pub delay_model: DelayModel,
    /// Probability that a receiver does not hear a frame, independent for each frame and receiver.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// Distance within which frames are heard, with shadowing within which half of them are; absent: no limit.
    #[schemars(range(max = 1e6), extend("exclusiveMinimum" = 0.0))]
    pub range_m: Option<f64>,
    /// Standard deviation of the shadowing, which makes the range gradual; with 0 it is a hard limit.
    #[schemars(range(min = 0.0, max = 30.0))]
    pub shadowing_db: f64,
    /// Exponent of the path loss, 2 in free space; the greater, the steeper a gradual range.
    #[schemars(range(min = 1.0, max = 8.0))]
    pub path_loss_exponent: f64,
    /// Probability that a frame that is heard is heard a second time, after a delay of its own.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub duplicate: f64,
    /// How different the directions of a link are: one has its delay and its loss multiplied, the other divided, by a
    /// factor drawn (by the seed) for each pair of drones, log-uniformly from 1 to 1 + this.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub asymmetry: f64,
    /// Bit rate of the channel that all drones share, on which frames queue; absent: no limit.
    #[schemars(range(max = 1e12), extend("exclusiveMinimum" = 0.0))]
    pub rate_bps: Option<f64>,
    /// A frame that would wait longer than this for the channel is not sent.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub queue_limit_s: f64,
    /// Losses that come together (Gilbert-Elliott).
    pub burst: Option<BurstKeys>,
    /// Another air for some topics, senders, receivers; what a rule does not say is as in `[radio]`. Of several rules
    /// about one frame the last counts.
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
            rate_bps: None,
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
    /// Nothing is lost, a frame takes one tick.
    Ideal,
    /// Ad-hoc 802.11 in the open, broadcast.
    Wifi,
    /// A multi-hop 802.11 mesh in a city.
    MeshLossy,
    /// A cellular network, drone to drone through its base stations.
    Lte,
    /// The `wifi` preset with a jammer that is on half the time.
    Jammed,
    /// A geostationary satellite, one hop.
    Satellite,
}

/// How the time on the air is distributed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DelayModel {
    /// Always `delay_s`.
    Fixed,
    /// Uniform, `delay_s` ± √3 `jitter_s`.
    Uniform,
    /// Normal, of the part that is not negative.
    Normal,
    /// Gamma: never negative, a long tail.
    Gamma,
}

/// Losses that come together: a link is quiet or in a burst, for times that are exponentially distributed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BurstKeys {
    /// Share of time that bursts take.
    #[schemars(range(min = 0.0, max = 0.99))]
    pub share: f64,
    /// Mean length of a burst.
    #[schemars(range(min = 0.001, max = 600.0))]
    pub length_s: f64,
    /// Probability that a frame is lost in a burst.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub loss: f64,
    /// Whom a burst befalls.
    pub scope: BurstScope,
}

impl Default for BurstKeys {
    fn default() -> Self {
        Self { share: 0.1, length_s: 0.5, loss: 1.0, scope: BurstScope::Direction }
    }
}

/// Whom a burst befalls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BurstScope {
    /// One direction of one link.
    Direction,
    /// Both directions of one link.
    Link,
    /// Everybody at once.
    Swarm,
}

/// Another air for the frames that meet all conditions of this rule.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RuleKeys {
    /// Of these topics; absent: of all.
    #[schemars(length(min = 1, max = 16))]
    pub topics: Option<Vec<TopicKey>>,
    /// Sent by these drones; absent: by all.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(range(min = 0, max = MAX_DRONES - 1)))]
    pub from: Option<Vec<u32>>,
    /// At these receivers; absent: at all.
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
    /// Instead of `radio.burst`; with a share of 0 there are none.
    pub burst: Option<BurstKeys>,
}

/// A kind of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TopicKey {
    /// Where a drone is and what it obeys.
    Pose,
    /// An obstacle somebody sensed.
    Obstacle,
    /// A claim to lead or a heartbeat.
    Leadership,
    /// What a leader decided.
    Plan,
    /// One drone's part in it.
    Assignment,
    /// When one member of a group can be at the next gate.
    Arrivals,
    /// Who is through which set.
    Passed,
}
