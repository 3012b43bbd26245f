//! The results of one mission of the failover benchmark: a line of its table.

use super::monitor::FailoverCounts;
use super::setting::{ClockChoice, HEARTBEAT_S, Setting};
use serde::Serialize;
use skein_report::Summary;
use skein_report::number_text::brief;

/// The results of one mission. Times in seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FailoverRow {
    /// Time between two heartbeats of a leader.
    heartbeat_s: f64,
    /// `lockstep` or `realtime`.
    clock: &'static str,
    /// Share of frames that are lost.
    loss: f64,
    /// Transmission delay of a frame besides its tick.
    delay_s: f64,
    /// Leaders that died.
    kills: usize,
    /// Leaders that were replaced before their successor died too.
    replaced: usize,
    /// Median of the time from a leader's death until every living drone follows another leader, over those replaced.
    p50_s: Option<f64>,
    /// 90th percentile of the same time.
    p90_s: Option<f64>,
    /// 99th percentile of the same time.
    p99_s: Option<f64>,
    /// Greatest of the same times.
    max_s: Option<f64>,
    /// Replacements during which, and for half a second before, no drone answered late.
    on_time: usize,
    /// 99th percentile over these.
    on_time_p99_s: Option<f64>,
    /// Terms in which a drone began to lead although all drones followed a living leader.
    false_elections: usize,
    /// The same per hour of simulated time.
    false_elections_per_h: f64,
    /// Frames sent per second by each living drone, on average.
    frames_per_s: f64,
    /// Bytes sent per second by each living drone, on average.
    bytes_per_s: f64,
    /// Time with two leaders of one group that could hear each other.
    split_brain_s: f64,
    /// Longest time without a break with two leaders.
    split_max_s: f64,
    /// Broken invariants.
    violations: usize,
    /// Ticks that drones did not answer in time (realtime).
    deadline_misses: u64,
    /// Simulated time of the flight.
    sim_s: f64,
    /// Digest of the flight; the same each time in lockstep.
    digest: Option<String>,
}

impl FailoverRow {
    /// Evaluates what was observed during a flight.
    pub(super) fn new(setting: &Setting, counts: &FailoverCounts, summary: &Summary) -> Self {
        let (times, on_time) = (ascending(&counts.failover_s), ascending(&counts.on_time_s));
        let rate = |count: f64, seconds: f64| if seconds > 0.0 { count / seconds } else { 0.0 };
        Self {
            heartbeat_s: setting.heartbeat_s,
            clock: match setting.clock {
                ClockChoice::Lockstep => "lockstep",
                ClockChoice::Realtime => "realtime",
            },
            loss: setting.loss,
            delay_s: setting.delay_s,
            kills: counts.deaths,
            replaced: times.len(),
            p50_s: quantile(&times, 0.5),
            p90_s: quantile(&times, 0.9),
            p99_s: quantile(&times, 0.99),
            max_s: times.last().copied(),
            on_time: on_time.len(),
            on_time_p99_s: quantile(&on_time, 0.99),
            false_elections: counts.false_elections,
            false_elections_per_h: rate(3600.0 * counts.false_elections as f64, counts.seconds),
            frames_per_s: rate(counts.frames as f64, counts.drone_seconds),
            bytes_per_s: rate(counts.bytes as f64, counts.drone_seconds),
            split_brain_s: summary.split_brain_s,
            split_max_s: to_microseconds(counts.split_max_s),
            violations: summary.violations.len(),
            deadline_misses: summary.deadline_misses,
            sim_s: summary.sim_s,
            digest: summary.digest.clone(),
        }
    }

    /// Whether an invariant was broken.
    pub(super) fn is_unsafe(&self) -> bool {
        self.violations > 0
    }

    fn cells(&self) -> [String; 15] {
        let time = |seconds: Option<f64>| seconds.map_or("-".to_owned(), |s| format!("{s:.3}"));
        [
            self.clock.to_owned(),
            self.loss.to_string(),
            self.delay_s.to_string(),
            format!("{}/{}", self.replaced, self.kills),
            time(self.p50_s),
            time(self.p90_s),
            time(self.p99_s),
            time(self.max_s),
            self.on_time.to_string(),
            time(self.on_time_p99_s),
            format!("{:.1}", self.false_elections_per_h),
            format!("{:.1}", self.frames_per_s),
            format!("{:.0}", self.bytes_per_s),
            format!("{:.2}", self.split_max_s),
            self.deadline_misses.to_string(),
        ]
    }
}

const HEAD: [&str; 15] = [
    "clock", "loss", "delay_s", "replaced", "p50_s", "p90_s", "p99_s", "max_s", "on time", "p99_s", "false/h",
    "frames/s", "bytes/s", "split_s", "late",
];

/// Rounds to microseconds, because sums of ticks are not exact.
fn to_microseconds(seconds: f64) -> f64 {
    (seconds * 1e6).round() / 1e6
}

fn ascending(times: &[f64]) -> Vec<f64> {
    let mut times: Vec<f64> = times.iter().map(|&s| to_microseconds(s)).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// The least of the ascending values that at least this share of them does not exceed (nearest rank); `None` if there
/// are no values.
fn quantile(ascending: &[f64], share: f64) -> Option<f64> {
    let rank = (share * ascending.len() as f64).ceil() as usize;
    ascending.get(rank.saturating_sub(1)).copied()
}

/// The rows as text: a table for each heartbeat. Its heading says which, unless it is the usual one alone.
pub(super) fn table(rows: &[FailoverRow]) -> String {
    let parts = rows.chunk_by(|a, b| a.heartbeat_s == b.heartbeat_s).map(|of| match of {
        [FailoverRow { heartbeat_s, .. }, ..] if *heartbeat_s != HEARTBEAT_S || of.len() < rows.len() => {
            format!("heartbeats at {} Hz\n{}", brief(1.0 / heartbeat_s, 1.0), one_table(of))
        }
        of => one_table(of),
    });
    parts.collect::<Vec<_>>().join("\n")
}

fn one_table(rows: &[FailoverRow]) -> String {
    let lines: Vec<[String; 15]> =
        std::iter::once(HEAD.map(str::to_owned)).chain(rows.iter().map(FailoverRow::cells)).collect();
    let width = |i: usize| lines.iter().map(|line| line[i].len()).max().unwrap_or(0);
    let padded = |line: &[String; 15]| {
        let fields = line.iter().enumerate().map(|(i, field)| format!("{field:<width$}", width = width(i)));
        fields.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    lines.iter().map(padded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_the_nearest_rank() {
        let values: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!([0.5, 0.9, 0.99].map(|share| quantile(&values, share)), [Some(100.0), Some(180.0), Some(198.0)]);
        assert_eq!((quantile(&[7.0], 0.99), quantile(&[], 0.5)), (Some(7.0), None));
    }
}
