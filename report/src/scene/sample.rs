//! A sample of the swarm. Written as JSON into the recording, the report and the live view's socket; lists have one
//! entry a drone, in the order of their numbers.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The swarm at the end of a tick, and what was said since the sample before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sample {
    /// Where the drones are and what they do.
    pub state: State,
    /// What they have used.
    pub energy: EnergySample,
    /// What they have said and heard.
    pub radio: RadioSample,
}

/// Where the drones are, and what they obey. World frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct State {
    /// The tick's number.
    pub tick: u64,
    /// Simulated time, s.
    pub t_s: f64,
    /// Along the flight, m.
    pub x_m: Vec<f64>,
    /// To the left of it, m.
    pub y_m: Vec<f64>,
    /// m/s.
    pub vx_mps: Vec<f64>,
    /// m/s.
    pub vy_mps: Vec<f64>,
    /// 1 if its process lives, else 0.
    pub alive: Vec<u8>,
    /// Its group, by lineage.
    pub group: Vec<String>,
    /// Whom it obeys.
    pub leader: Vec<Option<u32>>,
    /// The group it leads.
    pub leads: Vec<Option<String>>,
    /// 0: cruise, 1: avoid, 2: reform.
    pub phase: Vec<u32>,
    /// Its route past the set, 0 = rightmost.
    pub route: Vec<Option<u16>>,
    /// Its place in the queue.
    pub rank: Vec<u16>,
    /// Round and epoch of the plan it obeys.
    pub plan: Vec<[u32; 2]>,
    /// Where its slot in the formation is now, if it is known, m.
    pub slot_m: Vec<Option<[f64; 2]>>,
    /// 1 if it missed the tick's deadline (wall clock only), else 0.
    pub late: Vec<u8>,
}

/// Energy used since the start, J.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EnergySample {
    /// By the living drones together.
    pub total_j: f64,
    /// By each.
    pub drone_j: Vec<f64>,
}

/// What was said and heard since the sample before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RadioSample {
    /// Frames sent, by kind.
    pub sent: BTreeMap<String, u32>,
    /// Messages heard, by receiver.
    pub heard: Vec<u32>,
    /// Frames not heard, by reason, over all receivers.
    pub dropped: BTreeMap<String, u32>,
    /// Frames not heard, by receiver.
    pub dropped_by: Vec<u32>,
    /// The frames, if they are listed.
    pub frames: Vec<SentFrame>,
    /// The only receiver that the frames' fates are told for; `None`: all.
    pub receiver: Option<u32>,
}

/// A frame on the air.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SentFrame {
    /// When it was sent, s.
    pub t_s: f64,
    /// Who sent it.
    pub source: u32,
    /// Running number of the source's frames.
    pub sequence: u32,
    /// A topic's name; `unknown` if it is none.
    pub kind: Cow<'static, str>,
    /// What it says, shortly; empty for beacons.
    #[serde(rename = "says")]
    pub content: String,
    /// A letter for each receiver: `h` heard, `-` not for it (its sender, a dead drone), or why not: `l`oss, `b`urst,
    /// `r`ange, `p`artition, `d`eaf, `m`alformed, `?` another reason.
    #[serde(rename = "fate")]
    pub deliveries: String,
}
