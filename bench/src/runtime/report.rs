//! The results of the runtime benchmark.

use super::case::Case;
use super::measurement::Measurement;
use crate::error::BenchError;
use crate::median::median;
use serde::Serialize;
use skein_report::plot::sweep::{Lines, Point, Series};
use std::fmt::Write;

/// The results of all cases and sizes.
#[derive(Clone, Debug, Serialize)]
pub struct RuntimeReport {
    /// Cores that this process may use.
    pub cores: usize,
    /// Rounds; each measured every case once.
    pub rounds: u32,
    /// One row for each size and case.
    pub rows: Vec<CaseRow>,
    /// Ratios of two cases.
    pub ratios: Vec<Ratio>,
}

/// The results of one case and size over all rounds.
#[derive(Clone, Debug, Serialize)]
pub struct CaseRow {
    /// Size of the swarm.
    pub drones: u32,
    /// The case.
    pub case: Case,
    /// Medians over the rounds.
    #[serde(flatten)]
    pub median: Measurement,
    /// Slowest round, ticks/s.
    pub ticks_per_s_min: f64,
    /// Fastest round, ticks/s.
    pub ticks_per_s_max: f64,
}

/// The ratio of two cases, taken round by round.
#[derive(Clone, Debug, Serialize)]
pub struct Ratio {
    /// Size of the swarm.
    pub drones: u32,
    /// What is compared: `ticks_per_s` or `cpu_us_per_step`.
    pub of: &'static str,
    /// Case in the numerator.
    pub case: Case,
    /// Case in the denominator.
    pub to: Case,
    /// Median over the rounds.
    pub median: f64,
    /// The ratio of each round.
    pub rounds: Vec<f64>,
}

type Value = fn(&Measurement) -> f64;

/// What is compared with what.
const PAIRS: [(&str, Value, Case, Case); 7] = [
    ("ticks_per_s", ticks_per_s, Case::BlockBeacon, Case::Baseline),
    ("ticks_per_s", ticks_per_s, Case::YieldBeacon, Case::Baseline),
    ("cpu_us_per_step", cpu_us_per_step, Case::BlockBeacon, Case::Baseline),
    ("ticks_per_s", ticks_per_s, Case::BlockBeacon, Case::Datagrams),
    ("ticks_per_s", ticks_per_s, Case::Block, Case::Inline),
    ("ticks_per_s", ticks_per_s, Case::Yield, Case::Inline),
    ("ticks_per_s", ticks_per_s, Case::Packed, Case::Block),
];

fn ticks_per_s(measurement: &Measurement) -> f64 {
    measurement.ticks_per_s
}

fn cpu_us_per_step(measurement: &Measurement) -> f64 {
    measurement.cpu_us_per_step.unwrap_or(f64::NAN)
}

impl RuntimeReport {
    /// A report without rows.
    pub(super) fn new(cores: usize, rounds: u32) -> Self {
        Self { cores, rounds, rows: Vec::new(), ratios: Vec::new() }
    }

    /// Adds the cases of one size, each with its measurements, one per round.
    pub(super) fn add(&mut self, drones: u32, cases: &[Case], measured: &[Vec<Measurement>]) {
        for (&case, rounds) in cases.iter().zip(measured) {
            let speeds = || rounds.iter().map(ticks_per_s);
            self.rows.push(CaseRow {
                drones,
                case,
                median: Measurement::median(rounds),
                ticks_per_s_min: speeds().fold(f64::INFINITY, f64::min),
                ticks_per_s_max: speeds().fold(0.0, f64::max),
            });
        }
        let place = |case: Case| cases.iter().position(|&other| other == case);
        for (of, value, case, to) in PAIRS {
            let (Some(a), Some(b)) = (place(case), place(to)) else { continue };
            let rounds: Vec<f64> = measured[a].iter().zip(&measured[b]).map(|(a, b)| value(a) / value(b)).collect();
            self.ratios.push(Ratio { drones, of, case, to, median: median(rounds.iter().copied()), rounds });
        }
    }

    /// The rows and ratios as text tables.
    #[must_use]
    pub fn table(&self) -> String {
        let mut out = format!("{} cores, {} interleaved rounds; medians\n\n", self.cores, self.rounds);
        let [first, second, rest @ ..] = HEADS;
        // Writing to a string cannot fail.
        let _ = write!(out, "{first:>6} {second:<33}");
        for head in rest {
            let _ = write!(out, "{head:>9}");
        }
        let _ = write!(out, "\n{:40}", "");
        for unit in UNITS {
            let _ = write!(out, "{unit:>9}");
        }
        out.push('\n');
        for row in &self.rows {
            row.line(&mut out);
        }
        out.push_str("\nratios, taken round by round\n");
        for ratio in &self.ratios {
            ratio.line(&mut out);
        }
        out
    }

    /// CPU time per agent-step against the size of the swarm, an SVG.
    ///
    /// # Errors
    /// [`BenchError::Plot`].
    pub fn plot(&self) -> Result<String, BenchError> {
        let cases = [Case::Baseline, Case::BlockBeacon, Case::Inline, Case::Block, Case::Yield, Case::Packed];
        let series = cases.map(|case| {
            let of_case = self.rows.iter().filter(|row| row.case == case);
            let point = |row: &CaseRow| {
                let us = row.median.cpu_us_per_step?;
                Some(Point { x: f64::from(row.drones).log2(), mean: us, low: us, high: us })
            };
            Series { label: case.name().to_owned(), points: of_case.filter_map(point).collect() }
        });
        let lines = Lines {
            title: "CPU time per agent-step, the world's share included: medians".to_owned(),
            x_label: "drones, as a power of two".to_owned(),
            y_label: "CPU time per agent-step, µs".to_owned(),
            series: series.into_iter().filter(|series| !series.points.is_empty()).collect(),
        };
        Ok(lines.draw()?)
    }
}

const HEADS: [&str; 17] = [
    "drones", "case", "ticks/s", "steps/s", "× real", "p50", "p99", "max", "calls", "switches", "cpu", "world",
    "drones", "RSS", "PSS", "start", "end",
];
const UNITS: [&str; 15] =
    ["1/s", "1/s", "", "µs", "µs", "µs", "/step", "/step", "µs/step", "µs/step", "µs/step", "MiB", "MiB", "s", "s"];

impl CaseRow {
    fn line(&self, out: &mut String) {
        let (m, case) = (&self.median, self.case.name());
        let values = [
            Some(m.ticks_per_s),
            Some(m.agent_steps_per_s),
            m.realtime_factor,
            m.step_us_p50,
            m.step_us_p99,
            m.step_us_max,
            m.calls_per_step,
            m.switches_per_step,
            m.cpu_us_per_step,
            m.world_us_per_step,
            m.drones_us_per_step,
            m.rss_mib,
            m.pss_mib,
            m.startup_s,
            m.shutdown_s,
        ];
        let _ = write!(out, "{:>6} {case:<33}", self.drones);
        for value in values {
            let _ = write!(out, "{:>9}", value.map_or_else(|| "-".to_owned(), short));
        }
        out.push('\n');
    }
}

impl Ratio {
    fn line(&self, out: &mut String) {
        let (low, high) = self.rounds.iter().fold((f64::INFINITY, 0f64), |(l, h), &r| (l.min(r), h.max(r)));
        let what = if self.of == "ticks_per_s" { "ticks/s" } else { "CPU/step" };
        let pair = format!("{} / {}", self.case.name(), self.to.name());
        let (drones, median) = (self.drones, self.median);
        let _ = writeln!(out, "{drones:>6} {pair:<52} {what:<11} {median:>6.2}  ({low:.2} to {high:.2})");
    }
}

/// Rounds to three significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        v if v >= 1e6 => format!("{:.2} M", value / 1e6),
        v if v >= 1e4 => format!("{:.1} k", value / 1e3),
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!(
            [short(1_234_567.0), short(31_300.0), short(742.0), short(0.456)],
            ["1.23 M", "31.3 k", "742", "0.46"]
        );
    }

    #[test]
    fn ratios_are_taken_round_by_round() {
        let speed = |ticks_per_s: f64| Measurement { ticks_per_s, ..Measurement::default() };
        let mut report = RuntimeReport::new(2, 2);
        let measured = [vec![speed(10.0), speed(20.0)], vec![speed(20.0), speed(10.0)]];
        report.add(8, &[Case::Inline, Case::Block], &measured);
        assert_eq!(report.ratios.len(), 1);
        assert_eq!(report.ratios[0].rounds, [2.0, 0.5]);
        assert_eq!((report.rows[1].ticks_per_s_min, report.rows[1].ticks_per_s_max), (10.0, 20.0));
        assert!(report.table().contains("block, formation / inline, formation"));
    }
}
