//! A time-out that adapts to the loss and jitter of a link: how long the silence of a source is not yet significant.

use crate::tuning::{GAP_WEIGHT, INITIAL_DEVIATION, MAX_TIMEOUTS, TIMEOUT_DEVIATIONS};
use skein_protocol::SimTime;

/// The gaps between the signs (messages) of one source. A drone of a large swarm keeps a thousand of these, so they are small.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AdaptiveTimeout {
    last: SimTime,
    /// Number of gaps so far.
    gaps: u32,
    mean_s: f64,
    /// Mean absolute deviation of the gaps, s.
    deviation_s: f64,
}

impl AdaptiveTimeout {
    /// A source that is heard for the first time `now`.
    pub(crate) fn new(now: SimTime) -> Self {
        Self { last: now, ..Self::default() }
    }

    /// A source that should be heard once per `period_s`. A great deviation is assumed until gaps are measured.
    pub(crate) fn expecting(now: SimTime, period_s: f64) -> Self {
        Self { last: now, gaps: 1, mean_s: period_s, deviation_s: INITIAL_DEVIATION * period_s }
    }

    /// When the last sign came in.
    pub(crate) fn last(&self) -> SimTime {
        self.last
    }

    /// Starts over with another source at the same distance: the time since the former source's last sign is not a gap.
    pub(crate) fn restart(&mut self, now: SimTime) {
        self.last = now;
    }

    /// Takes a further sign. A sign that comes less than `shortest_s` after the last one is ignored: it says nothing about
    /// how late the next one may be. A silence of more than `longest_s` is an absence and not a gap.
    pub(crate) fn hear(&mut self, now: SimTime, shortest_s: f64, longest_s: f64) {
        let gap_s = now.since(self.last);
        if gap_s < shortest_s {
            return;
        }
        self.last = now;
        if gap_s <= 0.0 || gap_s > longest_s {
            return;
        }
        if self.gaps == 0 {
            (self.mean_s, self.deviation_s) = (gap_s, gap_s * INITIAL_DEVIATION);
        }
        self.gaps = self.gaps.saturating_add(1);
        let gaps = f64::from(self.gaps);
        // The assumed deviation counts as one more gap.
        self.deviation_s += weight(gaps + 1.0) * ((gap_s - self.mean_s).abs() - self.deviation_s);
        self.mean_s += weight(gaps) * (gap_s - self.mean_s);
    }

    /// The longest silence that is not yet significant, s: `base_s`, or more if gaps are long or vary.
    pub(crate) fn timeout_s(&self, base_s: f64) -> f64 {
        let silence_s = self.mean_s + TIMEOUT_DEVIATIONS * self.deviation_s;
        if silence_s <= base_s {
            return base_s;
        }
        // Of fewer gaps, a single long one could make the mean longer than the base.
        let mean_s = if f64::from(self.gaps) >= MAX_TIMEOUTS { self.mean_s } else { 0.0 };
        silence_s.min(MAX_TIMEOUTS * base_s.max(mean_s))
    }
}

/// Weight of the newest of so many gaps in their running means: the means of the first ones count all alike.
fn weight(gaps: f64) -> f64 {
    if gaps * GAP_WEIGHT >= 1.0 { GAP_WEIGHT } else { 1.0 / gaps }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(gaps_s: impl Iterator<Item = f64>) -> AdaptiveTimeout {
        let mut timeout = AdaptiveTimeout::new(SimTime::ZERO);
        gaps_s.fold(SimTime::ZERO, |now, gap_s| {
            timeout.hear(now.after(gap_s), 0.0, f64::INFINITY);
            now.after(gap_s)
        });
        timeout
    }

    #[test]
    fn the_timeout_is_short_for_regular_signs_and_long_for_lossy_links() {
        assert!(after(std::iter::repeat_n(0.02, 400)).timeout_s(0.06) < 0.0601);
        // Half of the signs are lost at random: half of the gaps are one period, a quarter two, an eighth three.
        let coin = |i: u32| 0.02 * f64::from(1 + i.wrapping_mul(0x9e37_79b9).leading_zeros());
        let lossy_s = after((0..4000).map(coin)).timeout_s(0.06);
        assert!((0.4..0.56).contains(&lossy_s), "{lossy_s}");
    }

    #[test]
    fn signs_between_two_beats_do_not_count_as_jitter() {
        let (mut timeout, mut now) = (AdaptiveTimeout::new(SimTime::ZERO), SimTime::ZERO);
        for beat in 0..400 {
            now = now.after(0.01);
            // Between every fifth pair of beats there is another message.
            if beat % 5 == 0 {
                timeout.hear(now, 0.015, f64::INFINITY);
            }
            now = now.after(0.01);
            timeout.hear(now, 0.015, f64::INFINITY);
        }
        assert!(timeout.timeout_s(0.06) < 0.0601, "{timeout:?}");
    }

    #[test]
    fn one_long_gap_among_few_does_not_raise_the_bound() {
        let long = |regular: usize| after(std::iter::repeat_n(0.02, regular).chain([0.7])).timeout_s(0.06);
        assert!(long(1) <= MAX_TIMEOUTS * 0.06 + 1e-9, "{}", long(1));
        assert!(long(400) <= MAX_TIMEOUTS * 0.06 + 1e-9, "{}", long(400));
        // A source that is always heard rarely is given longer.
        assert!(after(std::iter::repeat_n(0.5, 400)).timeout_s(0.06) > 0.49);
    }

    #[test]
    fn the_first_gaps_count_alike_and_later_ones_by_a_fixed_weight() {
        for gaps in (1..300).map(f64::from) {
            assert_eq!(weight(gaps), GAP_WEIGHT.max(1.0 / gaps), "{gaps}");
        }
    }

    #[test]
    fn an_absence_and_a_change_of_the_source_are_not_gaps() {
        let regular = after(std::iter::repeat_n(0.02, 400));
        let (mut absent, mut restarted) = (regular, regular);
        absent.hear(SimTime::from_secs(20.0), 0.0, 0.06);
        restarted.restart(SimTime::from_secs(20.0));
        assert_eq!(absent.timeout_s(0.06), regular.timeout_s(0.06));
        assert_eq!(restarted, absent);
    }
}
