//! Begin and end of a mission, as words of the control segment.
#![allow(unsafe_code)]

use crate::futex::{self, SLICE};
use crate::segment::{Atomics, SharedArray};
use std::sync::atomic::{AtomicU32, Ordering};

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

/// The shared words.
#[repr(C)]
#[derive(Debug)]
pub(crate) struct MissionWords {
    go: AtomicU32,
    stop: AtomicU32,
    world_state: AtomicU32,
}

// SAFETY: atomics.
unsafe impl Atomics for MissionWords {}

/// Begin and end of the mission.
#[derive(Debug)]
pub(crate) struct MissionState(SharedArray<MissionWords>);

impl MissionState {
    pub(crate) fn new(words: SharedArray<MissionWords>) -> Self {
        Self(words)
    }

    /// See [`crate::Control::give_go`].
    pub(crate) fn give_go(&self) {
        let word = &self.0.get(0).go;
        word.store(1, Ordering::Release);
        futex::wake_all(word);
    }

    /// See [`crate::Control::wait_go`].
    pub(crate) fn wait_go(&self, mut alive: impl FnMut() -> bool) -> bool {
        let word = &self.0.get(0).go;
        while word.load(Ordering::Acquire) == 0 {
            futex::wait(word, 0, SLICE);
            if self.stop_requested().is_some() || !alive() {
                return false;
            }
        }
        true
    }

    /// See [`crate::Control::request_stop`].
    pub(crate) fn request_stop(&self, reason: u32) {
        self.0.get(0).stop.store(reason, Ordering::Release);
    }

    /// See [`crate::Control::stop_requested`].
    pub(crate) fn stop_requested(&self) -> Option<u32> {
        Some(self.0.get(0).stop.load(Ordering::Acquire)).filter(|&reason| reason != 0)
    }

    /// See [`crate::Control::set_world_state`].
    pub(crate) fn set_world_state(&self, state: WorldState) {
        self.0.get(0).world_state.store(state as u32, Ordering::Release);
    }

    /// See [`crate::Control::world_state`].
    pub(crate) fn world_state(&self) -> WorldState {
        match self.0.get(0).world_state.load(Ordering::Acquire) {
            0 => WorldState::Starting,
            1 => WorldState::Ready,
            2 => WorldState::Flying,
            _ => WorldState::Finished,
        }
    }
}
