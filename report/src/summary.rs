//! The result of a run in one object, summary.json.
//!
//! Its keys are a contract: keys may be added, but are never renamed or removed. The value of a key that does not apply is
//! null; the key is never absent.

use crate::pilot_entry::PilotEntry;
use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::{Deserialize, Serialize};
use skein_protocol::record::{FaultKind, Outcome, Percentiles, ViolationKind};
use skein_protocol::{Ballot, DroneId, Lack, Phase, UnfinishedDrone};
use std::collections::BTreeMap;

/// [`Summary::schema`] of this version.
pub const SUMMARY_SCHEMA: &str = "skein-summary/1";

/// The result of a run. SI units; times are in seconds of simulated time unless the key says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// Name and version of this layout.
    pub schema: String,
    /// The scenario's name.
    pub scenario: String,
    /// The strategy by which drones were grouped.
    pub strategy: String,
    /// Seed of all random values.
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
    /// Simulated time per wall time.
    pub realtime_factor: Option<f64>,
    /// Ticks times drones per wall time, 1/s.
    pub agent_steps_per_s: Option<f64>,
    /// Wall time from the first tick opened to the last tick done, planning and recording included, s.
    pub wall_s: Option<f64>,
    /// Wall time from the command to the first tick, s.
    pub startup_s: Option<f64>,
    /// Wall time after the last tick, for files and plots, s.
    pub report_s: Option<f64>,
    /// How the mission ended.
    #[schemars(with = "String", extend("enum" = ["reached", "timeout", "stuck", "unsafe", "aborted"]))]
    pub outcome: Outcome,
    /// Why the mission ended, in words.
    pub reason: Option<String>,
    /// The drones for which it is certain that they do not reach the goal: they have no way there, or no drone is left
    /// alive. Empty unless `outcome` is `stuck`.
    #[serde(default)]
    pub stuck: Vec<u32>,
    /// The drones that kept the mission from its goal when its time was over, those in front of a queue first; at most 64. Empty unless
    /// the time was over.
    #[serde(default)]
    pub unfinished: Vec<UnfinishedEntry>,
    /// How long no living drone had moved when the time was over, s. Null if one had moved within the last 10 s: then the mission was
    /// slow. Null unless the time was over. A drone moves if it gets farther than half a spacing from where it was.
    #[serde(default)]
    pub standstill_s: Option<f64>,
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
    /// Absolute difference between the mean distance of the drones and that of the target shape (R6), m.
    pub mean_distance_error_m: Option<f64>,
    /// Energy used.
    pub energy_j: Energy,
    /// Least distance of two flying bodies over the mission, centre to centre, m.
    pub min_separation_m: Option<f64>,
    /// Least distance of a flying body's centre to an obstacle over the mission, m; negative inside.
    pub min_clearance_m: Option<f64>,
    /// Least altitude of a living drone over the mission, m.
    pub min_altitude_m: Option<f64>,
    /// The invariants that were violated.
    pub violations: Vec<Violation>,
    /// Swarm metrics, averaged over the mission.
    pub metrics: Metrics,
    /// Number of different ballots that led.
    pub elections: u32,
    /// The drones that became leaders, in order of time.
    pub leaders: Vec<LeaderEntry>,
    /// Total time in which two leaders of one group could hear each other, s. A drone that leads a group under a later term is also a leader of
    /// the parts of that group.
    pub split_brain_s: f64,
    /// For each leader that died or was frozen, the time from then until its group had a leader again, s; null if it had none to the end. If
    /// the group splits meanwhile, the leader's part of it counts. A leader that goes on after a freeze before another drone leads is left out.
    pub failover_s: Vec<Option<f64>>,
    /// Messages sent, delivered and dropped.
    pub messages: Messages,
    /// Faults of drones and links, scheduled or not.
    pub faults: Vec<FaultEntry>,
    /// The pilots, and the drones that they flew.
    #[serde(default)]
    pub pilots: Vec<PilotEntry>,
    /// The figures that pilots reported, by name.
    #[serde(default)]
    pub metrics_own: BTreeMap<String, OwnMetric>,
    /// Number of figures, marks and lines that were not recorded, because they were not valid or too many in a tick.
    #[serde(default)]
    pub telemetry_refused: Option<u64>,
    /// Number of parts of the swarm at the end that no radio connects; null unless the scenario says `mission.parts = "each"`.
    #[serde(default)]
    pub parts: Option<u32>,
    /// The pilots that failed.
    #[serde(default)]
    pub failures: Vec<FailureEntry>,
    /// The other machines that flew drones. Drones of no host flew on the launcher's machine.
    #[serde(default)]
    pub hosts: Vec<HostEntry>,
    /// Number of ticks that drones did not answer in time (wall clock only).
    pub deadline_misses: u64,
    /// How late ticks opened, µs (wall clock only; null in lockstep).
    pub lateness_us: Option<StepTimes>,
    /// Wall time of a drone's step, µs; null in the inline runtime.
    pub step_us: Option<StepTimes>,
    /// Number of commands that were not finite and therefore not executed.
    pub rejected_commands: Option<u64>,
    /// Number of ticks missing from the record because the recorder was too slow (wall clock only).
    pub lost_ticks: u64,
    /// Hash over every drone's state and every delivered message in every tick, 16 hex digits.
    pub digest: Option<String>,
}

/// A drone that kept the mission from its goal when its time was over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct UnfinishedEntry {
    /// The drone.
    pub drone: u32,
    /// What it still had to do: `pass` all obstacles, be in a `slot`, `stop` in its slot, or say that it is `done`.
    #[schemars(with = "String", extend("enum" = ["pass", "slot", "stop", "done"]))]
    pub lack: Lack,
    /// Distance from the slot that is left for it, m; null if the goal has no slots.
    pub slot_distance_m: Option<f64>,
    /// How long it had not moved, s.
    pub still_s: f64,
    /// The first obstacle set whose middle is ahead of it: its index in `stages`.
    pub stage: Option<u32>,
    /// Its group.
    pub group: String,
    /// The drone whose plan it obeyed.
    pub leader: Option<u32>,
    /// What that plan told it to do: `cruise`, `avoid` or `reform`.
    #[schemars(with = "String", extend("enum" = ["cruise", "avoid", "reform"]))]
    pub phase: Phase,
    /// Its route past the obstacle set, 0 = rightmost.
    pub route: Option<u16>,
    /// Its place in the queue of that route, 0 = first.
    pub rank: Option<u16>,
}

impl From<UnfinishedDrone> for UnfinishedEntry {
    fn from(drone: UnfinishedDrone) -> Self {
        Self {
            drone: drone.drone.0,
            lack: drone.lack,
            slot_distance_m: drone.slot_distance_m,
            still_s: drone.still_s,
            stage: drone.stage,
            group: drone.group,
            leader: drone.leader.map(|leader| leader.0),
            phase: drone.phase,
            route: drone.route,
            rank: drone.rank,
        }
    }
}

/// A machine that flew drones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HostEntry {
    /// Its name.
    pub name: String,
    /// The drones that flew there.
    pub drones: Vec<u32>,
    /// Time from the opening of a tick to the host's answer, µs. This and all that follows is null for a host that was gone before the
    /// end.
    pub lateness_us: Option<StepTimes>,
    /// Number of ticks that it answered.
    pub ticks: Option<u64>,
    /// Bytes sent to it in ticks.
    pub bytes_down: Option<u64>,
    /// Bytes received from it in ticks.
    pub bytes_up: Option<u64>,
}

/// How one obstacle set was passed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stage {
    /// The ids of its obstacles: their indices in the scenario.
    pub obstacles: Vec<u32>,
    /// When a living drone first sensed it, s.
    pub detected_s: Option<f64>,
    /// When the last living drone was past the mean centre abscissa, s.
    pub passed_s: Option<f64>,
    /// Time from `detected_s` to `passed_s`, s.
    pub pass_time_s: Option<f64>,
    /// Number of routes past the set.
    pub routes: Option<u32>,
    /// Number of drones that passed by each route, rightmost route first, as their tracks show; null if no drone sensed the set.
    pub split: Option<Vec<u32>>,
    /// The same as `[left, right]`; null if there are not exactly two routes.
    pub split_left_right: Option<[u32; 2]>,
    /// The leaders' prediction of `pass_time_s`, s.
    pub predicted_s: Option<f64>,
    /// Number of plans for the set whose forecast was shorter than the free flight of one of their drones to the gate. No drone can
    /// pass sooner than that, so this should be 0.
    #[serde(default)]
    pub forecasts_too_short: Option<u32>,
    /// Number of candidate groupings that a leader simulated before its choice.
    pub candidates_rehearsed: Option<u32>,
    /// The groups that passed it.
    pub groups: Option<Vec<StageGroup>>,
}

/// A group that passed an obstacle set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageGroup {
    /// Its name by lineage, such as `N1` or `N12`.
    pub name: String,
    /// Its route, 0 = rightmost.
    pub route: u16,
    /// The drones that passed in it.
    pub drones: Vec<u32>,
    /// The drone that led it when its drones passed. It can be a drone of another group; null if no drone led it.
    pub leader: Option<u32>,
}

/// Energy used, J.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Energy {
    /// Of the drones alive at the end, from start to end.
    pub total: f64,
    /// Of the drones alive when the last stage was passed, from the start until then.
    pub until_passed: Option<f64>,
    /// Of the drones alive when the last stage was passed, from the first detection until then.
    pub detection_to_pass: Option<f64>,
    /// Of each drone, dead drones included.
    pub per_drone: Vec<f64>,
}

/// A violated invariant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Violation {
    /// When the violation began, s.
    pub t_s: f64,
    /// The invariant.
    #[schemars(
        with = "String",
        extend("enum" = ViolationKind::ALL.map(|kind| serde_json::json!(kind)))
    )]
    pub kind: ViolationKind,
    /// The drones involved.
    pub drones: Vec<u32>,
    /// The violating distance when the violation began, m; 0 if the invariant is not about a distance. It may become worse later.
    pub value_m: f64,
}

/// The swarm metrics of SwarmLab over the living drones, averaged over the mission. From 0 to 1; order from −1 to 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Metrics {
    /// Alignment of the headings of neighbours.
    pub order: Option<f64>,
    /// Share of pairs at least the safe distance apart.
    pub safety: Option<f64>,
    /// (N − connected components) / (N − 1).
    pub union: Option<f64>,
    /// Algebraic connectivity / N; null above 64 drones.
    pub connectivity: Option<f64>,
}

/// A drone that became a leader.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeaderEntry {
    /// When, s.
    pub t_s: f64,
    /// The group that it led.
    pub group: String,
    /// The ballot of its term.
    pub ballot: Term,
    /// The leader.
    pub leader: u32,
}

/// A ballot, which identifies a term of leadership.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub struct Term {
    /// Number of the election.
    pub round: u32,
    /// Incarnation of the claimant's process.
    pub incarnation: u32,
    /// The drone that claimed it.
    pub claimant: u32,
}

impl From<Ballot> for Term {
    fn from(ballot: Ballot) -> Self {
        Self { round: ballot.round, incarnation: ballot.incarnation, claimant: ballot.claimant.0 }
    }
}

/// Messages over the mission. Counts that only the world process knows are null if it died.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Messages {
    /// Frames sent.
    pub sent: u64,
    /// Messages delivered, over all receivers, each message counted once.
    pub delivered: u64,
    /// Messages delivered a second time, over all receivers.
    pub duplicates: Option<u64>,
    /// Frames that were not delivered, by reason.
    pub dropped: Dropped,
    /// Time from sending to delivery.
    #[schemars(with = "PercentilesSchema")]
    pub delay_s: Percentiles,
    /// Age of the last known pose of another drone, each time a drone sends its own. A drone that knows more than 64 others looks at 64 of
    /// them each time.
    #[schemars(with = "PercentilesSchema")]
    pub age_s: Percentiles,
}

/// Frames that were not delivered, over all receivers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Dropped {
    /// Lost independently of other frames.
    pub loss: Option<u64>,
    /// Lost in bursts.
    pub burst: Option<u64>,
    /// The receiver was out of range.
    pub range: Option<u64>,
    /// Sender and receiver were on two sides of a partition.
    pub partition: Option<u64>,
    /// The receiver was deaf or the sender was mute.
    pub deaf: Option<u64>,
    /// The frame could not be decoded.
    pub malformed: Option<u64>,
    /// The frame waited too long for the shared channel.
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

/// A fault of a drone or a link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FaultEntry {
    /// When, s.
    pub t_s: f64,
    /// The kind of fault.
    #[schemars(with = "String")]
    pub kind: FaultKind,
    /// The drone concerned; null for the whole swarm.
    pub target: Option<u32>,
    /// Whether the scenario scheduled it.
    pub scheduled: bool,
    /// Details in words.
    pub detail: String,
}

/// A figure that pilots reported, over the mission.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OwnMetric {
    /// Mean of all values that any drone reported in any tick.
    pub mean: f64,
    /// Mean over the drones that reported it in the last tick in which any drone did.
    pub last: f64,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
}

/// A pilot that failed: it panicked, raised an exception, hung, or commanded or said something that cannot be used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FailureEntry {
    /// When, s.
    pub t_s: f64,
    /// Its drone.
    pub drone: u32,
    /// Its name.
    pub pilot: String,
    /// Why, in words.
    pub reason: String,
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

/// The numbers of drones.
pub(crate) fn numbers(drones: &[DroneId]) -> Vec<u32> {
    drones.iter().map(|drone| drone.0).collect()
}
