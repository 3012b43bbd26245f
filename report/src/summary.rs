//! The outcome of a run in one object. Its keys are a contract: added to freely, never renamed or dropped; what does
//! not apply is null, never absent.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Deserialize, Serialize};
use skein_protocol::record::{FaultKind, Outcome, Percentiles, ViolationKind};
use skein_protocol::{Ballot, DroneId};

/// [`Summary::schema`] of this version.
pub const SUMMARY_SCHEMA: &str = "skein-summary/1";

/// What came of a run. SI units; times in seconds of simulated time unless the key says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Name and version of this layout.
    pub schema: String,
    /// The scenario's name.
    pub scenario: String,
    /// How drones were grouped.
    pub strategy: String,
    /// Key of everything random.
    pub seed: u64,
    /// `processes` or `inline`.
    pub runtime: String,
    /// `lockstep`, `realtime` or `realtime:SPEED`.
    pub clock: String,
    /// Number of drones at the start.
    pub drones: u32,
    /// Length of a tick, s.
    pub dt_s: f64,
    /// Number of ticks.
    pub ticks: u64,
    /// Simulated time, s.
    pub sim_s: f64,
    /// Simulated time by wall time.
    pub realtime_factor: Option<f64>,
    /// Ticks times drones by wall time, 1/s.
    pub agent_steps_per_s: Option<f64>,
    /// Wall time from the first tick opened to the last tick done, planning and recording included, s.
    pub wall_s: Option<f64>,
    /// Wall time from the command to the first tick, s.
    pub startup_s: Option<f64>,
    /// Wall time of what came after the last tick (files, plots), s.
    pub report_s: Option<f64>,
    /// How it ended.
    #[schemars(with = "String", extend("enum" = ["reached", "timeout", "unsafe", "aborted"]))]
    pub outcome: Outcome,
    /// Why it ended, in words.
    pub reason: Option<String>,
    /// One for each obstacle set, in flight order.
    pub stages: Vec<Stage>,
    /// When the mission ended, s.
    pub mission_s: f64,
    /// First time a living drone obeyed a plan to reform after the last stage was passed, s.
    pub reform_start_s: Option<f64>,
    /// Time from which the formation stayed closed until the end, s.
    pub reform_end_s: Option<f64>,
    /// Largest slot error of the living drones at the end, after the best translation and assignment, m.
    pub formation_error_m: Option<f64>,
    /// Root of the mean squared slot error, m.
    pub formation_rmse_m: Option<f64>,
    /// Mean distance between drones against the shape's (R6), absolute difference, m.
    pub mean_distance_error_m: Option<f64>,
    /// Energy used.
    pub energy_j: Energy,
    /// Least distance of two flying bodies over the mission, centre to centre, m.
    pub min_separation_m: Option<f64>,
    /// Least distance of a flying body's centre to an obstacle over the mission, m; negative inside.
    pub min_clearance_m: Option<f64>,
    /// Invariants that were broken.
    pub violations: Vec<Violation>,
    /// Means over the mission.
    pub metrics: Metrics,
    /// Number of different ballots that led.
    pub elections: u32,
    /// Who took up leading, when.
    pub leaders: Vec<LeaderEntry>,
    /// Time during which two leaders of one group could hear each other, added up, s.
    pub split_brain_s: f64,
    /// For each death of a leader, the time until another drone led its group, s; null if none ever did.
    pub failover_s: Vec<Option<f64>>,
    /// What was said and heard.
    pub messages: Messages,
    /// What was done to drones and links, or happened to them.
    pub faults: Vec<FaultEntry>,
    /// Ticks that drones did not answer in time (wall clock only).
    pub deadline_misses: u64,
    /// How late ticks opened, µs (wall clock only; null in lockstep).
    pub lateness_us: Option<StepTimes>,
    /// Wall time of a drone's step, µs; null in the inline runtime.
    pub step_us: Option<StepTimes>,
    /// Commands that were not finite and not carried out.
    pub rejected_commands: Option<u64>,
    /// Ticks missing from this record because the recorder was full (wall clock only).
    pub lost_ticks: u64,
    /// Over every drone's state and every delivered message in every tick: 16 hex digits.
    pub digest: Option<String>,
}

/// How one obstacle set was passed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stage {
    /// The set's obstacles, by their places in the scenario.
    pub obstacles: Vec<u32>,
    /// First tick a living drone sensed it, s.
    pub detected_s: Option<f64>,
    /// When the last living drone was past the mean centre abscissa, s.
    pub passed_s: Option<f64>,
    /// From detected to passed, s.
    pub pass_time_s: Option<f64>,
    /// Number of routes past the set.
    pub routes: Option<u32>,
    /// Drones for each route as flown, rightmost route first.
    pub split: Option<Vec<u32>>,
    /// The same as `[left, right]`; null if there are not exactly two routes.
    pub split_left_right: Option<[u32; 2]>,
    /// The leaders' forecast of `pass_time_s`, s.
    pub predicted_s: Option<f64>,
    /// Groupings simulated forward before the choice.
    pub candidates_rehearsed: Option<u32>,
    /// Who flew with whom.
    pub groups: Option<Vec<StageGroup>>,
}

/// A group as it passed a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageGroup {
    /// Its lineage: `N1`, `N12`.
    pub name: String,
    /// Its route, 0 = rightmost.
    pub route: u16,
    /// Its drones that passed.
    pub drones: Vec<u32>,
    /// Who led it.
    pub leader: Option<u32>,
}

/// Energy used, J.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Energy {
    /// By the drones living at the end, from start to end.
    pub total: f64,
    /// By the drones living then, from the start until the last stage was passed.
    pub until_passed: Option<f64>,
    /// By the drones living then, from the first detection until the last stage was passed.
    pub detection_to_pass: Option<f64>,
    /// By each drone, dead ones too.
    pub per_drone: Vec<f64>,
}

/// An invariant that was broken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Violation {
    /// When it began, s.
    pub t_s: f64,
    /// Which.
    #[schemars(
        with = "String",
        extend("enum" = ["separation", "clearance", "conflicting-assignment", "ballot-went-back"])
    )]
    pub kind: ViolationKind,
    /// Who.
    pub drones: Vec<u32>,
    /// How far, m.
    pub value_m: f64,
}

/// SwarmLab's swarm metrics of the living drones, from 0 to 1 (order: from −1), averaged over the mission.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Metrics {
    /// How alike the headings of neighbours are.
    pub order: Option<f64>,
    /// Share of pairs at the safe distance or beyond.
    pub safety: Option<f64>,
    /// (N − connected components) / (N − 1).
    pub union: Option<f64>,
    /// Algebraic connectivity / N; null above 64 drones.
    pub connectivity: Option<f64>,
}

/// A drone that took up leading.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeaderEntry {
    /// When, s.
    pub t_s: f64,
    /// Which group.
    pub group: String,
    /// Its term.
    pub ballot: Term,
    /// Who.
    pub leader: u32,
}

/// A term of leadership.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Term {
    /// Number of the election.
    pub round: u32,
    /// Of the claimant's process.
    pub incarnation: u32,
    /// Who claimed it.
    pub claimant: u32,
}

impl From<Ballot> for Term {
    fn from(ballot: Ballot) -> Self {
        Self { round: ballot.round, incarnation: ballot.incarnation, claimant: ballot.claimant.0 }
    }
}

/// Messages over the mission. Counts that only the world knows are null if it died.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Messages {
    /// Frames sent.
    pub sent: u64,
    /// Messages heard, over all receivers, each counted once.
    pub delivered: u64,
    /// Messages heard for the second time, over all receivers.
    pub duplicates: Option<u64>,
    /// Not heard, by reason.
    pub dropped: Dropped,
    /// From sending to hearing.
    #[schemars(with = "PercentilesSchema")]
    pub delay_s: Percentiles,
    /// Age of a peer's last known pose.
    #[schemars(with = "PercentilesSchema")]
    pub age_s: Percentiles,
}

/// Frames that were not heard, over all receivers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Dropped {
    /// Lost on their own.
    pub loss: Option<u64>,
    /// Lost in bursts.
    pub burst: Option<u64>,
    /// Out of range.
    pub range: Option<u64>,
    /// Between two sides of a partition.
    pub partition: Option<u64>,
    /// At a deaf receiver, or from a mute sender.
    pub deaf: Option<u64>,
    /// Not to be decoded.
    pub malformed: Option<u64>,
    /// Waited too long for the channel.
    pub queue: Option<u64>,
}

/// The JSON schema of [`Percentiles`], which protocol defines without one.
#[derive(JsonSchema)]
#[serde(remote = "Percentiles", rename = "Percentiles")]
#[schemars(description = "Statistics of counted times, s; null if nothing was counted.")]
#[allow(dead_code, reason = "only its schema is used")]
struct PercentilesSchema {
    /// Mean, s.
    mean: Option<f64>,
    /// Median, s.
    p50: Option<f64>,
    /// 99th percentile, s.
    p99: Option<f64>,
    /// Maximum, s.
    max: Option<f64>,
}

/// A fault.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FaultEntry {
    /// When, s.
    pub t_s: f64,
    /// What.
    #[schemars(with = "String")]
    pub kind: FaultKind,
    /// Whom; null: the whole swarm.
    pub target: Option<u32>,
    /// Whether the scenario asked for it.
    pub scheduled: bool,
    /// What is known of it, in words.
    pub detail: String,
}

/// Wall times, µs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StepTimes {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

/// The JSON schema of [`Summary`].
#[must_use]
pub fn schema_summary() -> serde_json::Value {
    SchemaSettings::default().for_serialize().into_generator().into_root_schema_for::<Summary>().to_value()
}

/// Drones as JSON numbers.
pub(crate) fn numbers(drones: &[DroneId]) -> Vec<u32> {
    drones.iter().map(|drone| drone.0).collect()
}
