//! How long a host took to answer.

use std::time::Duration;

/// Collects the times of all ticks. A flight of an hour at 50 ticks/s has 180 000 of them.
#[derive(Debug, Default)]
pub(crate) struct Lateness(Vec<u32>);

impl Lateness {
    /// Notes the time of a tick. More than an hour counts as an hour.
    pub(crate) fn note(&mut self, time: Duration) {
        self.0.push(u32::try_from(time.as_micros()).unwrap_or(u32::MAX));
    }

    /// Number of ticks.
    pub(crate) fn ticks(&self) -> u64 {
        self.0.len() as u64
    }

    /// Median, 99th percentile and maximum, µs.
    pub(crate) fn percentiles_us(mut self) -> Option<[f64; 3]> {
        self.0.sort_unstable();
        let last = self.0.len().checked_sub(1)?;
        Some([0.5, 0.99, 1.0].map(|share| f64::from(self.0[(last as f64 * share).round() as usize])))
    }
}
