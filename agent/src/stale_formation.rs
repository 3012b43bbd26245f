//! Recognises a formation that its leader has abandoned.

use crate::tuning::STALE_FORMATION_S;
use skein_leader::plan_bundle::PlanBundle;
use skein_protocol::{Ballot, Phase, SimTime};

/// Since when the drone has obeyed a formation of another term than that of its leader.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StaleFormation {
    since: Option<SimTime>,
}

impl StaleFormation {
    /// Whether the leader of `term` has made no new formation for [`STALE_FORMATION_S`] while the drone still obeys one of
    /// another term. Then the others are still on their way, and a drone that keeps its slot might obstruct them.
    pub(crate) fn is_stale(&mut self, now: SimTime, obeyed: Option<&PlanBundle>, term: Ballot) -> bool {
        let old = obeyed.is_some_and(|bundle| bundle.plan.phase() == Phase::Reform && bundle.plan.id.ballot != term);
        self.since = old.then(|| self.since.unwrap_or(now));
        self.since.is_some_and(|since| now.since(since) >= STALE_FORMATION_S)
    }
}
