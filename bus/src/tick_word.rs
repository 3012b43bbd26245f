//! The words of the barrier: ticks, and what drones have answered.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::segment::Atomics;
use skein_protocol::Tick;
use std::sync::atomic::AtomicU32;

/// In a done word: the drone's process is dead. The other bits keep the last tick it answered.
pub(crate) const DEAD: u32 = 1 << 31;
/// In a tick word: the world has opened no tick yet.
pub(crate) const NOT_BEGUN: u32 = 0;
/// In a tick word: the mission is over.
pub(crate) const STOP: u32 = u32::MAX;

/// A word on cache lines of its own.
#[repr(C, align(128))]
#[derive(Debug)]
pub(crate) struct PaddedWord(AtomicU32);

// SAFETY: an atomic and padding.
unsafe impl Atomics for PaddedWord {}

impl PaddedWord {
    #[inline]
    pub(crate) fn word(&self) -> &AtomicU32 {
        &self.0
    }
}

/// The word that stands for tick `k`: `k` + 1.
///
/// # Errors
/// [`BusError::Control`] for a tick past 2³¹ − 2.
#[inline]
pub(crate) fn word_of(k: Tick) -> Result<u32, BusError> {
    let word = u32::try_from(k + 1).ok().filter(|&word| word < DEAD);
    word.ok_or_else(|| BusError::Control(format!("tick {k} is past the last one, {}", DEAD - 2)))
}
