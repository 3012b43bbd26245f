//! What the world sends to the recorder: one row per drone and tick, every frame, and events.

use crate::drop_reason::DROP_REASONS;
use crate::frame::AirFrame;
use crate::ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
use crate::link_faults::LinkFaults;
use crate::telemetry::TelemetryRow;
use crate::time::{SimTime, Tick};
use crate::unfinished::UnfinishedDrone;
use crate::wire::Phase;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The head of a record sample. The [`DroneRow`]s, the [`AirFrame`]s, the [`TelemetryRow`]s and `events_len` bytes of JSON lines
/// follow it in this order. Each line is one [`RunEvent`].
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RecordHeader {
    /// The tick that just ended.
    pub tick: Tick,
    /// Time at the end of the tick. The rows hold the state at this time.
    pub now: SimTime,
    /// Number of rows, one per drone.
    pub rows: u32,
    /// Number of frames sent in this tick.
    pub frames: u32,
    /// Number of figures, marks and lines that pilots reported in this tick.
    pub telemetry: u32,
    /// Length of the JSON lines, bytes.
    pub events_len: u32,
    /// Number of ticks whose records were dropped since the last sample because the recorder was full (wall clock only).
    pub lost: u32,
    /// Always 0.
    pub reserved: u32,
    /// Running digest of the mission so far.
    pub digest: u64,
}

/// [`DroneRow::flags`]: the drone's process is alive.
pub const ROW_ALIVE: u32 = 1;
/// [`DroneRow::flags`]: the drone leads a group.
pub const ROW_LEADS: u32 = 2;
/// [`DroneRow::flags`]: the drone flies a route past an obstacle set.
pub const ROW_QUEUED: u32 = 4;
/// [`DroneRow::flags`]: the drone missed this tick's deadline, and the world held its last command (wall clock only).
pub const ROW_LATE: u32 = 8;
/// [`DroneRow::flags`]: the drone's process is frozen.
pub const ROW_FROZEN: u32 = 16;

/// A drone at the end of a tick: its true state in the world, and the plan that the drone reports to obey.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct DroneRow {
    /// True position, world frame, m.
    pub position_m: [f64; 3],
    /// True velocity, world frame, m/s.
    pub velocity_mps: [f64; 3],
    /// Acceleration that the pilot commanded in this tick, world frame, m/s². NaN if no command was carried out, because the
    /// drone was dead, frozen or late.
    pub commanded_mps2: [f64; 3],
    /// Energy used since the start of the mission, J.
    pub energy_j: f64,
    /// The plan that the drone obeys.
    pub obeyed: PlanStamp,
    /// The term that the drone obeys, or in which it leads.
    pub term: Ballot,
    /// The drone's group.
    pub group: GroupId,
    /// The group that the drone leads; meaningful only with [`ROW_LEADS`].
    pub led: GroupId,
    /// Combination of [`ROW_ALIVE`], [`ROW_LEADS`], [`ROW_QUEUED`], [`ROW_LATE`] and [`ROW_FROZEN`].
    pub flags: u32,
    /// A [`Phase`], see [`DroneRow::phase`].
    pub phase: u32,
    /// Number of messages that the drone heard in this tick.
    pub heard: u32,
    /// Number of frames that its radio dropped in this tick, indexed by [`crate::radio::DropReason`].
    pub dropped: [u32; DROP_REASONS],
    /// Effects of the current faults on its radio.
    pub link_faults: LinkFaults,
    /// Wall time that the drone's step took, ns.
    pub step_ns: u32,
    /// Route past the obstacle set, 0 = rightmost; [`crate::payload::NO_ROUTE`] if the drone has none.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
    /// Always 0; makes the size of the row a multiple of eight bytes.
    pub reserved: [u32; DROP_REASONS % 2],
}

impl DroneRow {
    /// The drone's leader: the claimant of the ballot that it obeys. `None` if it obeys no ballot.
    #[must_use]
    pub fn leader(&self) -> Option<DroneId> {
        self.obeyed.ballot.is_some().then_some(self.obeyed.ballot.claimant)
    }

    /// Phase of the plan that the drone obeys. An unknown number counts as [`Phase::Cruise`].
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::from_wire(self.phase).unwrap_or_default()
    }

    /// Whether the drone's process is alive.
    #[must_use]
    pub fn alive(&self) -> bool {
        self.flags & ROW_ALIVE != 0
    }

    /// Whether the drone leads a group.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.flags & ROW_LEADS != 0
    }

    /// Whether the drone flies a route past an obstacle set.
    #[must_use]
    pub fn is_queued(&self) -> bool {
        self.flags & ROW_QUEUED != 0
    }

    /// Whether the drone missed this tick's deadline (wall clock only).
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.flags & ROW_LATE != 0
    }

    /// Whether the drone's process is frozen.
    #[must_use]
    pub fn is_frozen(&self) -> bool {
        self.flags & ROW_FROZEN != 0
    }
}

/// The end of a mission names at most this number of drones that are not done.
pub const UNFINISHED_MAX: usize = 64;

/// How a mission ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The end condition is met and the formation is closed.
    Reached,
    /// The time limit of the mission ran out.
    Timeout,
    /// It is certain that the mission cannot reach its goal: some drone has no way there, or no drone is left alive.
    Stuck,
    /// An invariant was broken.
    Unsafe,
    /// The mission was interrupted, or its world process died.
    Aborted,
}

/// The invariant that is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViolationKind {
    /// Two drones are closer than the safe distance. The event's value is their distance, m.
    Separation,
    /// A drone is closer to an obstacle than the obstacle clearance. The event's value is the distance, m.
    Clearance,
    /// A living drone is closer to the ground than the obstacle clearance. The event's value is its altitude, m.
    Ground,
    /// A drone obeys two different assignments under the same plan. The event's value is 0.
    ConflictingAssignment,
    /// A drone obeys an older plan than before, although its process has not restarted. The event's value is 0.
    BallotWentBack,
}

impl ViolationKind {
    /// All invariants.
    pub const ALL: [Self; 5] =
        [Self::Separation, Self::Clearance, Self::Ground, Self::ConflictingAssignment, Self::BallotWentBack];

    /// Whether the invariant is about a distance, which the event then has.
    #[must_use]
    pub fn is_distance(self) -> bool {
        match self {
            Self::Separation | Self::Clearance | Self::Ground => true,
            Self::ConflictingAssignment | Self::BallotWentBack => false,
        }
    }
}

/// A fault: one that the scenario injects into a drone or a link, or an unscheduled failure of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// The process ended by a signal, an exit or a crash.
    Kill,
    /// The process did not answer for five seconds of wall time in lockstep, and was killed.
    Hung,
    /// The process is stopped and continues later.
    Freeze,
    /// The process is killed, and a new one replaces it.
    Restart,
    /// The drone reacts with a delay.
    Slow,
    /// The drone hears no other drone.
    Deaf,
    /// No other drone hears this drone.
    Mute,
    /// Drones on different sides of the partition cannot hear each other.
    Partition,
    /// The drone senses no obstacles, no neighbours, or neither of them.
    Blind,
    /// What the drone ranges of its neighbours is worse or missing.
    Ranging,
    /// The position that the drone reads of itself is biased, or drifts.
    Gnss,
    /// The drone's clock jumps, or drifts.
    Clock,
    /// The drone receives a wrong position or velocity of its own.
    Noise,
    /// Wind pushes the drone.
    Wind,
    /// The machine that flies the drone is gone.
    HostDown,
}

impl FaultKind {
    /// Whether the fault ends or stops the drone's process.
    #[must_use]
    pub fn stops_process(self) -> bool {
        matches!(self, Self::Kill | Self::Hung | Self::Freeze | Self::Restart | Self::HostDown)
    }
}

/// Mean, percentiles and maximum of the counted delays or ages, s. All fields are `None` if nothing was counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Mean, s.
    pub mean: Option<f64>,
    /// Median, s.
    pub p50: Option<f64>,
    /// 99th percentile, s.
    pub p99: Option<f64>,
    /// Maximum, s.
    pub max: Option<f64>,
}

/// Counters of a whole mission, reported at its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Number of frames that all drones sent.
    pub sent: u64,
    /// Messages heard, summed over all receivers; a message counts once per receiver.
    pub delivered: u64,
    /// Messages heard for the second time, summed over all receivers.
    pub duplicates: u64,
    /// Frames not heard, indexed by [`crate::radio::DropReason`], summed over all receivers.
    pub dropped: [u64; DROP_REASONS],
    /// Delay from sending to hearing.
    pub delay_s: Percentiles,
    /// Age of a peer's last known pose.
    pub age_s: Percentiles,
    /// Commands that the world rejected because they were not finite.
    pub rejected_commands: u64,
    /// Figures, marks and lines that were not recorded: they were not valid, or more than a drone can report in a tick.
    #[serde(default)]
    pub telemetry_refused: u64,
    /// Number of times a drone missed a tick's deadline (wall clock only).
    pub deadline_misses: u64,
    /// Number of parts of the swarm at the end; `None` unless each part ends its mission by itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<u32>,
    /// Wall time from the start of the first tick to the end of the last tick, s.
    pub wall_s: f64,
    /// Delay of the ticks' starts behind their schedule (wall clock only).
    pub lateness_s: Percentiles,
}

/// An event in a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum EventKind {
    /// A living drone senses an obstacle set for the first time.
    Detected {
        /// Number of the set, from 0, in flight order.
        stage: u32,
        /// The drone that senses it.
        drone: DroneId,
        /// The obstacle of the set that it senses.
        obstacle: ObstacleId,
        /// Distance from the drone to the obstacle, m.
        distance_m: f64,
    },
    /// The last living drone has passed the mean x coordinate of the obstacle centres of a set.
    Passed {
        /// Number of the set, from 0, in flight order.
        stage: u32,
    },
    /// A drone starts to lead a group or stops leading it.
    Leader {
        /// The group.
        group: String,
        /// The term.
        ballot: Ballot,
        /// The drone that starts or stops leading.
        leader: DroneId,
        /// Whether the drone leads from now on.
        leads: bool,
    },
    /// A leader decides on a plan for its group.
    Grouping {
        /// The plan.
        plan: PlanStamp,
        /// The group that the plan splits or keeps.
        group: String,
        /// What the plan tells the group to do.
        phase: Phase,
        /// Number of drones in the plan.
        members: u32,
        /// Number of routes past the set.
        routes: u32,
        /// The obstacles of the set.
        obstacles: Vec<ObstacleId>,
        /// Predicted time from the plan's stamp until the last drone passes the gate, s.
        predicted_s: Option<f64>,
    },
    /// A plan's assignment for one drone is sent for the first time.
    Assigned {
        /// The plan.
        plan: PlanStamp,
        /// The drone.
        drone: DroneId,
        /// The drone's group.
        group: String,
        /// The leader of that group.
        leader: DroneId,
        /// Route past the set, 0 = rightmost; `None` unless the phase is [`Phase::Avoid`].
        route: Option<u16>,
        /// Place in the queue of that route, 0 = first.
        rank: u16,
        /// Slot in the formation, relative to the anchor, m.
        slot_m: [f64; 2],
    },
    /// A fault begins.
    Fault {
        /// The kind of fault.
        kind: FaultKind,
        /// The drone that it affects; [`DroneId::NONE`] for the whole swarm.
        target: DroneId,
        /// Whether the scenario scheduled the fault.
        scheduled: bool,
        /// Details for a human reader, for example the signal or the exit code.
        detail: String,
    },
    /// A scheduled fault is over.
    FaultOver {
        /// The kind of fault.
        kind: FaultKind,
        /// The drone that it affected; [`DroneId::NONE`] for the whole swarm.
        target: DroneId,
        /// Details for a human reader.
        detail: String,
    },
    /// A pilot has failed: it panicked, or commanded or said something that cannot be used. Its drone is killed at the start of
    /// the next tick.
    Failure {
        /// The drone.
        drone: DroneId,
        /// Name of its pilot.
        pilot: String,
        /// Why it failed, for a human reader.
        reason: String,
    },
    /// An invariant is broken. The event is sent once, when the violation begins.
    Violation {
        /// The invariant.
        kind: ViolationKind,
        /// The drones that break it.
        drones: Vec<DroneId>,
        /// The measured distance, m; 0 if the invariant is not about a distance.
        value_m: f64,
    },
    /// The mission is over.
    End {
        /// How the mission ended.
        outcome: Outcome,
        /// Why it ended, for a human reader.
        reason: String,
        /// The drones that cannot reach the goal. Empty unless the outcome is [`Outcome::Stuck`].
        #[serde(default)]
        stuck: Vec<DroneId>,
        /// Drones that kept the mission from its goal when its time was over: the first ones, at most
        /// [`UNFINISHED_MAX`]. Empty unless the time was over.
        #[serde(default)]
        unfinished: Vec<UnfinishedDrone>,
        /// How long no living drone had moved when the time was over, s; `None` if one had moved just before, and unless the
        /// time was over.
        #[serde(default)]
        standstill_s: Option<f64>,
        /// Counters of the whole mission.
        totals: Box<Totals>,
    },
}

/// An event and its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunEvent {
    /// Simulated time of the event, s.
    pub t_s: f64,
    /// The event.
    #[serde(flatten)]
    pub what: EventKind,
}

/// A borrowed view of a record sample; nothing is copied.
#[derive(Clone, Copy, Debug)]
pub struct RecordView<'a> {
    /// The head: tick, time, counts and digest.
    pub head: &'a RecordHeader,
    /// One row per drone, in the order of their ids.
    pub rows: &'a [DroneRow],
    /// Frames sent in this tick.
    pub frames: &'a [AirFrame],
    /// What pilots reported about themselves in this tick, ordered by drone.
    pub telemetry: &'a [TelemetryRow],
    /// Events as JSON lines, one [`RunEvent`] per line. They include the events of lost records since the last sample.
    pub events: &'a [u8],
}

/// The error for a sample that is not a valid record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the record of {bytes} bytes does not hold what its head announces")]
pub struct RecordError {
    /// Size of the sample, bytes.
    pub bytes: usize,
}

impl<'a> RecordView<'a> {
    /// Reads a sample without copying it. `bytes` must be aligned to 8 bytes.
    ///
    /// # Errors
    /// [`RecordError`] if the sample is shorter than its head announces, or not aligned.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, RecordError> {
        let error = RecordError { bytes: bytes.len() };
        let cut = |bytes: &'a [u8], len: usize| bytes.split_at_checked(len).ok_or(error);
        let (head, rest) = cut(bytes, size_of::<RecordHeader>())?;
        let head: &RecordHeader = bytemuck::try_from_bytes(head).map_err(|_| error)?;
        let (rows, rest) = cut(rest, head.rows as usize * size_of::<DroneRow>())?;
        let (frames, rest) = cut(rest, head.frames as usize * size_of::<AirFrame>())?;
        let (telemetry, rest) = cut(rest, head.telemetry as usize * size_of::<TelemetryRow>())?;
        let (events, _) = cut(rest, head.events_len as usize)?;
        Ok(Self {
            head,
            rows: bytemuck::try_cast_slice(rows).map_err(|_| error)?,
            frames: bytemuck::try_cast_slice(frames).map_err(|_| error)?,
            telemetry: bytemuck::try_cast_slice(telemetry).map_err(|_| error)?,
            events,
        })
    }

    /// Size of the sample that [`RecordView::write_to`] writes, bytes.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        size_of::<RecordHeader>()
            + size_of_val(self.rows)
            + size_of_val(self.frames)
            + size_of_val(self.telemetry)
            + self.events.len()
    }

    /// Writes the sample to the start of `out`.
    ///
    /// # Panics
    /// If `out` is shorter than [`RecordView::byte_len`].
    pub fn write_to(&self, out: &mut [u8]) {
        let parts = [
            bytemuck::bytes_of(self.head),
            bytemuck::cast_slice(self.rows),
            bytemuck::cast_slice(self.frames),
            bytemuck::cast_slice(self.telemetry),
            self.events,
        ];
        let mut at = 0;
        for part in parts {
            out[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
    }

    /// The events, each line parsed with `parse`.
    ///
    /// # Errors
    /// The first error that `parse` returns.
    pub fn parse_events<E>(&self, parse: impl Fn(&[u8]) -> Result<RunEvent, E>) -> Result<Vec<RunEvent>, E> {
        self.events.split(|&byte| byte == b'\n').filter(|line| !line.is_empty()).map(parse).collect()
    }
}

/// Why a sink could not keep a record, for a human reader.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct SinkError(String);

impl From<String> for SinkError {
    fn from(reason: String) -> Self {
        Self(reason)
    }
}

/// A consumer that receives each record of a run in order, for example the recorder, a live view or a test.
pub trait RecordSink: Send {
    /// Takes the record of one tick. An error stops the recording but not the mission.
    ///
    /// # Errors
    /// [`SinkError`] if the record could not be kept.
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError>;

    /// Whether the sink can take a record now without waiting for something slow, such as a disk.
    fn ready(&self) -> bool {
        true
    }
}
