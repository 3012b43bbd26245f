//! The barrier of a tick, drone side.
#![allow(unsafe_code)]

use crate::control::Control;
use crate::drone_block::DroneWords;
use crate::error::BusError;
use crate::futex::{self, SLICE};
use crate::spec::WaitMode;
use crate::stopwatch::Stopwatch;
use crate::tick_word::{NOT_BEGUN, STOP, word_of};
use skein_protocol::Tick;
use skein_protocol::slot::{LinkStats, Slot};
use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// Yields between two questions whether the world is alive.
const YIELDS: u32 = 4096;

/// What a drone waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickSignal {
    /// This tick is open; it is the newest one.
    Tick(Tick),
    /// The mission is over.
    Stop,
    /// The caller's check said that no process is left to open a tick.
    Orphaned,
}

/// One drone's end of the barrier. It holds copies of everything it needs in each tick, because after a wake-up all other
/// memory is cold.
#[derive(Debug)]
pub struct DroneEndpoint {
    /// Tick word of the drone's core, in the segment.
    tick_word: NonNull<AtomicU32>,
    /// The drone's own words, in the segment.
    words: NonNull<DroneWords>,
    wait: WaitMode,
    spin: u32,
    drone: usize,
    last: u32,
    bound: bool,
    stopwatch: Stopwatch,
    control: Arc<Control>,
}

// SAFETY: the pointers are into the mapping that `control` keeps, which any thread may use.
unsafe impl Send for DroneEndpoint {}

impl DroneEndpoint {
    /// The endpoint of this drone. There must be only one per drone.
    ///
    /// # Errors
    /// [`BusError::Control`] if the segment has no such drone.
    pub fn new(control: Arc<Control>, drone: usize) -> Result<Self, BusError> {
        let drones = control.spec().drones;
        if drone >= drones {
            return Err(BusError::Control(format!("drone {drone} is not below {drones}")));
        }
        let barrier = control.barrier();
        let (tick_word, words) = (barrier.tick_word(control.core_of(drone)).into(), barrier.words(drone).into());
        let (wait, spin) = (control.spec().wait, barrier.spin());
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

    /// For a process that dies with its launcher, which closes the barrier if the world dies: it need not ask whether they
    /// are alive, and sleeps without a limit.
    #[must_use]
    pub fn bound(self) -> Self {
        Self { bound: true, ..self }
    }

    /// Reports that this process, of an incarnation from 1, has opened its ports and will answer ticks.
    pub fn announce(&self, incarnation: u32) {
        self.words().set_ready(incarnation);
    }

    /// Waits for a tick that this drone has not seen yet, and returns the newest one. About every 100 ms, `alive` is asked
    /// whether the world is still there, unless the process is [`DroneEndpoint::bound`].
    pub fn wait_tick(&mut self, mut alive: impl FnMut() -> bool) -> TickSignal {
        let mut spins = self.spin;
        loop {
            let seen = self.tick_word().load(Ordering::Acquire);
            if seen == STOP {
                return TickSignal::Stop;
            }
            if seen > self.last && self.may_answer(seen) {
                self.begin(seen);
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

    /// Begins the tick that another drone of the same process was given: the drones of a process wait as one. False if
    /// this drone may not answer the tick.
    pub fn join_tick(&mut self, tick: Tick) -> bool {
        let joined = word_of(tick).ok().filter(|&seen| seen > self.last && self.may_answer(seen));
        if let Some(seen) = joined {
            self.begin(seen);
        }
        joined.is_some()
    }

    fn begin(&mut self, seen: u32) {
        if self.last == 0 {
            self.stopwatch = self.control.stopwatch();
        }
        self.last = seen;
    }

    /// The stopwatch for spans within a tick. Before the first tick it uses the system's clock.
    #[must_use]
    pub fn stopwatch(&self) -> Stopwatch {
        self.stopwatch
    }

    /// Waits for another value than `seen`; false if there was none for a while. Before the first tick a drone always sleeps: drones that
    /// yield would take the cores from those that are still starting.
    #[inline]
    fn pause(&self, seen: u32) -> bool {
        let (word, calls) = (self.tick_word(), self.words().calls());
        let wait = if seen == NOT_BEGUN { WaitMode::Block } else { self.wait };
        match wait {
            WaitMode::Block => {
                calls.fetch_add(1, Ordering::Relaxed);
                if self.bound { futex::wait_on(word, seen) } else { futex::wait(word, seen, SLICE) }
            }
            WaitMode::Yield => {
                let mut looks = 0..YIELDS;
                while word.load(Ordering::Acquire) == seen && looks.next().is_some() {
                    calls.fetch_add(1, Ordering::Relaxed);
                    rustix::thread::sched_yield();
                }
            }
        }
        word.load(Ordering::Acquire) != seen
    }

    /// Answers tick `k`: writes the slot, then the done word, and wakes the world if it sleeps on this drone. Returns false
    /// and writes nothing for a tick that this drone may not answer because it was frozen.
    pub fn finish(&mut self, k: Tick, slot: &Slot) -> bool {
        let done = self.last;
        if Tick::from(done) != k + 1 || !self.may_answer(done) {
            return false;
        }
        let parts: &[u64; size_of::<Slot>() / 8] = bytemuck::cast_ref(slot);
        let place = self.control.barrier().slot_pointer(self.drone).cast::<u64>();
        // Word by word: as a whole it would be copied by a library function, whose memory page is cold.
        for (i, &word) in parts.iter().enumerate() {
            // SAFETY: `i` is within the slot, which only this drone writes; the world copies it only between this drone's store
            // to the done word and the opening of the next tick.
            unsafe { place.add(i).write_volatile(word) };
        }
        let words = self.words();
        // `Barrier::sleep_on` explains why both are sequentially consistent.
        words.done().store(done, Ordering::SeqCst);
        if self.control.barrier().waiting().load(Ordering::SeqCst) == self.drone as u32 + 1 {
            words.calls().fetch_add(1, Ordering::Relaxed);
            futex::wake_all(words.done());
        }
        true
    }

    /// The counts of this drone's radio. Not to be changed between [`DroneEndpoint::finish`] and the next tick.
    pub fn stats_mut(&mut self) -> &mut LinkStats {
        // SAFETY: the pointer is aligned and into the mapping, which `control` keeps; all bit patterns are valid. Only this
        // endpoint, borrowed mutably, writes the statistics; others copy them while this drone waits or is dead.
        unsafe { self.control.barrier().stats_pointer(self.drone).as_mut() }
    }

    /// The newest tick that the world has opened.
    #[must_use]
    pub fn newest_tick(&self) -> Tick {
        Tick::from(self.tick_word().load(Ordering::Acquire)).saturating_sub(1)
    }

    /// The first tick that this drone may read and answer.
    #[must_use]
    pub fn resume_from(&self) -> Tick {
        self.words().resume_from()
    }

    fn tick_word(&self) -> &AtomicU32 {
        // SAFETY: the pointer came from a reference into the mapping, which `control` keeps.
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
