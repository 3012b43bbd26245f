//! A sample of the swarm, as it is written in JSON to the recording, the page and the live view. Lists without another
//! description have one entry per drone, in the order of the drones' numbers.

use crate::scene::shown::Shown;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The swarm at the end of a tick, and the radio traffic since the previous sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sample {
    /// Positions and activity of the drones.
    pub state: State,
    /// Energy used so far.
    pub energy: EnergySample,
    /// Radio traffic since the previous sample.
    pub radio: RadioSample,
    /// What pilots show: marks and lines.
    #[serde(default, skip_serializing_if = "Shown::is_empty")]
    pub shown: Shown,
}

/// Positions of the drones, and the plans they obey. World frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct State {
    /// Number of the tick.
    pub tick: u64,
    /// Simulated time, s.
    pub t_s: f64,
    /// Position along the flight direction, m.
    pub x_m: Vec<f64>,
    /// Position to the left of the flight direction, m.
    pub y_m: Vec<f64>,
    /// Height above the ground, m.
    #[serde(default)]
    pub z_m: Vec<f64>,
    /// Velocity along x, m/s.
    pub vx_mps: Vec<f64>,
    /// Velocity along y, m/s.
    pub vy_mps: Vec<f64>,
    /// Vertical velocity, upward, m/s.
    #[serde(default)]
    pub vz_mps: Vec<f64>,
    /// 1 if the drone's process lives, else 0.
    pub alive: Vec<u8>,
    /// The drone's group, by lineage.
    pub group: Vec<String>,
    /// The leader that the drone obeys.
    pub leader: Vec<Option<u32>>,
    /// The group that the drone leads.
    pub leads: Vec<Option<String>>,
    /// 0: cruise, 1: avoid, 2: reform.
    pub phase: Vec<u32>,
    /// The drone's route past the obstacle set, 0 = rightmost.
    pub route: Vec<Option<u16>>,
    /// The drone's place in the queue of its route.
    pub rank: Vec<u16>,
    /// Round and epoch of the plan that the drone obeys.
    pub plan: Vec<[u32; 2]>,
    /// Current position of the drone's slot in the formation, if it is known, m.
    pub slot_m: Vec<Option<[f64; 2]>>,
    /// 1 if the drone missed the deadline of the tick (wall clock only), else 0.
    pub late: Vec<u8>,
}

/// Energy used since the start, J.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EnergySample {
    /// Sum over the living drones.
    pub total_j: f64,
    /// Of each drone.
    pub drone_j: Vec<f64>,
}

/// Radio traffic since the previous sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RadioSample {
    /// Frames sent, by kind.
    pub sent: BTreeMap<String, u32>,
    /// Messages delivered, by receiver.
    pub heard: Vec<u32>,
    /// Frames dropped, by reason, over all receivers.
    pub dropped: BTreeMap<String, u32>,
    /// Frames dropped, by receiver.
    pub dropped_by: Vec<u32>,
    /// The frames sent; empty in a large swarm without a selected receiver.
    pub frames: Vec<SentFrame>,
    /// The only receiver for which deliveries are listed; `None` if they are listed for all.
    pub receiver: Option<u32>,
}

/// A frame that was sent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SentFrame {
    /// Time of sending, s.
    pub t_s: f64,
    /// The sender.
    pub source: u32,
    /// Running number of the source's frames.
    pub sequence: u32,
    /// Name of its topic; `unknown` for an invalid topic.
    pub kind: Cow<'static, str>,
    /// A short description of its content; empty for beacons.
    #[serde(rename = "says")]
    pub content: String,
    /// A letter per receiver: `h` for delivered, `-` for the sender and for dead and frozen drones, or the reason for which it
    /// was dropped: `l`oss, `b`urst, `r`ange, `p`artition, `d`eaf, `m`alformed, `q`ueue, `?` for any other.
    #[serde(rename = "fate")]
    pub deliveries: String,
}
