//! The figures that pilots report, over the mission.

use crate::summary::OwnMetric;
use skein_protocol::MetricName;
use skein_protocol::telemetry::TelemetryRow;
use std::collections::BTreeMap;

/// Sums of one figure.
#[derive(Clone, Copy, Debug)]
struct Sums {
    count: u64,
    sum: f64,
    min: f64,
    max: f64,
    /// Number and sum of its values in the last tick that had one.
    last: (u64, u32, f64),
}

/// The sums of all figures so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct OwnMetrics(BTreeMap<MetricName, Sums>);

impl OwnMetrics {
    /// Takes what pilots reported in a tick.
    pub(crate) fn take(&mut self, tick: u64, telemetry: &[TelemetryRow]) {
        for (name, value) in telemetry.iter().filter_map(TelemetryRow::metric) {
            let new = Sums { count: 0, sum: 0.0, min: value, max: value, last: (tick, 0, 0.0) };
            let sums = self.0.entry(name).or_insert(new);
            (sums.count, sums.sum) = (sums.count + 1, sums.sum + value);
            (sums.min, sums.max) = (sums.min.min(value), sums.max.max(value));
            let (count, sum) = if sums.last.0 == tick { (sums.last.1, sums.last.2) } else { (0, 0.0) };
            sums.last = (tick, count + 1, sum + value);
        }
    }

    /// The figures by name.
    pub(crate) fn finish(&self) -> BTreeMap<String, OwnMetric> {
        let of = |sums: &Sums| OwnMetric {
            mean: sums.sum / sums.count as f64,
            last: sums.last.2 / f64::from(sums.last.1),
            min: sums.min,
            max: sums.max,
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
}
