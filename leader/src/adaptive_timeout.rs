//! How regularly something comes in, and how long its silence is no news yet: an estimate of loss and jitter.

use skein_protocol::SimTime;

/// Weight of a new gap in the running means, once there are many.
const NOVELTY: f64 = 0.02;
/// Deviation that a link is thought to have before it is known, as a part of the first gap: that of a link which loses
/// every other sign.
const DOUBT: f64 = 1.0;
/// So many mean deviations above the mean gap a silence is no chance any more: at 50 % loss that are 24 periods, and
/// one silence in ten million is as long.
const PATIENCE: f64 = 22.0;
/// Nobody is waited for longer than so many time-outs: then it is as good as gone.
const MAX_TIMEOUTS: f64 = 12.0;

/// The gaps between the signs of one source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AdaptiveTimeout {
    last: SimTime,
    /// Gaps counted, as far as it matters for the weight of the next.
    gaps: u32,
    mean_s: f64,
    /// Mean distance of a gap from the mean, s.
    deviation_s: f64,
}

impl AdaptiveTimeout {
    /// A source that was heard for the first time.
    pub fn new(now: SimTime) -> Self {
        Self { last: now, ..Self::default() }
    }

    /// A source that is to be heard once in so long, s, if the link is good; which is doubted until it shows.
    pub fn expecting(now: SimTime, period_s: f64) -> Self {
        Self { last: now, gaps: 1, mean_s: period_s, deviation_s: DOUBT * period_s }
    }

    /// When the last sign came in.
    pub fn last(&self) -> SimTime {
        self.last
    }

    /// A sign of another source on the same air: the time since the last one of the former is no gap.
    pub fn turn(&mut self, now: SimTime) {
        self.last = now;
    }

    /// A further sign. Several at once count as one, and so does whatever comes sooner than `shortest_s` after the last
    /// one: it says nothing about how late the next may be. A silence of more than `longest_s` was no gap but an absence.
    pub fn hear(&mut self, now: SimTime, shortest_s: f64, longest_s: f64) {
        let gap_s = now.since(self.last);
        if gap_s < shortest_s {
            return;
        }
        self.last = now;
        if gap_s <= 0.0 || gap_s > longest_s {
            return;
        }
        if self.gaps == 0 {
            (self.mean_s, self.deviation_s) = (gap_s, gap_s * DOUBT);
        }
        self.gaps = self.gaps.saturating_add(1);
        let weight = NOVELTY.max(1.0 / f64::from(self.gaps));
        // One more than there were: the doubt counts as a gap.
        let novelty = NOVELTY.max(1.0 / (f64::from(self.gaps) + 1.0));
        self.deviation_s += novelty * ((gap_s - self.mean_s).abs() - self.deviation_s);
        self.mean_s += weight * (gap_s - self.mean_s);
    }

    /// How long a silence is no news, s: `base_s`, or more if gaps are long or differ.
    pub fn patience_s(&self, base_s: f64) -> f64 {
        (self.mean_s + PATIENCE * self.deviation_s).clamp(base_s, MAX_TIMEOUTS * base_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(gaps_s: impl Iterator<Item = f64>) -> AdaptiveTimeout {
        let mut adaptive_timeout = AdaptiveTimeout::new(SimTime::ZERO);
        gaps_s.fold(SimTime::ZERO, |now, gap_s| {
            adaptive_timeout.hear(now.after(gap_s), 0.0, f64::INFINITY);
            now.after(gap_s)
        });
        adaptive_timeout
    }

    #[test]
    fn regular_signs_are_missed_soon_and_rare_ones_late() {
        assert!(after(std::iter::repeat_n(0.02, 400)).patience_s(0.06) < 0.0601);
        // Of two signs one is lost, as a coin falls: gaps of one period in two, of two in four, of three in eight.
        let coin = |i: u32| 0.02 * f64::from(1 + i.wrapping_mul(0x9e37_79b9).leading_zeros());
        let patience_s = after((0..4000).map(coin)).patience_s(0.06);
        assert!((0.4..0.56).contains(&patience_s), "{patience_s}");
    }

    #[test]
    fn signs_between_the_beats_are_no_irregularity() {
        let (mut adaptive_timeout, mut now) = (AdaptiveTimeout::new(SimTime::ZERO), SimTime::ZERO);
        for beat in 0..400 {
            now = now.after(0.01);
            // Every fifth beat something else is said in between.
            if beat % 5 == 0 {
                adaptive_timeout.hear(now, 0.015, f64::INFINITY);
            }
            now = now.after(0.01);
            adaptive_timeout.hear(now, 0.015, f64::INFINITY);
        }
        assert!(adaptive_timeout.patience_s(0.06) < 0.0601, "{adaptive_timeout:?}");
    }

    #[test]
    fn an_absence_and_a_change_of_the_source_are_no_gaps() {
        let regular = after(std::iter::repeat_n(0.02, 400));
        let (mut absent, mut turned) = (regular, regular);
        absent.hear(SimTime::from_secs(20.0), 0.0, 0.06);
        turned.turn(SimTime::from_secs(20.0));
        assert_eq!(absent.patience_s(0.06), regular.patience_s(0.06));
        assert_eq!(turned, absent);
    }
}
