//! A histogram of the wall times of drones' steps, with bins of logarithmic width.

use crate::summary::StepTimes;

/// Bins per octave. The width of a bin is at most 1/32 of its values.
const BINS: u32 = 32;

/// A histogram of nanoseconds.
pub(crate) struct StepTimer {
    bins: Vec<u64>,
    count: u64,
    max_ns: u32,
}

impl StepTimer {
    /// An empty histogram.
    pub(crate) fn new() -> Self {
        Self { bins: vec![0; (bin(u32::MAX) + 1) as usize], count: 0, max_ns: 0 }
    }

    /// Counts one step; 0 means that it was not timed.
    pub(crate) fn take(&mut self, step_ns: u32) {
        if step_ns > 0 {
            self.bins[bin(step_ns) as usize] += 1;
            self.count += 1;
            self.max_ns = self.max_ns.max(step_ns);
        }
    }

    /// The percentiles, µs; `None` if no step was timed.
    pub(crate) fn times(&self) -> Option<StepTimes> {
        let max = f64::from(self.max_ns) / 1e3;
        let at = |share: f64| (self.quantile_ns(share) / 1e3).min(max);
        (self.count > 0).then(|| StepTimes { p50: at(0.5), p99: at(0.99), max })
    }

    /// Middle of the bin in which this share of all steps is reached, ns.
    fn quantile_ns(&self, share: f64) -> f64 {
        let wanted = (share * self.count as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        let reached = self.bins.iter().position(|&steps| {
            seen += steps;
            seen >= wanted
        });
        let bin = reached.unwrap_or(0) as u32;
        (lower_ns(bin) + lower_ns(bin + 1)) / 2.0
    }
}

/// The bin of a value. Each value below 2·BINS has its own bin; above, each octave has BINS bins.
fn bin(ns: u32) -> u32 {
    let shift = (ns / BINS).checked_ilog2().unwrap_or(0);
    shift * BINS + (ns >> shift)
}

/// The least value in a bin, ns.
fn lower_ns(bin: u32) -> f64 {
    let shift = (bin / BINS).saturating_sub(1);
    f64::from(bin - shift * BINS) * 2f64.powi(shift as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_value_lies_in_its_bin() {
        for ns in (0..200).chain([1_000, 65_535, 65_536, 1_234_567, u32::MAX]) {
            let (low, high) = (lower_ns(bin(ns)), lower_ns(bin(ns) + 1));
            assert!(low <= f64::from(ns) && f64::from(ns) < high, "{ns} is not in [{low}, {high})");
            assert!(high - low <= (low / f64::from(BINS)).max(1.0), "{ns}: [{low}, {high})");
        }
    }

    #[test]
    fn percentiles_are_exact_to_a_bin() {
        let mut timer = StepTimer::new();
        assert_eq!(timer.times(), None);
        timer.take(0);
        assert_eq!(timer.times(), None);
        for us in 1..=1000 {
            timer.take(us * 1000);
        }
        let times = timer.times().unwrap();
        assert!((times.p50 - 500.0).abs() < 16.0 && (times.p99 - 990.0).abs() < 31.0, "{times:?}");
        assert_eq!(times.max, 1000.0);
    }
}
