//! Bounds the rate at which a leader plans anew for one obstacle set. An assignment needs time to arrive, and the members'
//! beacons need time to show it. A plan that changes faster than that is never obeyed.

use crate::member::Member;
use crate::situation::Situation;
use crate::tuning::{MAX_PLAN_DOUBLINGS, PLAN_INTERVAL_S};
use skein_protocol::{Ballot, DroneId, ObstacleId, SimTime};

/// The last plan of a leader for an obstacle set.
#[derive(Clone, Debug, PartialEq)]
struct Made {
    at: SimTime,
    ballot: Ballot,
    set: Vec<ObstacleId>,
    members: Vec<DroneId>,
    /// How often the same plan has been made anew for the same members.
    repeats: u32,
}

/// When a leader made its last plan, and for whom.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PlanPace {
    made: Option<Made>,
}

impl PlanPace {
    /// Whether the leader may plan for a set now. The wait since its last plan for the same set doubles as long as the members
    /// stay the same.
    pub(crate) fn allows(&self, s: &Situation<'_>, set: &[ObstacleId]) -> bool {
        self.same(s, set).is_none_or(|made| {
            let repeats = if made.is_for(s.members) { made.repeats } else { 0 };
            let wait_s = (PLAN_INTERVAL_S + 2.0 * s.delay_s) * f64::from(1_u32 << repeats);
            s.now.since(made.at) >= wait_s
        })
    }

    /// Notes that the leader plans for a set now.
    pub(crate) fn note(&mut self, s: &Situation<'_>, set: &[ObstacleId]) {
        let again = self.same(s, set).filter(|made| made.is_for(s.members));
        let repeats = again.map_or(0, |made| (made.repeats + 1).min(MAX_PLAN_DOUBLINGS));
        let members = s.members.iter().map(|member| member.id).collect();
        self.made = Some(Made { at: s.now, ballot: s.ballot, set: set.to_vec(), members, repeats });
    }

    fn same(&self, s: &Situation<'_>, set: &[ObstacleId]) -> Option<&Made> {
        self.made.as_ref().filter(|made| made.ballot == s.ballot && made.set == set)
    }
}

impl Made {
    fn is_for(&self, members: &[Member]) -> bool {
        self.members.iter().eq(members.iter().map(|member| &member.id))
    }
}
