//! What a drone returns to the world in each tick: its actuator command, the plan it obeys, and its counters. Slots are not
//! a message path: no other drone reads them.

use crate::drop_reason::DROP_REASONS;
use crate::ids::{Ballot, GroupId, PlanStamp};
use crate::wire::Phase;
use bytemuck::{Pod, Zeroable};

/// [`Slot::flags`]: the drone leads a group.
pub const SLOT_LEADS: u32 = 1;
/// [`Slot::flags`]: the drone flies a route past an obstacle set.
pub const SLOT_QUEUED: u32 = 2;
/// [`Slot::flags`]: the pilot says that its mission is done. It may take that back in a later tick.
pub const SLOT_DONE: u32 = 4;
/// [`Slot::flags`]: the pilot has failed in this tick. The slot's acceleration does not count.
pub const SLOT_FAILED: u32 = 8;

/// One drone's answer to one tick.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Slot {
    /// Commanded acceleration, world frame, m/s².
    pub acceleration_mps2: [f64; 3],
    /// Number of frames that the drone has sent since its process started. All of them are in its uplink once its done
    /// word is set.
    pub frames_total: u64,
    /// Hash of the frames that the drone heard in this tick, in the order in which it heard them; 0 if it heard none.
    pub heard_hash: u64,
    /// Hash of the drone's route, rank, slot and phase under `obeyed`; 0 before its first assignment. A different assignment
    /// for the same drone under the same plan has a different hash.
    pub part_hash: u64,
    /// The plan that the drone obeys.
    pub obeyed: PlanStamp,
    /// The drone's group.
    pub group: GroupId,
    /// The group that the drone leads; meaningful only with [`SLOT_LEADS`].
    pub led: GroupId,
    /// Number of messages heard in this tick, each counted once.
    pub heard: u32,
    /// Number of messages heard in this tick for the second time.
    pub duplicates: u32,
    /// Number of frames that its radio dropped in this tick, indexed by [`crate::radio::DropReason`].
    pub dropped: [u32; DROP_REASONS],
    /// Combination of [`SLOT_LEADS`], [`SLOT_QUEUED`], [`SLOT_DONE`] and [`SLOT_FAILED`].
    pub flags: u32,
    /// A [`Phase`], see [`Slot::phase`].
    pub phase: u32,
    /// Route past the obstacle set, 0 = rightmost; [`crate::payload::NO_ROUTE`] if the drone has none.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
    /// Wall time that the drone's step took, ns; not part of the digest. 0 in the inline runtime.
    pub step_ns: u32,
    /// The term that the drone obeys, or in which it leads.
    pub term: Ballot,
    /// Always 0.
    pub reserved: [u32; 12],
}

impl Slot {
    /// Phase of the plan that the drone obeys. An unknown number counts as [`Phase::Cruise`].
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

    /// Whether the pilot says that its mission is done.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.flags & SLOT_DONE != 0
    }

    /// Whether the pilot has failed in this tick.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.flags & SLOT_FAILED != 0
    }
}

/// Number of bins in the histograms of [`LinkStats`]. A bin is one tick wide; the last bin also counts all greater values.
pub const STAT_BINS: usize = 256;

/// Counters of one drone's radio since the start of the mission. Delays and ages are in ticks.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LinkStats {
    /// Messages heard, each counted once.
    pub heard: u64,
    /// Messages heard for the second time.
    pub duplicates: u64,
    /// Frames that could not be decoded.
    pub malformed: u64,
    /// Frames dropped, indexed by [`crate::radio::DropReason`].
    pub dropped: [u64; DROP_REASONS],
    /// Longest delay from sending to hearing, ticks.
    pub delay_max: u64,
    /// Greatest age of a peer's last known pose, ticks.
    pub age_max: u64,
    /// Histogram of the delay of heard messages, one bin per tick.
    pub delay_bins: [u64; STAT_BINS],
    /// Histogram of the age of each known peer's last pose, one bin per tick. It is sampled each time this drone sends its
    /// own beacon.
    pub age_bins: [u64; STAT_BINS],
    /// Always 0.
    pub reserved: [u64; 4],
}

impl Default for LinkStats {
    fn default() -> Self {
        Self::zeroed()
    }
}

impl LinkStats {
    /// Counts a message that was heard `ticks` after it was sent.
    pub fn delay(&mut self, ticks: u64) {
        self.heard += 1;
        self.delay_max = self.delay_max.max(ticks);
        self.delay_bins[(ticks as usize).min(STAT_BINS - 1)] += 1;
    }

    /// Counts the age of a peer's last known pose, in ticks.
    pub fn age(&mut self, ticks: u64) {
        self.age_max = self.age_max.max(ticks);
        self.age_bins[(ticks as usize).min(STAT_BINS - 1)] += 1;
    }

    /// Adds another drone's counters; takes the larger of each pair of maxima.
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
