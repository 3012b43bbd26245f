//! What a drone hands back in a tick: its actuators' command, what it obeys, and the tick's tally. Wire and clock, not
//! a message path: no other drone reads it.

use crate::drop_reason::DROP_REASONS;
use crate::ids::{Ballot, GroupId, PlanStamp};
use crate::wire::Phase;
use bytemuck::{Pod, Zeroable};

/// [`Slot::flags`]: the drone leads a group.
pub const SLOT_LEADS: u32 = 1;
/// [`Slot::flags`]: the drone flies a route past an obstacle set.
pub const SLOT_QUEUED: u32 = 2;

/// One drone's answer to one tick.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Slot {
    /// Commanded acceleration, world frame, m/s².
    pub acceleration_mps2: [f64; 2],
    /// Frames it has sent since its process started: all of them are in its uplink once its done word is set.
    pub frames_total: u64,
    /// Hash of which frames it heard in this tick, in which order; 0 if none.
    pub heard_hash: u64,
    /// Hash of its route, rank, slot and phase under `obeyed`; 0 before the first. The same plan with another part for
    /// the same drone shows as another hash.
    pub part_hash: u64,
    /// The plan it obeys.
    pub obeyed: PlanStamp,
    /// Its group.
    pub group: GroupId,
    /// The group it leads, with [`SLOT_LEADS`].
    pub led: GroupId,
    /// Number of messages heard in this tick, each counted once.
    pub heard: u32,
    /// Number of messages heard in this tick for the second time.
    pub duplicates: u32,
    /// Frames that its radio refused in this tick, by [`crate::radio::DropReason`].
    pub dropped: [u32; DROP_REASONS],
    /// [`SLOT_LEADS`], [`SLOT_QUEUED`].
    pub flags: u32,
    /// A [`Phase`], see [`Slot::phase`].
    pub phase: u32,
    /// Route, [`crate::payload::NO_ROUTE`] if none.
    pub route: u16,
    /// Place in the queue.
    pub rank: u16,
    /// How long the step took, ns of wall time; no part of the digest. 0 in the inline runtime.
    pub step_ns: u32,
    /// The term it obeys, or leads in.
    pub term: Ballot,
    /// Always 0.
    pub reserved: [u32; 14],
}

impl Slot {
    /// Phase of the plan it obeys; an unknown number counts as [`Phase::Cruise`].
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::from_wire(self.phase).unwrap_or_default()
    }

    /// Whether the drone leads a group.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.flags & SLOT_LEADS != 0
    }

    /// Whether the drone flies a route past an obstacle set.
    #[must_use]
    pub fn is_queued(&self) -> bool {
        self.flags & SLOT_QUEUED != 0
    }
}

/// Bins of [`LinkStats`]' histograms, one tick wide; the last also holds all that is longer.
pub const STAT_BINS: usize = 256;

/// What one drone's radio has counted since the mission began. Delays and ages in ticks.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LinkStats {
    /// Messages heard, each counted once.
    pub heard: u64,
    /// Messages heard for the second time.
    pub duplicates: u64,
    /// Frames that could not be decoded.
    pub malformed: u64,
    /// Frames refused, by [`crate::radio::DropReason`].
    pub dropped: [u64; DROP_REASONS],
    /// Longest delay from sending to hearing, ticks.
    pub delay_max: u64,
    /// Greatest age of a peer's last known pose, ticks.
    pub age_max: u64,
    /// Heard messages by delay.
    pub delay_bins: [u32; STAT_BINS],
    /// Age of each known peer's pose, sampled at every beacon of one's own.
    pub age_bins: [u32; STAT_BINS],
    /// Always 0.
    pub reserved: [u64; 4],
}

impl Default for LinkStats {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl LinkStats {
    /// Counts a message heard `ticks` after it was sent.
    pub fn delay(&mut self, ticks: u64) {
        self.heard += 1;
        self.delay_max = self.delay_max.max(ticks);
        self.delay_bins[(ticks as usize).min(STAT_BINS - 1)] += 1;
    }

    /// Counts the age of a peer's last known pose.
    pub fn age(&mut self, ticks: u64) {
        self.age_max = self.age_max.max(ticks);
        self.age_bins[(ticks as usize).min(STAT_BINS - 1)] += 1;
    }

    /// Adds another drone's counts.
    pub fn merge(&mut self, other: &Self) {
        self.heard += other.heard;
        self.duplicates += other.duplicates;
        self.malformed += other.malformed;
        self.delay_max = self.delay_max.max(other.delay_max);
        self.age_max = self.age_max.max(other.age_max);
        self.dropped.iter_mut().zip(other.dropped).for_each(|(a, b)| *a += b);
        self.delay_bins.iter_mut().zip(other.delay_bins).for_each(|(a, b)| *a += b);
        self.age_bins.iter_mut().zip(other.age_bins).for_each(|(a, b)| *a += b);
    }
}
