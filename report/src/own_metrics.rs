//! The figures that pilots report, over the mission.

use crate::number_text::tidy;
use crate::summary::OwnMetric;
use skein_protocol::MetricName;
use skein_protocol::telemetry::TelemetryRow;
use std::collections::BTreeMap;

/// Sums of one figure.
#[derive(Clone, Copy, Debug)]
struct Sums {
    count: u64,
    sum: ExactSum,
    min: f64,
    max: f64,
    /// The last tick that had a value, and the number and the sum of its values.
    last: (u64, u32, ExactSum),
}

/// A sum that does not lose what is small beside it (Neumaier 1974): the mean of equal numbers is the number.
#[derive(Clone, Copy, Debug, Default)]
struct ExactSum {
    sum: f64,
    lost: f64,
}

impl ExactSum {
    fn add(&mut self, value: f64) {
        let sum = self.sum + value;
        let (large, small) = if self.sum.abs() >= value.abs() { (self.sum, value) } else { (value, self.sum) };
        self.lost += (large - sum) + small;
        self.sum = sum;
    }

    /// The sum divided by the number of its values.
    fn mean(self, count: f64) -> f64 {
        let sum = self.sum + self.lost;
        // The sum of huge numbers is infinite, and what it lost is then no number.
        let sum = if sum.is_nan() { self.sum } else { sum };
        tidy((sum / count).clamp(f64::MIN, f64::MAX))
    }
}

/// The sums of all figures so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct OwnMetrics(BTreeMap<MetricName, Sums>);

impl OwnMetrics {
    /// Takes what pilots reported in a tick.
    pub(crate) fn take(&mut self, tick: u64, telemetry: &[TelemetryRow]) {
        for (name, value) in telemetry.iter().filter_map(TelemetryRow::metric) {
            let none = ExactSum::default();
            let new = Sums { count: 0, sum: none, min: value, max: value, last: (tick, 0, none) };
            let sums = self.0.entry(name).or_insert(new);
            sums.count += 1;
            sums.sum.add(value);
            (sums.min, sums.max) = (sums.min.min(value), sums.max.max(value));
            if sums.last.0 != tick {
                sums.last = (tick, 0, none);
            }
            sums.last.1 += 1;
            sums.last.2.add(value);
        }
    }

    /// The figures by name.
    pub(crate) fn finish(&self) -> BTreeMap<String, OwnMetric> {
        let of = |sums: &Sums| OwnMetric {
            mean: sums.sum.mean(sums.count as f64),
            last: sums.last.2.mean(f64::from(sums.last.1)),
            min: tidy(sums.min),
            max: tidy(sums.max),
        };
        self.0.iter().map(|(name, sums)| (name.as_str().to_owned(), of(sums))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::DroneId;
    use skein_protocol::telemetry::Telemetry;

    #[test]
    fn a_figure_has_its_mean_last_least_and_greatest_value() {
        let row = |drone, value| {
            let name = MetricName::new("order").unwrap();
            TelemetryRow::new(DroneId(drone), &Telemetry::Metric { name, value }).unwrap()
        };
        let mut metrics = OwnMetrics::default();
        metrics.take(0, &[row(0, 1.0), row(1, 5.0)]);
        metrics.take(1, &[]);
        metrics.take(2, &[row(0, 2.0), row(1, 4.0)]);
        metrics.take(3, &[]);
        let wanted = OwnMetric { mean: 3.0, last: 3.0, min: 1.0, max: 5.0 };
        assert_eq!(metrics.finish(), [("order".to_owned(), wanted)].into());
    }

    #[test]
    fn arithmetic_leaves_nothing_in_a_figure() {
        let name = MetricName::new("gain").unwrap();
        let row = |value| TelemetryRow::new(DroneId(0), &Telemetry::Metric { name, value }).unwrap();
        let of = |values: &[f64]| {
            let mut metrics = OwnMetrics::default();
            values.iter().zip(0..).for_each(|(&value, tick)| metrics.take(tick, &[row(value)]));
            metrics.finish()["gain"]
        };
        let all = |value| OwnMetric { mean: value, last: value, min: value, max: value };
        assert_eq!(of(&[0.1; 900]), all(0.1));
        assert_eq!(of(&[0.1 + 0.2]), all(0.3));
        let zero = of(&[-0.0]);
        assert!([zero.mean, zero.last, zero.min, zero.max].iter().all(|value| value.to_bits() == 0), "{zero:?}");
        assert_eq!(of(&[1e16, 1.0, -1e16]).mean, 0.333_333_333_333_333);
        assert_eq!(of(&[f64::MAX, f64::MAX]), all(f64::MAX), "JSON knows no infinity");
    }
}
