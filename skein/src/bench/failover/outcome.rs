//! A line of the bench's table.

use super::ClockChoice;
use super::flight::ChannelSetting;
use super::witness::Found;
use serde::Serialize;
use skein_report::Summary;

/// What came of one flight. Times in seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// `lockstep` or `realtime`.
    clock: &'static str,
    /// Share of frames that are lost.
    loss: f64,
    /// How long a frame is on the air besides its tick.
    delay_s: f64,
    /// Leaders that died.
    kills: usize,
    /// Of them, those after whom all followed another one before that one died too.
    replaced: usize,
    /// Quantiles of the time from the death to "every living drone follows another leader", of those replaced.
    p50_s: Option<f64>,
    p90_s: Option<f64>,
    p99_s: Option<f64>,
    max_s: Option<f64>,
    /// Of those replaced, those during which the machine kept time, and for half a second before; and their last quantile.
    on_time: usize,
    on_time_p99_s: Option<f64>,
    /// Terms in which somebody began to lead beside a living leader that all followed.
    false_elections: usize,
    false_elections_per_h: f64,
    /// Sent by each living drone, on average.
    frames_per_s: f64,
    bytes_per_s: f64,
    /// Time with two leaders of one group who could hear each other.
    split_brain_s: f64,
    /// The longest of these times.
    split_max_s: f64,
    /// Broken invariants.
    violations: usize,
    /// Ticks that drones did not answer in time (realtime).
    deadline_misses: u64,
    /// Simulated time of the flight.
    sim_s: f64,
    /// Of the flight; the same each time in lockstep.
    digest: Option<String>,
}

impl Row {
    /// From what was seen of a flight.
    pub fn new(air: &ChannelSetting, found: &Found, summary: &Summary) -> Self {
        let (times, on_time) = (ascending(&found.followed_s), ascending(&found.on_time_s));
        let rate = |count: f64, seconds: f64| if seconds > 0.0 { count / seconds } else { 0.0 };
        Self {
            clock: match air.clock {
                ClockChoice::Lockstep => "lockstep",
                ClockChoice::Realtime => "realtime",
            },
            loss: air.loss,
            delay_s: air.delay_s,
            kills: found.deaths,
            replaced: times.len(),
            p50_s: quantile(&times, 0.5),
            p90_s: quantile(&times, 0.9),
            p99_s: quantile(&times, 0.99),
            max_s: times.last().copied(),
            on_time: on_time.len(),
            on_time_p99_s: quantile(&on_time, 0.99),
            false_elections: found.false_elections,
            false_elections_per_h: rate(3600.0 * found.false_elections as f64, found.seconds),
            frames_per_s: rate(found.frames as f64, found.drone_seconds),
            bytes_per_s: rate(found.bytes as f64, found.drone_seconds),
            split_brain_s: summary.split_brain_s,
            split_max_s: (found.split_max_s * 1e6).round() / 1e6,
            violations: summary.violations.len(),
            deadline_misses: summary.deadline_misses,
            sim_s: summary.sim_s,
            digest: summary.digest.clone(),
        }
    }

    /// Whether an invariant was broken.
    pub fn is_unsafe(&self) -> bool {
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

/// To the microsecond: sums of ticks are not exact.
fn ascending(times: &[f64]) -> Vec<f64> {
    let mut times: Vec<f64> = times.iter().map(|s| (s * 1e6).round() / 1e6).collect();
    times.sort_by(f64::total_cmp);
    times
}

/// The value that so large a share of ascending values does not exceed (nearest rank).
fn quantile(ascending: &[f64], share: f64) -> Option<f64> {
    let rank = (share * ascending.len() as f64).ceil() as usize;
    ascending.get(rank.saturating_sub(1)).copied()
}

/// The table for a person.
pub fn table(rows: &[Row]) -> String {
    let lines: Vec<[String; 15]> =
        std::iter::once(HEAD.map(str::to_owned)).chain(rows.iter().map(Row::cells)).collect();
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
    fn quantiles_are_of_the_nearest_rank() {
        let values: Vec<f64> = (1..=200).map(f64::from).collect();
        assert_eq!([0.5, 0.9, 0.99].map(|share| quantile(&values, share)), [Some(100.0), Some(180.0), Some(198.0)]);
        assert_eq!((quantile(&[7.0], 0.99), quantile(&[], 0.5)), (Some(7.0), None));
    }
}
