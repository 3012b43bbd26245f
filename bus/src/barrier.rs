//! The barrier of a tick: the world opens it, drones answer, the world waits for their done words in turn.
//!
//! The done word alone is the truth: it holds the last answered tick plus 1 and, in its top bit, whether the process is
//! dead. The `waiting` hint only saves wake-ups.
#![allow(unsafe_code)]

use crate::control::{Control, DEAD, DroneWords, SLICE, STOP, WaitMode};
use crate::error::BusError;
use crate::futex;
use crate::stopwatch::Stopwatch;
use skein_protocol::Tick;
use skein_protocol::slot::{LinkStats, Slot};
use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Yields between two looks at the clock, and at whether the world still lives.
const YIELDS: u32 = 256;

/// What became of one drone in a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TickOutcome {
    /// Not yet waited for.
    #[default]
    Pending,
    /// It answered: its slot is this tick's.
    Done,
    /// Its process is gone, and it did not answer before.
    Dead,
    /// It had not answered at the deadline.
    Late,
    /// It has not answered for so long that it never will.
    Hung,
    /// Set by the caller, for a drone it knows to be frozen: not waited for.
    Absent,
}

/// How long the world waits for a drone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Patience {
    /// Until then; who has not answered is [`TickOutcome::Late`]. For the wall clock.
    Until(Instant),
    /// That long from the call; who has not answered is [`TickOutcome::Hung`]. For lockstep.
    For(Duration),
}

/// What a drone waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickSignal {
    /// This tick is open: the newest one.
    Tick(Tick),
    /// The mission is over.
    Stop,
    /// The caller's check said that nobody will open a tick any more.
    Orphaned,
}

impl Control {
    /// Opens tick `k` for all drones: the world's part, running on core 0. The downlink must have been sent before.
    ///
    /// # Errors
    /// [`BusError::Control`] for a tick past 2³¹ − 2.
    pub fn open_tick(&self, k: Tick) -> Result<(), BusError> {
        self.publish(word_of(k)?);
        Ok(())
    }

    /// Ends the mission for all drones: the world's part, or the launcher's after the world's death.
    pub fn close(&self) {
        self.publish(STOP);
    }

    fn publish(&self, value: u32) {
        // All words first, so that an awake drone need not be woken; then the other cores, so that they work while this
        // one is still in its own system call; core 0, the world's own, last.
        let cores = self.spec().cores;
        (0..cores).for_each(|core| self.tick_word(core).store(value, Ordering::SeqCst));
        if self.spec().wait == WaitMode::Block {
            (0..cores).rev().for_each(|core| futex::wake_all(self.tick_word(core)));
            self.shared().calls.fetch_add(cores as u64, Ordering::Relaxed);
        }
    }

    /// Waits until every drone has answered tick `k`, is dead, or has used up the patience, and writes what became of
    /// each to `answers` (one a drone; those that are [`TickOutcome::Absent`] are left alone). Allocates nothing.
    ///
    /// # Errors
    /// [`BusError::Control`] for a tick past 2³¹ − 2, or a slice of another length than the number of drones.
    pub fn wait_done(&self, k: Tick, patience: Patience, answers: &mut [TickOutcome]) -> Result<(), BusError> {
        let target = word_of(k)?;
        let drones = self.spec().drones;
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
        let word = &self.drone(drone).done;
        for _ in 0..self.spin() {
            if let Some(answer) = judge(word.load(Ordering::Acquire), target) {
                return Some(answer);
            }
            std::hint::spin_loop();
        }
        loop {
            if let Some(answer) = judge(word.load(Ordering::Acquire), target) {
                return Some(answer);
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            match self.spec().wait {
                WaitMode::Block => self.sleep_on(drone, target, left),
                WaitMode::Yield => self.yield_on(drone, target),
            }
        }
    }

    /// The hint, then another look, then sleep; a drone sets its word, then looks at the hint. Both sequentially
    /// consistent: at least one sees the other's store, so no wake-up is lost. And a word that changes after our look
    /// keeps the futex from sleeping.
    fn sleep_on(&self, drone: usize, target: u32, limit: Duration) {
        let word = &self.drone(drone).done;
        self.waiting().store(drone as u32 + 1, Ordering::SeqCst);
        let seen = word.load(Ordering::SeqCst);
        if judge(seen, target).is_none() {
            self.shared().calls.fetch_add(1, Ordering::Relaxed);
            futex::wait(word, seen, limit);
        }
        self.waiting().store(0, Ordering::Relaxed);
    }

    fn yield_on(&self, drone: usize, target: u32) {
        let word = &self.drone(drone).done;
        for _ in 0..YIELDS {
            if judge(word.load(Ordering::Acquire), target).is_some() {
                return;
            }
            self.shared().calls.fetch_add(1, Ordering::Relaxed);
            rustix::thread::sched_yield();
        }
    }
}

/// A drone that answered and then died has answered.
fn judge(done: u32, target: u32) -> Option<TickOutcome> {
    if done & !DEAD == target {
        Some(TickOutcome::Done)
    } else if done & DEAD != 0 {
        Some(TickOutcome::Dead)
    } else {
        None
    }
}

fn word_of(k: Tick) -> Result<u32, BusError> {
    let word = u32::try_from(k + 1).ok().filter(|&word| word < DEAD);
    word.ok_or_else(|| BusError::Control(format!("tick {k} is past the last one, {}", DEAD - 2)))
}

/// A drone's end of the barrier. What it needs in every tick it holds itself: on waking, everything else is far away.
#[derive(Debug)]
pub struct DroneEndpoint {
    /// Of its core, in the segment.
    tick_word: NonNull<AtomicU32>,
    /// Its own, in the segment.
    words: NonNull<DroneWords>,
    wait: WaitMode,
    spin: u32,
    drone: usize,
    last: u32,
    bound: bool,
    stopwatch: Stopwatch,
    control: Arc<Control>,
}

// SAFETY: the pointers are into the mapping that `control` keeps, which any thread may touch.
unsafe impl Send for DroneEndpoint {}

impl DroneEndpoint {
    /// The end of this drone; there must be no other one for it.
    ///
    /// # Errors
    /// [`BusError::Control`] if the segment has no such drone.
    pub fn new(control: Arc<Control>, drone: usize) -> Result<Self, BusError> {
        let drones = control.spec().drones;
        if drone >= drones {
            return Err(BusError::Control(format!("drone {drone} is not below {drones}")));
        }
        let (tick_word, words) = (control.tick_word(control.core_of(drone)).into(), control.drone(drone).into());
        let (wait, spin) = (control.spec().wait, control.spin());
        Ok(Self {
            tick_word,
            words,
            wait,
            spin,
            drone,
            last: 0,
            bound: false,
            stopwatch: Stopwatch::default(),
            control,
        })
    }

    /// This process dies with its launcher, which closes the barrier should the world die: it need not look whether they
    /// live, and sleeps without a limit.
    #[must_use]
    pub fn bound(self) -> Self {
        Self { bound: true, ..self }
    }

    /// Tells that this process, of an incarnation from 1, has its ports open and will answer ticks.
    pub fn announce(&self, incarnation: u32) {
        self.words().ready.store(incarnation, Ordering::Release);
    }

    /// Waits for a tick that this drone has not seen yet, and gives the newest. `alive` is asked every 100 ms or so
    /// whether the world is still there, unless the process is [`DroneEndpoint::bound`].
    pub fn wait_tick(&mut self, mut alive: impl FnMut() -> bool) -> TickSignal {
        let mut spins = self.spin;
        loop {
            let seen = self.tick_word().load(Ordering::Acquire);
            if seen == STOP {
                return TickSignal::Stop;
            }
            if seen > self.last && self.may_answer(seen) {
                self.take_up(seen);
                return TickSignal::Tick(Tick::from(seen - 1));
            }
            if spins > 0 {
                spins -= 1;
                std::hint::spin_loop();
            } else if !self.pause(seen) && !alive() {
                return TickSignal::Orphaned;
            }
        }
    }

    /// Takes up the tick that another drone of the same process was given: they wait as one. False if this drone may not
    /// answer it.
    pub fn join_tick(&mut self, tick: Tick) -> bool {
        let joined = word_of(tick).ok().filter(|&seen| seen > self.last && self.may_answer(seen));
        joined.into_iter().for_each(|seen| self.take_up(seen));
        joined.is_some()
    }

    fn take_up(&mut self, seen: u32) {
        if self.last == 0 {
            self.stopwatch = self.control.stopwatch();
        }
        self.last = seen;
    }

    /// What spans of a tick are measured by; by the system's clock before the first tick.
    #[must_use]
    pub fn stopwatch(&self) -> Stopwatch {
        self.stopwatch
    }

    /// Waits for another value than `seen`; false if there was none for a while.
    #[inline]
    fn pause(&self, seen: u32) -> bool {
        let (word, calls) = (self.tick_word(), &self.words().calls);
        match self.wait {
            WaitMode::Block => {
                calls.fetch_add(1, Ordering::Relaxed);
                if self.bound { futex::wait_on(word, seen) } else { futex::wait(word, seen, SLICE) }
            }
            WaitMode::Yield => {
                let mut looks = 0..YIELDS * 16;
                while word.load(Ordering::Acquire) == seen && looks.next().is_some() {
                    calls.fetch_add(1, Ordering::Relaxed);
                    rustix::thread::sched_yield();
                }
            }
        }
        word.load(Ordering::Acquire) != seen
    }

    /// Answers tick `k`: writes the slot, then the done word, and wakes the world if it sleeps on this drone. False,
    /// and nothing written, for a tick before the one that this drone, once frozen, may answer.
    pub fn finish(&mut self, k: Tick, slot: &Slot) -> bool {
        let done = self.last;
        if Tick::from(done) != k + 1 || !self.may_answer(done) {
            return false;
        }
        let parts: &[u64; size_of::<Slot>() / 8] = bytemuck::cast_ref(slot);
        let place = self.control.slot_at(self.drone).cast::<u64>();
        // Word by word: as a whole it would be copied by a library, whose page is not at hand.
        for (i, &word) in parts.iter().enumerate() {
            // SAFETY: within the slot, which is this drone's alone; the world copies it only between our store of the done
            // word and its opening of the next tick.
            unsafe { place.add(i).write_volatile(word) };
        }
        let words = self.words();
        // See `sleep_on` for why both are sequentially consistent.
        words.done.store(done, Ordering::SeqCst);
        if self.control.waiting().load(Ordering::SeqCst) == self.drone as u32 + 1 {
            words.calls.fetch_add(1, Ordering::Relaxed);
            futex::wake_all(&words.done);
        }
        true
    }

    /// What this drone's radio counts. To be left alone between [`DroneEndpoint::finish`] and the next tick.
    pub fn stats_mut(&mut self) -> &mut LinkStats {
        // SAFETY: in the mapping, aligned, any bits are valid; only this end, borrowed mutably, writes it, and others
        // copy it while this drone waits or is dead.
        unsafe { self.control.stats_at(self.drone).as_mut() }
    }

    /// The first tick that this drone may read and answer.
    #[must_use]
    pub fn resume_from(&self) -> Tick {
        Tick::from(self.words().resume_from.load(Ordering::SeqCst))
    }

    fn tick_word(&self) -> &AtomicU32 {
        // SAFETY: in the mapping, which `control` keeps, aligned, and only touched atomically.
        unsafe { self.tick_word.as_ref() }
    }

    fn words(&self) -> &DroneWords {
        // SAFETY: as in `tick_word`.
        unsafe { self.words.as_ref() }
    }

    fn may_answer(&self, seen: u32) -> bool {
        Tick::from(seen) > self.resume_from()
    }
}
