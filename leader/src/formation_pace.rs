//! Bounds the rate at which a leader assigns the slots of a formation anew because its members have changed. Where drones are heard of
//! only now and then, some seem to come and go, and each change would move hundreds of drones.

use crate::situation::Situation;
use crate::tuning::{MAX_PLAN_DOUBLINGS, PLAN_INTERVAL_S};
use skein_protocol::{Ballot, SimTime};

/// When a leader last assigned slots, and how many times in quick succession.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FormationPace {
    last: Option<(Ballot, SimTime)>,
    doublings: u32,
}

impl FormationPace {
    /// Whether slots may be assigned anew. The first change in a while is never delayed. After that, the wait doubles with each change
    /// that comes as soon as it may.
    pub(crate) fn allows(&self, s: &Situation<'_>) -> bool {
        self.waited(s).is_none_or(|waits| waits >= 1.0)
    }

    /// Notes that slots are assigned now.
    pub(crate) fn note(&mut self, s: &Situation<'_>) {
        let soon = self.waited(s).is_some_and(|waits| waits < 2.0);
        self.doublings = if soon { (self.doublings + 1).min(MAX_PLAN_DOUBLINGS) } else { 0 };
        self.last = Some((s.ballot, s.now));
    }

    /// The time since this term's last assignment, in units of the wait that is due; `None` without one.
    fn waited(&self, s: &Situation<'_>) -> Option<f64> {
        let (_, last) = self.last.filter(|(ballot, _)| *ballot == s.ballot)?;
        let wait_s = (PLAN_INTERVAL_S + 2.0 * s.delay_s) * f64::from(1_u32 << self.doublings);
        Some(s.now.since(last) / wait_s)
    }
}
