//! What a step took, by the processor's own counter. Asking the system's clock needs pages of libraries and of the kernel's,
//! which a process that was just switched to finds nowhere near: with a thousand drones 7 % of the samples of a profile.
#![allow(unsafe_code)]

use std::time::Instant;

/// Tries to read counter and clock as one moment: whoever is put aside between the two has read two moments.
const TRIES: u32 = 8;

/// The counter and the clock at one moment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mark {
    count: u64,
    clock: Instant,
}

impl Mark {
    /// `None` if there is no counter to go by.
    pub fn now() -> Option<Self> {
        let look = |_| {
            let (count_before, clock) = (count(), Instant::now());
            (count().saturating_sub(count_before), Self { count: count_before, clock })
        };
        let (_, mark) = (0..TRIES).map(look).min_by_key(|(span, _)| *span)?;
        steady().then_some(mark)
    }

    /// Nanoseconds a count, since this mark; 0 if there is no counter to go by.
    pub fn ns_per_count(&self) -> f64 {
        let Some(now) = Self::now().filter(|now| now.count > self.count) else { return 0.0 };
        (now.clock - self.clock).as_nanos() as f64 / (now.count - self.count) as f64
    }
}

/// Measures short spans.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stopwatch {
    /// 0: by the system's clock.
    ns_per_count: f64,
}

/// A span that runs.
#[derive(Clone, Copy, Debug)]
pub enum Lap {
    /// The counter at its start.
    Count(u64),
    /// The clock at its start.
    Clock(Instant),
}

impl Stopwatch {
    pub(crate) fn new(ns_per_count: f64) -> Self {
        Self { ns_per_count }
    }

    /// Begins a span.
    #[must_use]
    pub fn start(&self) -> Lap {
        if self.ns_per_count > 0.0 { Lap::Count(count()) } else { Lap::Clock(Instant::now()) }
    }

    /// Its length so far, ns, at most `u32::MAX`.
    #[must_use]
    pub fn ns(&self, lap: Lap) -> u32 {
        match lap {
            // A cast of a float stays in range.
            Lap::Count(begun) => (count().saturating_sub(begun) as f64 * self.ns_per_count) as u32,
            Lap::Clock(begun) => u32::try_from(begun.elapsed().as_nanos()).unwrap_or(u32::MAX),
        }
    }
}

/// Whether the counter runs at one speed, whatever the processor does.
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
        let by_counter = Stopwatch::new(mark.map_or(0.0, |mark| mark.ns_per_count()));
        let by_clock = Stopwatch::default();
        let (a, b) = (by_counter.start(), by_clock.start());
        std::thread::sleep(Duration::from_millis(20));
        // Read in this order, so that no pause between the two can make the first the longer one.
        let (a, b) = (f64::from(by_counter.ns(a)), f64::from(by_clock.ns(b)));
        assert!(a > 19e6 && a < b * 1.05, "{a} and {b} ns");
    }
}
