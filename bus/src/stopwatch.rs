//! Measures the duration of a step by the processor's own counter. The system's clock needs memory pages of libraries and
//! of the kernel, which are cold in a process that has just been switched to: with a thousand drones, 7 % of the samples
//! of a profile.
#![allow(unsafe_code)]

use crate::segment::SharedArray;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Number of attempts to read counter and clock at one moment. A process that is suspended between the two reads them at
/// two moments; the attempt with the shortest span counts.
const TRIES: u32 = 8;

/// The counter and the clock at one moment.
#[derive(Clone, Copy, Debug)]
struct Mark {
    count: u64,
    clock: Instant,
}

impl Mark {
    /// `None` if there is no usable counter.
    fn now() -> Option<Self> {
        let look = |_| {
            let (count_before, clock) = (count(), Instant::now());
            (count().saturating_sub(count_before), Self { count: count_before, clock })
        };
        let (_, mark) = (0..TRIES).map(look).min_by_key(|(span, _)| *span)?;
        steady().then_some(mark)
    }

    /// Nanoseconds per count since this mark; 0 if there is no usable counter.
    fn ns_per_count(&self) -> f64 {
        let Some(now) = Self::now().filter(|now| now.count > self.count) else { return 0.0 };
        (now.clock - self.clock).as_nanos() as f64 / (now.count - self.count) as f64
    }
}

/// How fast the processor's counter runs: measured by the launcher, read by every process.
#[derive(Debug)]
pub(crate) struct CounterSpeed {
    /// Nanoseconds per count: the bits of an `f64`; 0 if the system's clock is to be used.
    ns_per_count: SharedArray<AtomicU64>,
    /// When the launcher started, in the launcher.
    start: Option<Mark>,
}

impl CounterSpeed {
    pub(crate) fn new(ns_per_count: SharedArray<AtomicU64>) -> Self {
        Self { ns_per_count, start: None }
    }

    /// Notes the launcher's start.
    pub(crate) fn started(self) -> Self {
        Self { start: Mark::now(), ..self }
    }

    /// Measures the speed over the time since the launcher's start.
    pub(crate) fn measure(&self) {
        let speed = self.start.map_or(0.0, |mark| mark.ns_per_count());
        self.ns_per_count.get(0).store(speed.to_bits(), Ordering::Relaxed);
    }

    pub(crate) fn stopwatch(&self) -> Stopwatch {
        Stopwatch { ns_per_count: f64::from_bits(self.ns_per_count.get(0).load(Ordering::Relaxed)) }
    }
}

/// Measures short spans.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stopwatch {
    /// 0 if the system's clock is to be used.
    ns_per_count: f64,
}

/// A running span.
#[derive(Clone, Copy, Debug)]
pub enum Lap {
    /// The counter at its start.
    Count(u64),
    /// The clock at its start.
    Clock(Instant),
}

impl Stopwatch {
    /// Starts a span.
    #[must_use]
    pub fn start(&self) -> Lap {
        if self.ns_per_count > 0.0 { Lap::Count(count()) } else { Lap::Clock(Instant::now()) }
    }

    /// Length of a span so far, ns, at most `u32::MAX`.
    #[must_use]
    pub fn ns(&self, lap: Lap) -> u32 {
        match lap {
            // The cast saturates.
            Lap::Count(begun) => (count().saturating_sub(begun) as f64 * self.ns_per_count) as u32,
            Lap::Clock(begun) => u32::try_from(begun.elapsed().as_nanos()).unwrap_or(u32::MAX),
        }
    }
}

/// Whether the counter runs at a constant speed in all power states of the processor.
#[cfg(target_arch = "x86_64")]
fn steady() -> bool {
    use std::arch::x86_64::__cpuid;
    const POWER: u32 = 0x8000_0007;
    const INVARIANT: u32 = 1 << 8;
    __cpuid(0x8000_0000).eax >= POWER && __cpuid(POWER).edx & INVARIANT != 0
}

#[cfg(target_arch = "x86_64")]
fn count() -> u64 {
    // SAFETY: every x86-64 processor has this instruction.
    unsafe { std::arch::x86_64::_rdtsc() }
}

#[cfg(not(target_arch = "x86_64"))]
fn steady() -> bool {
    false
}

#[cfg(not(target_arch = "x86_64"))]
fn count() -> u64 {
    0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_counter_and_the_clock_agree() {
        let mark = Mark::now();
        std::thread::sleep(Duration::from_millis(20));
        let by_counter = Stopwatch { ns_per_count: mark.map_or(0.0, |mark| mark.ns_per_count()) };
        let by_clock = Stopwatch::default();
        let (a, b) = (by_counter.start(), by_clock.start());
        std::thread::sleep(Duration::from_millis(20));
        // Read in this order, so that a pause between the two cannot make the first one the longer.
        let (a, b) = (f64::from(by_counter.ns(a)), f64::from(by_clock.ns(b)));
        assert!(a > 19e6 && a < b * 1.05, "{a} and {b} ns");
    }
}
