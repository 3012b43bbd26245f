//! When a peer was heard, and whether it still counts as living.

use crate::adaptive_timeout::AdaptiveTimeout;
use crate::tuning::{MAX_TIMEOUTS, RELAYED_TIMEOUTS};
use skein_protocol::SimTime;

/// Before every time of a mission.
const NEVER: SimTime = SimTime(i64::MIN / 2);

/// More than times in nanoseconds lose by rounding, s.
const ROUNDING_S: f64 = 1e-6;

/// Time-outs of regular sources, s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timeouts {
    /// Of a drone that is heard itself.
    pub(crate) direct_s: f64,
    /// Of one whose state is passed on.
    pub(crate) relayed_s: f64,
}

impl Timeouts {
    /// What is assumed of the gaps between the beacons of a peer. Those that are passed on come rarely.
    fn prior(&self, now: SimTime, direct: bool) -> AdaptiveTimeout {
        if direct { AdaptiveTimeout::new(now) } else { AdaptiveTimeout::expecting(now, self.relayed_s) }
    }

    /// Until when a peer that is heard itself at this time certainly counts as heard so.
    pub(crate) fn certain_until(&self, heard: SimTime) -> SimTime {
        heard + ((self.direct_s - ROUNDING_S) * 1e9) as i64
    }
}

/// When one peer was heard. A drone of a large swarm keeps a thousand of these, so they are small.
#[repr(C, packed(4))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heard {
    /// Of its beacons, by their times of arrival.
    timeout: AdaptiveTimeout,
    /// When it was last heard without a relay; [`NEVER`] if it never was.
    direct: SimTime,
}

impl Heard {
    /// A peer that is heard for the first time. `direct`: without a relay.
    pub(crate) fn first(now: SimTime, direct: bool, base: Timeouts) -> Self {
        Self { timeout: base.prior(now, direct), direct: if direct { now } else { NEVER } }
    }

    /// Notes that it is heard again. `direct`: without a relay.
    #[inline]
    pub(crate) fn again(&mut self, now: SimTime, direct: bool, base: Timeouts) {
        let shortest_s = if self.is_relayed() { RELAYED_TIMEOUTS * base.relayed_s } else { base.direct_s };
        // No absence is shorter than that. So a gap up to it is none, and the longest gap need not be computed.
        let is_short = now.since(self.timeout.last()) <= shortest_s;
        let longest_s = if is_short { shortest_s } else { self.absence_s(base) };
        if direct {
            self.direct = now;
        } else if !self.is_relayed() {
            self.timeout = base.prior(now, false);
        }
        self.timeout.hear(now, 0.0, longest_s);
    }

    /// When it was last heard without a relay; before every time of a mission if it never was.
    #[inline]
    pub(crate) fn direct(&self) -> SimTime {
        self.direct
    }

    /// The longest silence that is not yet significant, s: never more than [`MAX_TIMEOUTS`], however rarely it was heard, because a dead
    /// drone must not count for long. `base_s`: time-out of a regular source. It is not kept, because a drone has a thousand peers.
    #[inline]
    fn silence_s(&self, base_s: f64) -> f64 {
        self.timeout.timeout_s(base_s).min(MAX_TIMEOUTS * base_s)
    }

    /// The longest time without word of it after which it still counts as living, s. Where others pass its state on, it comes once per
    /// some time-outs at best, and at times not at all.
    #[inline]
    fn absence_s(&self, base: Timeouts) -> f64 {
        if self.is_relayed() {
            self.silence_s(base.relayed_s).max(RELAYED_TIMEOUTS * base.relayed_s)
        } else {
            self.silence_s(base.direct_s)
        }
    }

    /// Whether the last word of it was passed on.
    #[inline]
    fn is_relayed(&self) -> bool {
        self.timeout.last() > self.direct()
    }

    /// Whether it is not silent for too long.
    pub(crate) fn lives(&self, now: SimTime, base: Timeouts) -> bool {
        now.since(self.timeout.last()) <= self.absence_s(base)
    }

    /// Whether it counts as heard without a relay.
    pub(crate) fn is_direct(&self, now: SimTime, base: Timeouts) -> bool {
        now.since(self.direct) <= self.silence_s(base.direct_s)
    }

    /// Whether it certainly does not count as heard without a relay: no silence is significant only after longer.
    pub(crate) fn is_far(&self, now: SimTime, base: Timeouts) -> bool {
        now.since(self.direct) > MAX_TIMEOUTS * base.direct_s
    }

    /// A moment until which it certainly lives.
    #[inline]
    pub(crate) fn lives_until(&self, base: Timeouts) -> SimTime {
        self.timeout.last() + ((self.absence_s(base) - ROUNDING_S) * 1e9) as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// So a gap up to it is none, and what is left out for such a gap has no effect.
        #[test]
        fn no_absence_is_shorter_than_the_time_out(
            gaps in prop::collection::vec((0.0..5.0f64, any::<bool>()), 0..40),
            direct_s in 0.05..3.0f64,
            factor in 1.0..9.0f64,
        ) {
            let base = Timeouts { direct_s, relayed_s: factor * direct_s };
            let (mut now, mut heard) = (SimTime::ZERO, Heard::first(SimTime::ZERO, true, base));
            for (gap_s, direct) in gaps {
                let mut exact = heard;
                now = now.after(gap_s);
                let longest_s = exact.absence_s(base);
                let shortest_s = if heard.is_relayed() { RELAYED_TIMEOUTS * base.relayed_s } else { direct_s };
                prop_assert!(longest_s >= shortest_s, "{longest_s} s of {shortest_s}");
                heard.again(now, direct, base);
                if !direct && !exact.is_relayed() {
                    exact.timeout = base.prior(now, false);
                }
                exact.timeout.hear(now, 0.0, longest_s);
                prop_assert_eq!({ heard.timeout }, { exact.timeout });
            }
        }
    }
}
