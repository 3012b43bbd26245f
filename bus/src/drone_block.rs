//! One drone's part of the control segment: its words, its actuator slot and its radio's statistics.
#![allow(unsafe_code)]

use crate::futex;
use crate::segment::{Atomics, SharedArray};
use crate::tick_word::DEAD;
use skein_protocol::Tick;
use skein_protocol::slot::{LinkStats, Slot};
use std::mem::offset_of;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// `resume_from` of a drone that may answer no tick at all.
const FROZEN: u32 = u32::MAX;

/// One drone's words.
#[repr(C, align(128))]
#[derive(Debug)]
pub(crate) struct DroneWords {
    /// Last answered tick plus 1, and [`DEAD`].
    done: AtomicU32,
    /// First tick that the drone may answer.
    resume_from: AtomicU32,
    /// Incarnation of the process that is ready; 0 if none is.
    ready: AtomicU32,
    /// How the last process ended: the system's wait status plus 1; 0 if the supervisor has ended it, or it runs.
    end: AtomicU32,
    /// System calls that the drone has made for the barrier.
    calls: AtomicU64,
}

// SAFETY: atomics and padding.
unsafe impl Atomics for DroneWords {}

impl DroneWords {
    /// The done word, to load and to sleep on.
    #[inline]
    pub(crate) fn done(&self) -> &AtomicU32 {
        &self.done
    }

    /// System calls that the drone has made for the barrier.
    #[inline]
    pub(crate) fn calls(&self) -> &AtomicU64 {
        &self.calls
    }

    pub(crate) fn set_ready(&self, incarnation: u32) {
        self.ready.store(incarnation, Ordering::Release);
    }

    pub(crate) fn ready(&self) -> Option<u32> {
        Some(self.ready.load(Ordering::Acquire)).filter(|&incarnation| incarnation != 0)
    }

    /// The wait status of the last process, if it ended by itself.
    pub(crate) fn end(&self) -> Option<i32> {
        self.end.load(Ordering::Acquire).checked_sub(1).map(|status| status as i32)
    }

    pub(crate) fn set_end(&self, wait_status: i32) {
        self.end.store((wait_status as u32).wrapping_add(1), Ordering::Release);
    }

    pub(crate) fn mark_dead(&self) {
        self.ready.store(0, Ordering::Release);
        // The word changes before the wake-up: a world that is about to sleep on the old value does not fall asleep.
        self.done.fetch_or(DEAD, Ordering::SeqCst);
        futex::wake_all(&self.done);
    }

    pub(crate) fn is_dead(&self) -> bool {
        self.done.load(Ordering::SeqCst) & DEAD != 0
    }

    pub(crate) fn revive(&self, from: Tick) {
        self.set_resume_from(from);
        self.end.store(0, Ordering::Release);
        self.done.store(0, Ordering::SeqCst);
    }

    pub(crate) fn freeze(&self) {
        self.resume_from.store(FROZEN, Ordering::SeqCst);
    }

    pub(crate) fn set_resume_from(&self, from: Tick) {
        let from = u32::try_from(from).unwrap_or(FROZEN);
        self.resume_from.store(from, Ordering::SeqCst);
    }

    #[inline]
    pub(crate) fn resume_from(&self) -> Tick {
        Tick::from(self.resume_from.load(Ordering::SeqCst))
    }
}

/// Layout of a drone's part. What one process uses in a tick lies together: after a switch of processes, every page of
/// it costs a walk through cold page tables.
#[repr(C, align(128))]
#[derive(Debug)]
pub(crate) struct DroneBlock {
    words: DroneWords,
    slot: Slot,
    stats: LinkStats,
}

/// The parts of all drones.
#[derive(Debug)]
pub(crate) struct DroneBlocks(SharedArray<DroneBlock>);

impl DroneBlocks {
    pub(crate) fn new(blocks: SharedArray<DroneBlock>) -> Self {
        Self(blocks)
    }

    pub(crate) fn count(&self) -> usize {
        self.0.count()
    }

    #[inline]
    pub(crate) fn words(&self, drone: usize) -> &DroneWords {
        // SAFETY: the words are the first part of the block, which is in the mapping that `self` keeps; they are `Atomics`.
        // The reference covers nothing but them.
        unsafe { self.0.pointer(drone).cast::<DroneWords>().as_ref() }
    }

    /// A drone's slot. Only the drone writes it, between the opening of a tick and its answer.
    #[inline]
    pub(crate) fn slot(&self, drone: usize) -> NonNull<Slot> {
        // SAFETY: within the block, which is in the mapping.
        unsafe { self.0.pointer(drone).byte_add(offset_of!(DroneBlock, slot)).cast() }
    }

    /// A drone's statistics. Only the drone writes them, between the opening of a tick and its answer.
    #[inline]
    pub(crate) fn stats(&self, drone: usize) -> NonNull<LinkStats> {
        // SAFETY: within the block, which is in the mapping.
        unsafe { self.0.pointer(drone).byte_add(offset_of!(DroneBlock, stats)).cast() }
    }
}
