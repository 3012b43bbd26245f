//! What pilots report about themselves, taken out of their frames.

use skein_protocol::DroneId;
use skein_protocol::frame::Frame;
use skein_protocol::telemetry::{MAX_MARKS, MAX_METRICS, Telemetry, TelemetryRow};

/// What one drone reports in the current tick.
#[derive(Clone, Debug, Default)]
struct Report {
    metrics: Vec<TelemetryRow>,
    marks: Vec<TelemetryRow>,
    /// Why its pilot has failed, if it says so.
    failure: Option<String>,
}

impl Report {
    /// Adds a row. Returns false if there is no room for it.
    fn add(&mut self, row: TelemetryRow, telemetry: &Telemetry) -> bool {
        let Telemetry::Metric { name, .. } = telemetry else { return push(&mut self.marks, row, MAX_MARKS) };
        let same = |known: &&mut TelemetryRow| known.metric().is_some_and(|(known, _)| known == *name);
        match self.metrics.iter_mut().find(same) {
            Some(known) => *known = row,
            None => return push(&mut self.metrics, row, MAX_METRICS),
        }
        true
    }
}

fn push(rows: &mut Vec<TelemetryRow>, row: TelemetryRow, most: usize) -> bool {
    let fits = rows.len() < most;
    if fits {
        rows.push(row);
    }
    fits
}

/// The reports of the current tick by drone, and the rows of the tick that ended last, in reused memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct TelemetryLog {
    reports: Vec<Report>,
    /// Whether any drone has reported anything in the current tick.
    any: bool,
    ended: Vec<TelemetryRow>,
}

impl TelemetryLog {
    /// Nothing reported yet, for this number of drones.
    pub(crate) fn new(drones: usize) -> Self {
        Self { reports: vec![Report::default(); drones], ..Self::default() }
    }

    /// Takes a frame of telemetry. Returns false if it is not valid, or more than a drone can report in a tick.
    pub(crate) fn take(&mut self, drone: DroneId, frame: &Frame) -> bool {
        let (Some(report), Ok(telemetry)) = (self.reports.get_mut(drone.index()), Telemetry::decode(frame)) else {
            return false;
        };
        self.any = true;
        if let Some(row) = TelemetryRow::new(drone, &telemetry) {
            return report.add(row, &telemetry);
        }
        if let Telemetry::Failure { reason } = telemetry {
            report.failure.get_or_insert(reason);
        }
        true
    }

    /// Why the pilot of a drone has failed in the current tick, as it says.
    pub(crate) fn failure(&self, drone: DroneId) -> Option<&str> {
        self.reports.get(drone.index())?.failure.as_deref()
    }

    /// Ends the tick.
    pub(crate) fn end_tick(&mut self) {
        self.ended.clear();
        if !std::mem::take(&mut self.any) {
            return;
        }
        for report in &mut self.reports {
            self.ended.append(&mut report.metrics);
            self.ended.append(&mut report.marks);
            report.failure = None;
        }
    }

    /// The rows of the tick that ended last, in the order of the drones.
    pub(crate) fn ended(&self) -> &[TelemetryRow] {
        &self.ended
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::{MetricName, ShortText};

    fn metric(name: &str, value: f64) -> Telemetry {
        Telemetry::Metric { name: MetricName::new(name).unwrap(), value }
    }

    fn ended(log: &mut TelemetryLog) -> Vec<(u32, Telemetry)> {
        log.end_tick();
        log.ended().iter().map(|row| (row.drone.0, row.telemetry().unwrap())).collect()
    }

    #[test]
    fn reports_are_kept_for_one_tick_in_the_order_of_the_drones() {
        let mut log = TelemetryLog::new(2);
        let mark = Telemetry::Mark { label: ShortText::cut("goal"), point_m: [1.0, 2.0, 3.0] };
        for (drone, telemetry) in
            [(1, mark.clone()), (1, metric("a", 1.0)), (0, metric("a", 2.0)), (1, metric("a", 3.0))]
        {
            assert!(log.take(DroneId(drone), &telemetry.encode()));
        }
        assert_eq!(ended(&mut log), [(0, metric("a", 2.0)), (1, metric("a", 3.0)), (1, mark)]);
        assert_eq!(ended(&mut log), []);
    }

    #[test]
    fn what_is_invalid_or_too_much_is_refused() {
        let mut log = TelemetryLog::new(1);
        assert!(!log.take(DroneId(0), &metric("a", f64::NAN).encode()));
        assert!(!log.take(DroneId(1), &metric("a", 1.0).encode()), "there is no such drone");
        for i in 0..=MAX_METRICS {
            assert_eq!(log.take(DroneId(0), &metric(&format!("m{i}"), 1.0).encode()), i < MAX_METRICS);
        }
        assert!(log.take(DroneId(0), &metric("m0", 2.0).encode()), "a known figure takes no room");
        let mark = Telemetry::Mark { label: ShortText::default(), point_m: [0.0; 3] };
        for i in 0..=MAX_MARKS {
            assert_eq!(log.take(DroneId(0), &mark.encode()), i < MAX_MARKS);
        }
        assert_eq!(ended(&mut log).len(), MAX_METRICS + MAX_MARKS);
    }

    #[test]
    fn a_failure_has_its_first_reason_until_the_end_of_the_tick() {
        let mut log = TelemetryLog::new(1);
        for reason in ["first", "second"] {
            assert!(log.take(DroneId(0), &Telemetry::Failure { reason: reason.to_owned() }.encode()));
        }
        assert_eq!(log.failure(DroneId(0)), Some("first"));
        assert_eq!(ended(&mut log), []);
        assert_eq!(log.failure(DroneId(0)), None);
    }
}
