//! What is counted over a whole mission.

use skein_protocol::histogram;
use skein_protocol::record::{Percentiles, Totals};
use skein_protocol::slot::{LinkStats, Slot};

/// The counters so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct MissionCounters {
    totals: Totals,
}

impl MissionCounters {
    /// Counts what a drone received and did not receive in a tick.
    pub(crate) fn count_slot(&mut self, slot: &Slot) {
        self.totals.delivered += u64::from(slot.heard);
        self.totals.duplicates += u64::from(slot.duplicates);
        for (sum, dropped) in self.totals.dropped.iter_mut().zip(slot.dropped) {
            *sum += u64::from(dropped);
        }
    }

    /// Counts frames that were sent.
    pub(crate) fn count_sent(&mut self, frames: u64) {
        self.totals.sent += frames;
    }

    /// Counts figures, marks and lines that were not recorded.
    pub(crate) fn count_refused(&mut self, telemetry: u64) {
        self.totals.telemetry_refused += telemetry;
    }

    /// Counts answers that did not come in time.
    pub(crate) fn count_missed(&mut self, deadlines: u64) {
        self.totals.deadline_misses += deadlines;
    }

    /// Counts commands that were not finite.
    pub(crate) fn count_rejected(&mut self, commands: u64) {
        self.totals.rejected_commands += commands;
    }

    /// Notes how late ticks opened by the wall clock, s.
    pub(crate) fn set_lateness(&mut self, lateness_s: Percentiles) {
        self.totals.lateness_s = lateness_s;
    }

    /// The totals of the mission. `stats` are the link counters of all drones together, `dt_s` is the width of their
    /// bins, `wall_s` the wall time of the mission.
    pub(crate) fn close(&self, stats: &LinkStats, dt_s: f64, wall_s: f64) -> Totals {
        Totals {
            delay_s: histogram::percentiles(&stats.delay_bins, stats.delay_max, dt_s),
            age_s: histogram::percentiles(&stats.age_bins, stats.age_max, dt_s),
            wall_s,
            ..self.totals.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_statistics_have_no_percentiles() {
        let totals = MissionCounters::default().close(&LinkStats::default(), 0.02, 1.5);
        assert_eq!((totals.delay_s, totals.wall_s), (Percentiles::default(), 1.5));
    }

    #[test]
    fn percentiles_are_nearest_ranks() {
        let mut stats = LinkStats::default();
        for _ in 0..98 {
            stats.delay(1);
        }
        stats.delay(5);
        stats.delay(1000);
        let delay_s = MissionCounters::default().close(&stats, 0.5, 0.0).delay_s;
        assert_eq!((delay_s.p50, delay_s.p99, delay_s.max), (Some(0.5), Some(2.5), Some(500.0)));
        assert_eq!(delay_s.mean, Some((98.0 + 5.0 + 1000.0) / 100.0 * 0.5));
    }

    #[test]
    fn drops_add_up_by_reason() {
        let mut counters = MissionCounters::default();
        let slot = Slot { heard: 2, duplicates: 1, dropped: [1, 0, 0, 4, 0, 0, 5], ..Slot::default() };
        for _ in 0..3 {
            counters.count_slot(&slot);
        }
        let totals = counters.close(&LinkStats::default(), 0.02, 0.0);
        assert_eq!((totals.delivered, totals.duplicates, totals.dropped), (6, 3, [3, 0, 0, 12, 0, 0, 15]));
    }
}
