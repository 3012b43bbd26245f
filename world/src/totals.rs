//! Counters of a whole mission.

use skein_protocol::histogram;
use skein_protocol::record::Totals;
use skein_protocol::slot::{LinkStats, Slot};

/// The totals of the world's own counters; `stats` are those of all radios together, `dt_s` is the width of a bin.
pub(crate) fn close(counted: &Totals, stats: &LinkStats, dt_s: f64, wall_s: f64) -> Totals {
    Totals {
        delay_s: histogram::percentiles(&stats.delay_bins, stats.delay_max, dt_s),
        age_s: histogram::percentiles(&stats.age_bins, stats.age_max, dt_s),
        wall_s,
        ..counted.clone()
    }
}

/// Adds what a drone heard and did not hear in a tick.
pub(crate) fn tally(counted: &mut Totals, slot: &Slot) {
    counted.delivered += u64::from(slot.heard);
    counted.duplicates += u64::from(slot.duplicates);
    counted.dropped.iter_mut().zip(slot.dropped).for_each(|(sum, dropped)| *sum += u64::from(dropped));
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::record::Percentiles;

    #[test]
    fn nothing_counted_has_no_spread() {
        let totals = close(&Totals::default(), &LinkStats::default(), 0.02, 1.5);
        assert_eq!((totals.delay_s, totals.wall_s), (Percentiles::default(), 1.5));
    }

    #[test]
    fn quantiles_are_nearest_ranks() {
        let mut stats = LinkStats::default();
        (0..98).for_each(|_| stats.delay(1));
        stats.delay(5);
        stats.delay(1000);
        let spread = close(&Totals::default(), &stats, 0.5, 0.0).delay_s;
        assert_eq!((spread.p50, spread.p99, spread.max), (Some(0.5), Some(2.5), Some(500.0)));
        assert_eq!(spread.mean, Some((98.0 + 5.0 + 1000.0) / 100.0 * 0.5));
    }

    #[test]
    fn drops_add_up_by_reason() {
        let mut counted = Totals::default();
        let slot = Slot { heard: 2, duplicates: 1, dropped: [1, 0, 0, 4, 0, 0, 5], ..Slot::default() };
        (0..3).for_each(|_| tally(&mut counted, &slot));
        assert_eq!((counted.delivered, counted.duplicates, counted.dropped), (6, 3, [3, 0, 0, 12, 0, 0, 15]));
    }
}
