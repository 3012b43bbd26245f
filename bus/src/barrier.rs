//! The barrier of a tick, world side: the world opens the tick, drones answer, and the world waits for one done word
//! after the other.
//!
//! Only the done word decides: it holds the last answered tick plus 1 and, in its top bit, whether the process is dead.
//! The `waiting` hint only saves wake-ups.
#![allow(unsafe_code)]

use crate::drone_block::{DroneBlocks, DroneWords};
use crate::error::BusError;
use crate::futex;
use crate::segment::SharedArray;
use crate::spec::WaitMode;
use crate::tick_word::{DEAD, NOT_BEGUN, PaddedWord, STOP, word_of};
use skein_protocol::Tick;
use skein_protocol::slot::{LinkStats, Slot};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Yields between two looks at the clock.
const YIELDS: u32 = 256;

/// What became of one drone in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TickOutcome {
    /// Not yet waited for.
    #[default]
    Pending,
    /// It answered: its slot belongs to this tick.
    Done,
    /// Its process is gone, and it did not answer before.
    Dead,
    /// It had not answered at the deadline.
    Late,
    /// It has not answered for so long that it is given up.
    Hung,
    /// Set by the caller for a drone that it knows to be frozen: the world does not wait for it.
    Absent,
}

/// How long the world waits for a drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// Until this instant; a drone that has not answered is [`TickOutcome::Late`]. For the wall clock.
    Until(Instant),
    /// This long from the call on; a drone that has not answered is [`TickOutcome::Hung`]. For lockstep.
    For(Duration),
}

/// The shared words of the barrier and what one process needs to use them.
#[derive(Debug)]
pub(crate) struct Barrier {
    /// One word per core.
    ticks: SharedArray<PaddedWord>,
    /// The drone that the world sleeps on, plus 1; 0 if the world is awake.
    waiting: SharedArray<PaddedWord>,
    blocks: DroneBlocks,
    /// System calls that the world has made for the barrier.
    calls: SharedArray<AtomicU64>,
    wait: WaitMode,
    spin: u32,
}

impl Barrier {
    pub(crate) fn new(
        ticks: SharedArray<PaddedWord>,
        waiting: SharedArray<PaddedWord>,
        blocks: DroneBlocks,
        calls: SharedArray<AtomicU64>,
        (wait, spin): (WaitMode, u32),
    ) -> Self {
        Self { ticks, waiting, blocks, calls, wait, spin }
    }

    /// See [`crate::Control::open_tick`].
    pub(crate) fn open_tick(&self, k: Tick) -> Result<(), BusError> {
        self.publish(word_of(k)?);
        Ok(())
    }

    /// See [`crate::Control::close`].
    pub(crate) fn close(&self) {
        self.publish(STOP);
    }

    fn publish(&self, value: u32) {
        // First all words, so that a drone that is awake need not be woken. Then the wake-ups: the other cores first, so
        // that they work while this core is still in its system calls; core 0, the world's own, last.
        let cores = self.ticks.count();
        let mut sleeps = self.wait == WaitMode::Block;
        for core in 0..cores {
            sleeps |= self.tick_word(core).swap(value, Ordering::SeqCst) == NOT_BEGUN;
        }
        if sleeps {
            for core in (0..cores).rev() {
                futex::wake_all(self.tick_word(core));
            }
            self.calls.get(0).fetch_add(cores as u64, Ordering::Relaxed);
        }
    }

    /// See [`crate::Control::wait_done`].
    pub(crate) fn wait_done(&self, k: Tick, patience: Patience, answers: &mut [TickOutcome]) -> Result<(), BusError> {
        let target = word_of(k)?;
        let drones = self.blocks.count();
        if answers.len() != drones {
            return Err(BusError::Control(format!("expected {drones} answers, not {}", answers.len())));
        }
        let (end, overdue) = match patience {
            Patience::Until(end) => (end, TickOutcome::Late),
            Patience::For(span) => (Instant::now() + span, TickOutcome::Hung),
        };
        for (drone, answer) in answers.iter_mut().enumerate() {
            if *answer != TickOutcome::Absent {
                *answer = self.wait_for(drone, target, end).unwrap_or(overdue);
            }
        }
        Ok(())
    }

    fn wait_for(&self, drone: usize, target: u32, end: Instant) -> Option<TickOutcome> {
        let word = self.words(drone).done();
        for _ in 0..self.spin {
            if let Some(answer) = outcome(word.load(Ordering::Acquire), target) {
                return Some(answer);
            }
            std::hint::spin_loop();
        }
        loop {
            if let Some(answer) = outcome(word.load(Ordering::Acquire), target) {
                return Some(answer);
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            match self.wait {
                WaitMode::Block => self.sleep_on(drone, target, left),
                WaitMode::Yield => self.yield_on(drone, target),
            }
        }
    }

    /// Sets the hint, looks again, then sleeps. A drone sets its done word, then looks at the hint. Both sides use
    /// sequentially consistent operations, so that at least one of them sees the other's store: no wake-up is lost. If the
    /// word changes after the second look, the futex does not sleep.
    fn sleep_on(&self, drone: usize, target: u32, limit: Duration) {
        let word = self.words(drone).done();
        self.waiting().store(drone as u32 + 1, Ordering::SeqCst);
        let seen = word.load(Ordering::SeqCst);
        if outcome(seen, target).is_none() {
            self.calls.get(0).fetch_add(1, Ordering::Relaxed);
            futex::wait(word, seen, limit);
        }
        self.waiting().store(0, Ordering::Relaxed);
    }

    fn yield_on(&self, drone: usize, target: u32) {
        let word = self.words(drone).done();
        for _ in 0..YIELDS {
            if outcome(word.load(Ordering::Acquire), target).is_some() {
                return;
            }
            self.calls.get(0).fetch_add(1, Ordering::Relaxed);
            rustix::thread::sched_yield();
        }
    }

    /// See [`crate::Control::calls`].
    pub(crate) fn calls(&self) -> [u64; 2] {
        let of_drone = |drone| self.words(drone).calls().load(Ordering::Relaxed);
        [self.calls.get(0).load(Ordering::Relaxed), (0..self.blocks.count()).map(of_drone).sum()]
    }

    /// See [`crate::Control::slot`].
    pub(crate) fn slot(&self, drone: usize) -> Slot {
        // SAFETY: the pointer is aligned and into the mapping, which `self` keeps; a slot is valid for all bit patterns. The
        // copy is volatile because another process writes the slot; the done word orders the two, see `Control::slot`.
        unsafe { self.blocks.slot(drone).read_volatile() }
    }

    /// See [`crate::Control::stats`].
    pub(crate) fn stats(&self, drone: usize) -> LinkStats {
        // SAFETY: as in `slot`.
        unsafe { self.blocks.stats(drone).read_volatile() }
    }

    /// Where a drone writes its slot.
    #[inline]
    pub(crate) fn slot_pointer(&self, drone: usize) -> NonNull<Slot> {
        self.blocks.slot(drone)
    }

    /// Where a drone writes its statistics.
    #[inline]
    pub(crate) fn stats_pointer(&self, drone: usize) -> NonNull<LinkStats> {
        self.blocks.stats(drone)
    }

    #[inline]
    pub(crate) fn words(&self, drone: usize) -> &DroneWords {
        self.blocks.words(drone)
    }

    #[inline]
    pub(crate) fn tick_word(&self, core: usize) -> &AtomicU32 {
        self.ticks.get(core).word()
    }

    /// The drone that the world sleeps on, plus 1; 0 if the world is awake.
    #[inline]
    pub(crate) fn waiting(&self) -> &AtomicU32 {
        self.waiting.get(0).word()
    }

    /// Looks at a word before sleeping.
    pub(crate) fn spin(&self) -> u32 {
        self.spin
    }
}

/// What a done word says about the tick that stands in `target`. A drone that answered and then died has answered.
fn outcome(done: u32, target: u32) -> Option<TickOutcome> {
    if done & !DEAD == target {
        Some(TickOutcome::Done)
    } else if done & DEAD != 0 {
        Some(TickOutcome::Dead)
    } else {
        None
    }
}
