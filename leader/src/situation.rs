//! What a leader knows when it decides.

use crate::ledger::Ledger;
use crate::member::Member;
use crate::obstacles::Obstacles;
use crate::params::PlannerParams;
use crate::silent::Silent;
use crate::tuning::MAX_ROLLOUT_DRONES;
use skein_protocol::{Ballot, DroneId, GroupId, ObstacleId, SimTime};

/// What a leader knows when it decides: a read-only view, made anew for each decision.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Situation<'a> {
    /// Parameters of the mission.
    pub(crate) params: &'a PlannerParams,
    /// The current time.
    pub(crate) now: SimTime,
    /// The leader's term.
    pub(crate) ballot: Ballot,
    /// The group that it leads.
    pub(crate) scope: GroupId,
    /// The living members of that group, the leader included, by id.
    pub(crate) members: &'a [Member],
    /// Living drones of other groups, by id.
    pub(crate) others: &'a [Member],
    /// How long a message takes to arrive, s.
    pub(crate) delay_s: f64,
    /// Whether some drones do not hear each other, so that messages are passed on.
    pub(crate) wide: bool,
    /// Drones that are not heard any more.
    pub(crate) silent: &'a [Silent],
    /// Known obstacles.
    pub(crate) obstacles: &'a Obstacles,
    /// What was planned so far.
    pub(crate) ledger: &'a Ledger,
}

impl Situation<'_> {
    /// The abscissa past which a set does not matter any more, m.
    pub(crate) fn exit_x_m(&self, set: &[ObstacleId]) -> f64 {
        self.obstacles.exit_x_m(set, self.params.routes.planning_distance_m)
    }

    /// Drones of other groups that still have to pass a set.
    pub(crate) fn others_before(&self, set: &[ObstacleId]) -> Vec<DroneId> {
        let exit_x_m = self.exit_x_m(set);
        let before = |m: &&Member| !m.settled && !self.obstacles.is_past(m.id, m.position.x, set, exit_x_m);
        self.others.iter().filter(before).map(|m| m.id).collect()
    }

    /// Whether the living drones are few enough to be simulated.
    pub(crate) fn is_within_rollout(&self) -> bool {
        self.members.len() + self.others.len() <= MAX_ROLLOUT_DRONES
    }

    /// Whether one of these obstacles was planned for before.
    pub(crate) fn was_planned(&self, set: &[ObstacleId]) -> bool {
        self.ledger.sets().iter().any(|planned| planned.ids.iter().any(|id| set.contains(id)))
    }
}
