//! The elections of one setting: a line of the table.

use super::topology::Topology;
use super::trial::{Elected, Trial};
use crate::median::median;
use serde::Serialize;

/// The elections of one setting over all seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElectionRow {
    /// Who hears whom.
    topology: Topology,
    /// Size of the swarm.
    drones: u32,
    /// Share of the frames that a receiver loses.
    loss: f64,
    /// Share of the drones that die in the first seconds.
    failing: f64,
    /// Number of elections.
    seeds: usize,
    /// Elections that had one leader in time.
    elected: usize,
    /// Median of the times from the start until there was one leader, s.
    p50_s: Option<f64>,
    /// Greatest of these times, s.
    max_s: Option<f64>,
    /// Frames that a drone had sent until then: the median.
    frames_per_drone: Option<f64>,
    /// Drones that led before that and gave way, on average.
    false_leaders: f64,
    /// Terms that began in the ten seconds after, on average.
    later_terms: f64,
    /// What a living drone sent in these ten seconds: the median, bytes/s.
    bytes_per_s: Option<f64>,
    /// Hops between the two drones that are farthest from each other: the median.
    hops: f64,
}

impl ElectionRow {
    pub(super) fn new(setting: Trial, all: &[Elected]) -> Self {
        let Trial { topology, drones, loss, failing, .. } = setting;
        let times: Vec<f64> = all.iter().filter_map(|one| one.time_s).collect();
        let elected = || all.iter().filter(|one| one.time_s.is_some());
        let any = |value: f64| (!times.is_empty()).then_some(value);
        let mean = |value: fn(&Elected) -> usize| {
            let sum: usize = elected().map(value).sum();
            sum as f64 / times.len().max(1) as f64
        };
        Self {
            topology,
            drones,
            loss,
            failing,
            seeds: all.len(),
            elected: times.len(),
            p50_s: any(median(times.iter().copied())),
            max_s: any(times.iter().copied().fold(0.0, f64::max)),
            frames_per_drone: any(median(elected().map(|one| one.frames))),
            false_leaders: mean(|one| one.false_leaders),
            later_terms: mean(|one| one.later),
            bytes_per_s: any(median(elected().map(|one| one.bytes_per_s))),
            hops: median(all.iter().map(|one| one.hops as f64)),
        }
    }

    fn cells(&self) -> [String; 12] {
        let number = |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |v| format!("{v:.digits$}"));
        [
            self.topology.name().to_owned(),
            self.drones.to_string(),
            self.loss.to_string(),
            self.failing.to_string(),
            format!("{}/{}", self.elected, self.seeds),
            number(self.p50_s, 2),
            number(self.max_s, 2),
            number(self.frames_per_drone, 0),
            format!("{:.1}", self.false_leaders),
            format!("{:.1}", self.later_terms),
            format!("{:.0}", self.hops),
            number(self.bytes_per_s, 0),
        ]
    }
}

const HEAD: [&str; 12] = [
    "topology",
    "drones",
    "loss",
    "failing",
    "elected",
    "p50_s",
    "max_s",
    "frames/drone",
    "false",
    "later",
    "hops",
    "bytes/s",
];

/// The rows as a text table.
pub(super) fn table(rows: &[ElectionRow]) -> String {
    let lines: Vec<[String; 12]> =
        std::iter::once(HEAD.map(str::to_owned)).chain(rows.iter().map(ElectionRow::cells)).collect();
    let width = |i: usize| lines.iter().map(|line| line[i].len()).max().unwrap_or(0);
    let padded = |line: &[String; 12]| {
        let fields = line.iter().enumerate().map(|(i, field)| format!("{field:<width$}", width = width(i)));
        fields.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    lines.iter().map(padded).collect()
}
