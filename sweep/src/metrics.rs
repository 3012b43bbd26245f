//! Metrics: the numbers that each run gives.

use crate::own_statistic::OwnColumn;
use skein_report::Summary;
use skein_scenario::Scenario;

/// A number that is computed from a run's summary.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Column in runs.csv; the name ends in the unit.
    pub name: &'static str,
    /// Label on a plot's axis.
    pub label: &'static str,
    /// Whether means are over runs that reached their goal only. For the other runs, times and energies say when the
    /// run was given up.
    pub reached_only: bool,
    /// Computes the number from a run's summary and scenario; `None` if it does not apply.
    pub value: fn(&Summary, &Scenario) -> Option<f64>,
}

/// Name of the success rate: the share of runs that reached their goal and kept every invariant. It is not in
/// [`METRICS`], because a single run has no rate.
pub const SUCCESS: &str = "success";

/// All metrics, in the order of their columns.
pub const METRICS: [Metric; 21] = [
    of_reached("mission_s", "mission time (s)", |s, _| Some(s.mission_s)),
    of_reached("pass_time_s", "time to pass, all obstacle sets (s)", |s, _| {
        (!s.stages.is_empty()).then(|| s.stages.iter().map(|stage| stage.pass_time_s).sum::<Option<f64>>())?
    }),
    of_reached("predicted_s", "forecast of the time to pass (s)", |s, _| {
        (!s.stages.is_empty()).then(|| s.stages.iter().map(|stage| stage.predicted_s).sum::<Option<f64>>())?
    }),
    of_reached("energy_j", "energy (J)", |s, _| Some(s.energy_j.total)),
    of_reached("energy_until_passed_j", "energy until passed (J)", |s, _| s.energy_j.until_passed),
    of_reached("energy_detection_to_pass_j", "energy from detection to pass (J)", |s, _| s.energy_j.detection_to_pass),
    of_all("min_separation_m", "least separation (m)", |s, _| s.min_separation_m),
    of_all("separation_ratio", "least separation / safe distance", |s, scenario| {
        Some(s.min_separation_m? / scenario.drone.safe_distance_m)
    }),
    of_all("min_clearance_m", "least clearance (m)", |s, _| s.min_clearance_m),
    of_all("clearance_ratio", "least clearance / clearance to keep", |s, scenario| {
        Some(s.min_clearance_m? / scenario.avoidance.clearance_m)
    }),
    of_all("violations", "broken invariants", |s, _| Some(s.violations.len() as f64)),
    of_reached("formation_error_m", "formation error (m)", |s, _| s.formation_error_m),
    of_all("elections", "elections", |s, _| Some(f64::from(s.elections))),
    of_all("split_brain_s", "time with two leaders in contact (s)", |s, _| Some(s.split_brain_s)),
    of_all("messages_sent", "messages sent", |s, _| Some(s.messages.sent as f64)),
    of_all("messages_delivered", "messages delivered", |s, _| Some(s.messages.delivered as f64)),
    of_all("messages_lost", "messages lost", |s, _| {
        let d = &s.messages.dropped;
        let counts = [d.loss, d.burst, d.range, d.partition, d.deaf, d.malformed, d.queue];
        Some(counts.into_iter().flatten().sum::<u64>() as f64)
    }),
    of_all("order", "order of the headings, 1 = all alike", |s, _| s.metrics.order),
    of_all("safety", "share of pairs that keep the safe distance", |s, _| s.metrics.safety),
    of_all("union", "union of the swarm, 1 = one component", |s, _| s.metrics.union),
    of_all("connectivity", "algebraic connectivity / number of drones", |s, _| s.metrics.connectivity),
];

/// What the names of figures that pilots report begin with, in experiments, columns and files.
pub const OWN_PREFIX: &str = "metric.";

/// Metrics that are plotted and tabled unless the experiment names others.
pub(crate) const DEFAULT: [&str; 4] = [SUCCESS, "mission_s", "energy_j", "separation_ratio"];

/// The metric with this name; `None` if there is none.
#[must_use]
pub(crate) fn metric(name: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|metric| metric.name == name)
}

/// What stands behind the prefix, if this is the name of a figure that pilots report, or of one of its statistics:
/// `metric.gap_m.last` gives `gap_m.last`.
#[must_use]
pub(crate) fn own_name(name: &str) -> Option<&str> {
    name.strip_prefix(OWN_PREFIX).filter(|own| OwnColumn::parse(own).is_some())
}

/// Label of a metric, of the success rate, or of a figure of pilots, on a plot's axis.
#[must_use]
pub(crate) fn label(name: &str) -> String {
    match (metric(name), name.strip_prefix(OWN_PREFIX).and_then(OwnColumn::parse)) {
        (Some(metric), _) => metric.label.to_owned(),
        (None, Some(own)) => own.label(),
        (None, None) => "share of runs that reached the goal safely".to_owned(),
    }
}

type Value = fn(&Summary, &Scenario) -> Option<f64>;

/// A metric that is averaged over the runs that reached their goal.
const fn of_reached(name: &'static str, label: &'static str, value: Value) -> Metric {
    Metric { name, label, reached_only: true, value }
}

/// A metric that is averaged over all runs.
const fn of_all(name: &'static str, label: &'static str, value: Value) -> Metric {
    Metric { name, label, reached_only: false, value }
}
