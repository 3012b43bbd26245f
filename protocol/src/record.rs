//! What the world tells the recorder: a row a drone and tick, every frame, and events.

use crate::drop_reason::DROP_REASONS;
use crate::frame::AirFrame;
use crate::ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
use crate::link_faults::LinkFaults;
use crate::time::{SimTime, Tick};
use crate::wire::Phase;
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A record sample's head; then come [`DroneRow`]s, [`AirFrame`]s, and `events_len` bytes of JSON lines, one
/// [`RunEvent`] each.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RecordHeader {
    /// The tick that just ended.
    pub tick: Tick,
    /// Time at its end: the rows' time.
    pub now: SimTime,
    /// Number of rows, one per drone.
    pub rows: u32,
    /// Number of frames sent in this tick.
    pub frames: u32,
    /// Bytes of JSON lines.
    pub events_len: u32,
    /// Ticks whose rows were dropped since the last sample because the recorder was full (wall clock only).
    pub lost: u32,
    /// Running digest of the mission so far.
    pub digest: u64,
}

/// [`DroneRow::flags`]: its process lives.
pub const ROW_ALIVE: u32 = 1;
/// [`DroneRow::flags`]: it leads a group.
pub const ROW_LEADS: u32 = 2;
/// [`DroneRow::flags`]: it flies a route past an obstacle set.
pub const ROW_QUEUED: u32 = 4;
/// [`DroneRow::flags`]: it missed this tick's deadline, its last command was held (wall clock only).
pub const ROW_LATE: u32 = 8;
/// [`DroneRow::flags`]: its process is frozen.
pub const ROW_FROZEN: u32 = 16;

/// A drone at the end of a tick: the world's truth, and what the drone says it obeys.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct DroneRow {
    /// World frame, m.
    pub position_m: [f64; 2],
    /// m/s.
    pub velocity_mps: [f64; 2],
    /// Energy used since the start, J.
    pub energy_j: f64,
    /// The plan it obeys.
    pub obeyed: PlanStamp,
    /// The term it obeys, or leads in.
    pub term: Ballot,
    /// Its group.
    pub group: GroupId,
    /// The group it leads, with [`ROW_LEADS`].
    pub led: GroupId,
    /// [`ROW_ALIVE`], [`ROW_LEADS`], [`ROW_QUEUED`], [`ROW_LATE`], [`ROW_FROZEN`].
    pub flags: u32,
    /// A [`Phase`], see [`DroneRow::phase`].
    pub phase: u32,
    /// Messages heard in this tick.
    pub heard: u32,
    /// Frames that its radio refused in this tick, by [`crate::radio::DropReason`].
    pub dropped: [u32; DROP_REASONS],
    /// What faults do to its radio.
    pub link_faults: LinkFaults,
    /// How long its step took, ns of wall time.
    pub step_ns: u32,
    /// Route, [`crate::payload::NO_ROUTE`] if none.
    pub route: u16,
    /// Place in the queue.
    pub rank: u16,
    /// Always 0; keeps the row a multiple of eight bytes.
    pub reserved: [u32; DROP_REASONS % 2],
}

impl DroneRow {
    /// Who leads it: the claimant of the ballot it obeys, if it obeys one.
    #[must_use]
    pub fn leader(&self) -> Option<DroneId> {
        self.obeyed.ballot.is_some().then_some(self.obeyed.ballot.claimant)
    }

    /// Phase of the plan it obeys; an unknown number counts as [`Phase::Cruise`].
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::from_wire(self.phase).unwrap_or_default()
    }

    /// Whether its process is alive.
    #[must_use]
    pub fn alive(&self) -> bool {
        self.flags & ROW_ALIVE != 0
    }

    /// Whether it leads a group.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.flags & ROW_LEADS != 0
    }

    /// Whether it flies a route past an obstacle set.
    #[must_use]
    pub fn is_queued(&self) -> bool {
        self.flags & ROW_QUEUED != 0
    }

    /// Whether it missed this tick's deadline (wall clock only).
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.flags & ROW_LATE != 0
    }

    /// Whether its process is frozen.
    #[must_use]
    pub fn is_frozen(&self) -> bool {
        self.flags & ROW_FROZEN != 0
    }
}

/// How a mission ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The end condition is met, the formation closed.
    Reached,
    /// The mission's time ran out.
    Timeout,
    /// An invariant was broken.
    Unsafe,
    /// It was interrupted, or its world died.
    Aborted,
}

/// What a broken invariant is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViolationKind {
    /// Two drones closer than the safe distance; value: their distance, m.
    Separation,
    /// A drone nearer to an obstacle than the obstacle clearance; value: the distance, m.
    Clearance,
    /// Two different parts obeyed under one plan.
    ConflictingAssignment,
    /// The plan a drone obeys went back within an incarnation.
    BallotWentBack,
}

/// What happens to a drone or a link on purpose, or to a process unasked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// The process ended: by a signal, an exit or a crash.
    Kill,
    /// It did not answer for five seconds of wall time in lockstep, and was killed.
    Hung,
    /// The process was stopped, to be continued.
    Freeze,
    /// The process was killed, to be replaced by a new one.
    Restart,
    /// The drone reacts later.
    Slow,
    /// It hears nobody.
    Deaf,
    /// Nobody hears it.
    Mute,
    /// The air is cut between sets of drones.
    Partition,
    /// It senses no obstacles, no neighbours, or neither.
    Blind,
    /// Its own position or velocity is told wrong.
    Noise,
    /// It is blown about.
    Wind,
}

impl FaultKind {
    /// Whether it ends or stops the drone's process.
    #[must_use]
    pub fn stops_process(self) -> bool {
        matches!(self, Self::Kill | Self::Hung | Self::Freeze | Self::Restart)
    }
}

/// A range of counted delays or ages, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Percentiles {
    /// Mean, s; `None` if nothing was counted.
    pub mean: Option<f64>,
    /// Median, s.
    pub p50: Option<f64>,
    /// 99th percentile, s.
    pub p99: Option<f64>,
    /// Maximum, s.
    pub max: Option<f64>,
}

/// Counters of a whole mission, told at its end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Totals {
    /// Frames sent.
    pub sent: u64,
    /// Messages heard, over all receivers, each counted once.
    pub delivered: u64,
    /// Messages heard for the second time, over all receivers.
    pub duplicates: u64,
    /// Not heard, by [`crate::radio::DropReason`] in its order.
    pub dropped: [u64; DROP_REASONS],
    /// From sending to hearing.
    pub delay_s: Percentiles,
    /// Age of a peer's last known pose.
    pub age_s: Percentiles,
    /// Commands that were not finite and were not carried out.
    pub rejected_commands: u64,
    /// Ticks a drone did not answer in time (wall clock only).
    pub deadline_misses: u64,
    /// Wall time from the first tick opened to the last tick done, s.
    pub wall_s: f64,
    /// How late ticks opened (wall clock only).
    pub lateness_s: Percentiles,
}

/// Something that happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum EventKind {
    /// A living drone senses an obstacle set for the first time.
    Detected {
        /// Number of the set, from 0, in flight order.
        stage: u32,
        /// Who.
        drone: DroneId,
        /// Which obstacle of the set.
        obstacle: ObstacleId,
        /// Distance to it, m.
        distance_m: f64,
    },
    /// The last living drone is past the mean centre abscissa of a set.
    Passed {
        /// Number of the set.
        stage: u32,
    },
    /// A drone takes up leading, or lays it down.
    Leader {
        /// The group it leads.
        group: String,
        /// The term.
        ballot: Ballot,
        /// Who.
        leader: DroneId,
        /// Whether it leads from now on.
        leads: bool,
    },
    /// A leader's decision for its group.
    Grouping {
        /// The plan.
        plan: PlanStamp,
        /// The group it splits or keeps.
        group: String,
        /// What the group is told to do.
        phase: Phase,
        /// Number of drones planned for.
        members: u32,
        /// Routes past the set.
        routes: u32,
        /// The obstacle set.
        obstacles: Vec<ObstacleId>,
        /// Forecast of the pass time, s.
        predicted_s: Option<f64>,
    },
    /// One drone's part in a plan, when it is first said.
    Assigned {
        /// The plan.
        plan: PlanStamp,
        /// Who.
        drone: DroneId,
        /// Its group.
        group: String,
        /// Its group's leader.
        leader: DroneId,
        /// Route, 0 = rightmost; none unless avoiding.
        route: Option<u16>,
        /// Place in the queue.
        rank: u16,
        /// Slot relative to the anchor, m.
        slot_m: [f64; 2],
    },
    /// A fault.
    Fault {
        /// What.
        kind: FaultKind,
        /// Whom; [`DroneId::NONE`]: the whole swarm.
        target: DroneId,
        /// Whether the scenario asked for it.
        scheduled: bool,
        /// What is known of it, for people: the signal, the exit code.
        detail: String,
    },
    /// A scheduled fault is over.
    FaultOver {
        /// What.
        kind: FaultKind,
        /// Whom; [`DroneId::NONE`]: the whole swarm.
        target: DroneId,
        /// What goes on, for people.
        detail: String,
    },
    /// An invariant is broken; said once when it begins.
    Violation {
        /// Which.
        kind: ViolationKind,
        /// Who.
        drones: Vec<DroneId>,
        /// How far.
        value_m: f64,
    },
    /// The mission is over.
    End {
        /// How.
        outcome: Outcome,
        /// In words.
        reason: String,
        /// Counters.
        totals: Box<Totals>,
    },
}

/// An event and its time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunEvent {
    /// When, s of simulated time.
    pub t_s: f64,
    /// What.
    #[serde(flatten)]
    pub what: EventKind,
}

/// A record sample as its reader sees it, in place.
#[derive(Clone, Copy, Debug)]
pub struct RecordView<'a> {
    /// Tick, time, counts, digest.
    pub head: &'a RecordHeader,
    /// One for each drone.
    pub rows: &'a [DroneRow],
    /// Frames sent in this tick.
    pub frames: &'a [AirFrame],
    /// JSON lines.
    pub events: &'a [u8],
}

/// Why a sample is not a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the record of {bytes} bytes does not hold what its head announces")]
pub struct RecordError {
    /// Size of the sample.
    pub bytes: usize,
}

impl<'a> RecordView<'a> {
    /// Reads a sample in place. `bytes` must be 8-aligned.
    ///
    /// # Errors
    /// [`RecordError`] if the sample is too short for its head, or not aligned.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, RecordError> {
        let error = RecordError { bytes: bytes.len() };
        let cut = |bytes: &'a [u8], len: usize| bytes.split_at_checked(len).ok_or(error);
        let (head, rest) = cut(bytes, size_of::<RecordHeader>())?;
        let head: &RecordHeader = bytemuck::try_from_bytes(head).map_err(|_| error)?;
        let (rows, rest) = cut(rest, head.rows as usize * size_of::<DroneRow>())?;
        let (frames, rest) = cut(rest, head.frames as usize * size_of::<AirFrame>())?;
        let (events, _) = cut(rest, head.events_len as usize)?;
        Ok(Self {
            head,
            rows: bytemuck::try_cast_slice(rows).map_err(|_| error)?,
            frames: bytemuck::try_cast_slice(frames).map_err(|_| error)?,
            events,
        })
    }

    /// Bytes that [`RecordView::write_to`] needs.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        size_of::<RecordHeader>() + size_of_val(self.rows) + size_of_val(self.frames) + self.events.len()
    }

    /// Writes the sample; `out` must be at least [`RecordView::byte_len`] long.
    pub fn write_to(&self, out: &mut [u8]) {
        let parts = [
            bytemuck::bytes_of(self.head),
            bytemuck::cast_slice(self.rows),
            bytemuck::cast_slice(self.frames),
            self.events,
        ];
        let mut at = 0;
        for part in parts {
            out[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
    }

    /// The events.
    ///
    /// # Errors
    /// A line that is not an event.
    pub fn parse_events<E>(&self, parse: impl Fn(&[u8]) -> Result<RunEvent, E>) -> Result<Vec<RunEvent>, E> {
        self.events.split(|&byte| byte == b'\n').filter(|line| !line.is_empty()).map(parse).collect()
    }
}

/// Why a sink could not keep a record, for people.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct SinkError(String);

impl From<String> for SinkError {
    fn from(reason: String) -> Self {
        Self(reason)
    }
}

/// Whoever wants to see each record of a run, in order: the recorder, a live view, a test.
pub trait RecordSink: Send {
    /// Takes the record of one tick. An error stops the recording, never the mission.
    ///
    /// # Errors
    /// [`SinkError`] if the record could not be kept.
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError>;

    /// Whether it would take a record now, without waiting for something slow: a disk.
    fn ready(&self) -> bool {
        true
    }
}
