//! A quantity over time whose size does not grow with the flight.

use crate::tuning::PLOT_SAMPLES_MAX;

/// Samples in order of time. Of more than [`PLOT_SAMPLES_MAX`], neighbours are merged, so that a plot of a long flight takes
/// no more memory than one of a short flight.
pub(super) struct Series<T> {
    samples: Vec<T>,
    /// Merges a sample into the one before it.
    merge: fn(&mut T, T),
    /// Number of samples that become one.
    stride: usize,
    /// Number of samples in the last one.
    merged: usize,
}

impl<T> Series<T> {
    /// An empty series. `merge` makes one of two samples that follow each other.
    pub(super) fn new(merge: fn(&mut T, T)) -> Self {
        Self { samples: Vec::new(), merge, stride: 1, merged: 0 }
    }

    /// Adds a sample.
    pub(super) fn push(&mut self, sample: T) {
        if let Some(last) = self.samples.last_mut().filter(|_| self.merged < self.stride) {
            (self.merge)(last, sample);
            self.merged += 1;
            return;
        }
        if self.samples.len() == PLOT_SAMPLES_MAX {
            self.halve();
        }
        self.samples.push(sample);
        self.merged = 1;
    }

    /// The samples.
    pub(super) fn samples(&self) -> &[T] {
        &self.samples
    }

    /// The last sample.
    pub(super) fn last_mut(&mut self) -> Option<&mut T> {
        self.samples.last_mut()
    }

    /// Merges each sample of an even place with the next one.
    fn halve(&mut self) {
        let mut halved: Vec<T> = Vec::with_capacity(PLOT_SAMPLES_MAX);
        for (place, sample) in std::mem::take(&mut self.samples).into_iter().enumerate() {
            match halved.last_mut().filter(|_| place % 2 == 1) {
                Some(last) => (self.merge)(last, sample),
                None => halved.push(sample),
            }
        }
        self.samples = halved;
        self.stride *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_series_keeps_its_least_value_and_its_order() {
        let mut series = Series::new(|(_, least): &mut (usize, f64), (_, other)| *least = least.min(other));
        for time in 0..5 * PLOT_SAMPLES_MAX {
            series.push((time, if time == PLOT_SAMPLES_MAX + 17 { -1.0 } else { time as f64 }));
        }
        let samples = series.samples();
        assert!((PLOT_SAMPLES_MAX / 2..=PLOT_SAMPLES_MAX).contains(&samples.len()), "{}", samples.len());
        assert!(samples.windows(2).all(|pair| pair[0].0 + 8 == pair[1].0));
        assert_eq!(samples.iter().filter(|(_, least)| *least < 0.0).count(), 1);
    }
}
