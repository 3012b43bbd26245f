//! Begin and end of a mission, and the states of its processes, as words of the control segment.

use crate::control::{Control, DEAD, SLICE};
use crate::futex;
use skein_protocol::Tick;
use std::sync::atomic::Ordering;

/// `resume_from` of a drone that answers no tick at all.
const FROZEN: u32 = u32::MAX;

/// What the world is doing, for the launcher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum WorldState {
    /// Not yet ready.
    Starting = 0,
    /// Its ports are open; it waits for the launcher's go.
    Ready = 1,
    /// Ticks are running.
    Flying = 2,
    /// The mission is over and its record is complete.
    Finished = 3,
}

impl Control {
    /// Lets the world begin.
    pub fn give_go(&self) {
        self.gauge_counter();
        let word = &self.shared().go;
        word.store(1, Ordering::Release);
        futex::wake_all(word);
    }

    /// Waits for the launcher's go. False if `alive` (asked every 100 ms) said no, or a stop was requested.
    pub fn wait_go(&self, mut alive: impl FnMut() -> bool) -> bool {
        let word = &self.shared().go;
        while word.load(Ordering::Acquire) == 0 {
            futex::wait(word, 0, SLICE);
            if self.stop_requested().is_some() || !alive() {
                return false;
            }
        }
        true
    }

    /// Asks the world to end the mission after the tick it is in. `reason` is the launcher's, not 0 (say, a signal).
    pub fn request_stop(&self, reason: u32) {
        self.shared().stop.store(reason, Ordering::Release);
    }

    /// The reason, if a stop was requested.
    #[must_use]
    pub fn stop_requested(&self) -> Option<u32> {
        Some(self.shared().stop.load(Ordering::Acquire)).filter(|&reason| reason != 0)
    }

    /// The world's part: tells the launcher what it is doing.
    pub fn set_world_state(&self, state: WorldState) {
        self.shared().world_state.store(state as u32, Ordering::Release);
    }

    /// What the world is doing.
    #[must_use]
    pub fn world_state(&self) -> WorldState {
        match self.shared().world_state.load(Ordering::Acquire) {
            0 => WorldState::Starting,
            1 => WorldState::Ready,
            2 => WorldState::Flying,
            _ => WorldState::Finished,
        }
    }

    /// Incarnation of the drone's process that is ready to fly; `None` while there is none.
    #[must_use]
    pub fn ready(&self, drone: usize) -> Option<u32> {
        Some(self.drone(drone).ready.load(Ordering::Acquire)).filter(|&incarnation| incarnation != 0)
    }

    /// Marks a drone whose process is gone (reaped) as dead, and wakes the world if it waits for it.
    pub fn mark_dead(&self, drone: usize) {
        let words = self.drone(drone);
        words.ready.store(0, Ordering::Release);
        // The word changes before the wake-up: a world that is about to sleep on the old value will not fall asleep.
        words.done.fetch_or(DEAD, Ordering::SeqCst);
        futex::wake_all(&words.done);
    }

    /// Whether a drone's process is marked as dead.
    #[must_use]
    pub fn is_dead(&self, drone: usize) -> bool {
        self.drone(drone).done.load(Ordering::SeqCst) & DEAD != 0
    }

    /// Takes the mark back before a new process is started, which answers from tick `from` on; until then the world
    /// counts the drone as [`TickOutcome::Absent`](crate::Answer::Absent).
    pub fn revive(&self, drone: usize, from: Tick) {
        self.set_resume_from(drone, from);
        self.drone(drone).done.store(0, Ordering::SeqCst);
    }

    /// Keeps a drone from reading or answering any tick: to be called before SIGSTOP. The world counts it as
    /// [`TickOutcome::Absent`](crate::Answer::Absent) from then on.
    pub fn freeze(&self, drone: usize) {
        self.drone(drone).resume_from.store(FROZEN, Ordering::SeqCst);
    }

    /// First tick that a drone may read and answer: to be called before SIGCONT.
    pub fn set_resume_from(&self, drone: usize, from: Tick) {
        let from = u32::try_from(from).unwrap_or(FROZEN);
        self.drone(drone).resume_from.store(from, Ordering::SeqCst);
    }
}
