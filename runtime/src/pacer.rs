//! Deadlines of ticks on the wall clock.

use crate::tuning::STALL_LIMIT;
use skein_protocol::histogram;
use skein_protocol::record::Percentiles;
use std::time::{Duration, Instant};

/// Bins of [`Lateness`].
const LATENESS_BINS: usize = 20_000;

/// Longest time between two looks for the end of a pause. 50 ms: nobody who interrupts a run notices it.
const LOOK: Duration = Duration::from_millis(50);

/// Opens ticks at a fixed period of wall time, and counts how late they open.
#[derive(Clone, Debug)]
pub(crate) struct Pacer {
    next: Instant,
    period: Duration,
    lateness: Lateness,
}

impl Pacer {
    /// The first tick opens now. A tick lasts `dt_s` simulated seconds, and simulated time runs `speed` times as fast as
    /// wall time.
    pub(crate) fn new(dt_s: f64, speed: f64) -> Self {
        let period = Duration::from_secs_f64(dt_s / speed);
        Self { next: Instant::now(), period, lateness: Lateness::default() }
    }

    /// Opens a tick now; returns its deadline, which is when the next one opens.
    pub(crate) fn open(&mut self) -> Instant {
        let now = Instant::now();
        let late = now.saturating_duration_since(self.next);
        self.lateness.count(late);
        if late > STALL_LIMIT {
            self.next = now;
        }
        self.next += self.period;
        self.next
    }

    /// How late the ticks opened so far, s.
    pub(crate) fn lateness_s(&self) -> Percentiles {
        self.lateness.percentiles_s()
    }

    /// Leaves a span of wall time out: all later ticks open that much later.
    pub(crate) fn stand_still(&mut self, span: Duration) {
        self.next += span;
    }

    /// Sleeps until the next tick opens.
    pub(crate) fn pause(&self) {
        std::thread::sleep(self.next.saturating_duration_since(Instant::now()));
    }

    /// Sleeps until the next tick opens, or until this returns a value, which is looked for often.
    pub(crate) fn pause_unless<T>(&self, mut ended: impl FnMut() -> Option<T>) -> Option<T> {
        loop {
            let left = self.next.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return None;
            }
            std::thread::sleep(left.min(LOOK));
            if let Some(end) = ended() {
                return Some(end);
            }
        }
    }
}

/// How late ticks opened: a histogram with one bin per microsecond.
#[derive(Clone, Debug)]
struct Lateness {
    /// The last bin also counts everything that is longer.
    bins: Vec<u64>,
    max_us: u64,
}

impl Default for Lateness {
    fn default() -> Self {
        Self { bins: vec![0; LATENESS_BINS], max_us: 0 }
    }
}

impl Lateness {
    fn count(&mut self, late: Duration) {
        let late_us = late.as_micros() as u64;
        self.bins[(late_us as usize).min(LATENESS_BINS - 1)] += 1;
        self.max_us = self.max_us.max(late_us);
    }

    fn percentiles_s(&self) -> Percentiles {
        histogram::percentiles(&self.bins, self.max_us, 1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deadlines_keep_their_period_and_start_anew_after_a_stall() {
        let mut pacer = Pacer::new(0.02, 2.0);
        let (first, second) = (pacer.open(), pacer.open());
        assert_eq!(second - first, Duration::from_millis(10));
        pacer.stand_still(Duration::from_millis(40));
        assert_eq!(pacer.open() - second, Duration::from_millis(50));
        pacer.next -= Duration::from_secs(5);
        assert!(pacer.open() > Instant::now());
        let late = pacer.lateness_s();
        assert!(late.max.unwrap() > 4.0 && late.p99 == late.max && late.p50.unwrap() < 1.0, "{late:?}");
    }

    #[test]
    fn a_pause_ends_with_its_tick_or_when_it_is_told_to() {
        let mut slow = Pacer::new(1000.0, 1.0);
        slow.open();
        assert_eq!(slow.pause_unless(|| Some("interrupted")), Some("interrupted"));
        let mut fast = Pacer::new(0.02, 10.0);
        let next = fast.open();
        assert_eq!(fast.pause_unless(|| None::<()>), None);
        assert!(Instant::now() >= next);
    }
}
