//! The course of one election.

use super::swarm::Swarm;
use super::trial::{Elected, Trial};
use skein_scenario::Scenario;

/// A swarm is watched for so long after it has one leader, s.
const WATCH_S: f64 = 10.0;

impl Trial {
    /// Runs until there is one leader, or this time is over. `None` if interrupted.
    pub(super) fn run(self, scenario: &Scenario, limit_s: f64, stopped: &impl Fn() -> bool) -> Option<Elected> {
        let mut swarm = Swarm::new(scenario, self);
        let mut is_united = false;
        while !is_united && swarm.now_s() < limit_s {
            swarm.step();
            is_united = swarm.is_united();
            if stopped() {
                return None;
            }
        }
        let time_s = is_united.then(|| swarm.now_s());
        let (frames, terms) = (swarm.frames() as f64 / f64::from(self.drones), swarm.terms());
        let false_leaders = swarm.false_leaders();
        let (bytes, hops) = (swarm.bytes(), swarm.hops());
        let end_s = swarm.now_s() + WATCH_S;
        while is_united && swarm.now_s() < end_s {
            swarm.step();
            if stopped() {
                return None;
            }
        }
        let watched = swarm.bytes() - bytes;
        let bytes_per_s = watched as f64 / (swarm.living().max(1) as f64 * WATCH_S);
        Some(Elected { time_s, frames, false_leaders, later: swarm.terms() - terms, bytes_per_s, hops })
    }
}
