//! A swarm that is watched, and its rates.

use crate::exit::Failure;
use crate::tap::{RunningSwarm, SwarmTap, Swarms};
use skein_protocol::record::{DroneRow, RecordView};
use std::time::Instant;

/// What was counted since the last redraw.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    ticks: u64,
    sent: u64,
    heard: u64,
    dropped: u64,
    t_s: f64,
}

/// Rates between the last two redraws, per second of wall time.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rates {
    /// Ticks.
    pub(crate) ticks: f64,
    /// Simulated seconds.
    pub(crate) real: f64,
    /// Frames sent.
    pub(crate) sent: f64,
    /// Messages heard.
    pub(crate) heard: f64,
    /// Frames dropped.
    pub(crate) dropped: f64,
}

/// A swarm that is watched.
pub(crate) struct SwarmView {
    /// Which swarm.
    pub(crate) run: RunningSwarm,
    /// The tap on it.
    pub(crate) tap: SwarmTap,
    /// The rows of its last record.
    pub(crate) rows: Vec<DroneRow>,
    /// Simulated time, s.
    pub(crate) t_s: f64,
    /// Least distance between two living drones, m; `None` if fewer than two live.
    pub(crate) separation_m: Option<f64>,
    /// Its rates.
    pub(crate) rates: Rates,
    first_tick: Option<u64>,
    tick: u64,
    counts: Counts,
    since: Instant,
}

impl SwarmView {
    /// Attaches to a swarm.
    pub(crate) fn attach(swarms: &Swarms, run: RunningSwarm) -> Result<Self, Failure> {
        let tap = SwarmTap::attach(swarms, &run)?;
        Ok(Self {
            run,
            tap,
            rows: Vec::new(),
            t_s: 0.0,
            separation_m: None,
            rates: Rates::default(),
            first_tick: None,
            tick: 0,
            counts: Counts::default(),
            since: Instant::now(),
        })
    }

    /// Takes the records that have come in.
    pub(crate) fn gather(&mut self) {
        while let Ok(Some(sample)) = self.tap.record() {
            let Ok(record) = RecordView::parse(sample.bytes()) else { continue };
            let head = record.head;
            if self.rows.is_empty() {
                // Over a network, the first record takes its time.
                self.since = Instant::now();
            }
            self.first_tick.get_or_insert(head.tick);
            self.tick = head.tick;
            self.counts.t_s = head.now.secs();
            self.counts.ticks += 1;
            self.counts.sent += u64::from(head.frames);
            self.counts.heard += record.rows.iter().map(|row| u64::from(row.heard)).sum::<u64>();
            self.counts.dropped += record.rows.iter().flat_map(|row| row.dropped).map(u64::from).sum::<u64>();
            self.rows.clear();
            self.rows.extend_from_slice(record.rows);
        }
    }

    /// Computes the rates and begins to count again. Ticks whose records were missed count as ticks, with as many frames
    /// as the others on average.
    pub(crate) fn turn(&mut self) {
        let passed_s = self.since.elapsed().as_secs_f64();
        let Some(first) = self.first_tick.take() else {
            self.rates = Rates::default();
            self.since = Instant::now();
            return;
        };
        let (seen, ticks) = (self.counts.ticks.max(1) as f64, (self.tick - first + 1) as f64);
        let rate = |count: u64| count as f64 * ticks / seen / passed_s;
        self.rates = Rates {
            ticks: ticks / passed_s,
            real: ticks * self.tap.facts.dt_s / passed_s,
            sent: rate(self.counts.sent),
            heard: rate(self.counts.heard),
            dropped: rate(self.counts.dropped),
        };
        self.t_s = self.counts.t_s;
        self.separation_m = separation(&self.rows);
        (self.counts, self.since) = (Counts::default(), Instant::now());
    }
}

/// The least distance between two living drones. Sorted by x, so that far pairs are skipped.
fn separation(rows: &[DroneRow]) -> Option<f64> {
    let mut places: Vec<[f64; 3]> = rows.iter().filter(|row| row.alive()).map(|row| row.position_m).collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut least: Option<f64> = None;
    for (i, here) in places.iter().enumerate() {
        for there in &places[i + 1..] {
            let along = there[0] - here[0];
            if least.is_some_and(|least| along >= least) {
                break;
            }
            let distance = along.hypot(there[1] - here[1]).hypot(there[2] - here[2]);
            least = Some(least.map_or(distance, |least| least.min(distance)));
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::ROW_ALIVE;

    #[test]
    fn only_living_drones_count_for_the_separation() {
        let row = |x, y, flags| DroneRow { position_m: [x, y, 50.0], flags, ..DroneRow::default() };
        let rows = [row(0.0, 0.0, ROW_ALIVE), row(1.0, 0.0, 0), row(30.0, 40.0, ROW_ALIVE), row(60.0, 0.0, ROW_ALIVE)];
        assert_eq!(separation(&rows), Some(50.0));
        assert_eq!(separation(&rows[..2]), None);
    }
}
