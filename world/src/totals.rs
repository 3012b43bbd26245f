//! Counters of a whole mission.

use skein_protocol::record::{Spread, Totals};
use skein_protocol::slot::{LinkStats, STAT_BINS, Slot};

/// The totals of the world's own counters; `stats` are those of all radios together, `dt_s` is the width of a bin.
pub(crate) fn close(counted: &Totals, stats: &LinkStats, dt_s: f64, wall_s: f64) -> Totals {
    Totals {
        delay_s: spread(&stats.delay_bins, stats.delay_max, dt_s),
        age_s: spread(&stats.age_bins, stats.age_max, dt_s),
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

/// A histogram of ticks as seconds. The last bin holds all that is longer too: it counts as the maximum.
fn spread(bins: &[u32; STAT_BINS], max: u64, dt_s: f64) -> Spread {
    let count: u64 = bins.iter().map(|&n| u64::from(n)).sum();
    if count == 0 {
        return Spread::default();
    }
    let ticks = |bin: usize| if bin + 1 == STAT_BINS { max as f64 } else { bin as f64 };
    let mean = bins.iter().enumerate().map(|(bin, &n)| ticks(bin) * f64::from(n)).sum::<f64>() / count as f64;
    let quantile = |share: f64| {
        let rank = (share * count as f64).ceil() as u64;
        let mut seen = 0;
        let reached = bins.iter().position(|&n| {
            seen += u64::from(n);
            seen >= rank
        });
        ticks(reached.unwrap_or(STAT_BINS - 1)) * dt_s
    };
    Spread {
        mean: Some(mean * dt_s),
        p50: Some(quantile(0.5)),
        p99: Some(quantile(0.99)),
        max: Some(max as f64 * dt_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_counted_has_no_spread() {
        let totals = close(&Totals::default(), &LinkStats::default(), 0.02, 1.5);
        assert_eq!((totals.delay_s, totals.wall_s), (Spread::default(), 1.5));
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
