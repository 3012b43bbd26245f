//! An obstacle set that is being passed.

use crate::roster::Roster;
use crate::routes::Routes;
use crate::set_place::SetPlace;
use crate::tuning::CROWD_DRONES;
use skein_protocol::{GroupId, ObstacleId, PlanStamp, SimTime};

/// An obstacle set that is being passed: its routes, and which drone flies which.
#[derive(Clone, Debug)]
pub struct PlannedSet {
    /// Its obstacles, ascending.
    pub ids: Vec<ObstacleId>,
    /// Its short name: [`skein_protocol::payload::set_tag`].
    pub tag: u32,
    /// The plan that gave the assignments.
    pub stamp: PlanStamp,
    /// When that plan was made.
    pub made: SimTime,
    /// Number of drones that the plan is for.
    pub members: u32,
    /// The group that the plan is for.
    pub scope: GroupId,
    /// The routes past the set.
    pub routes: Routes,
    /// Where the drones fly, as far as heard.
    pub parts: Roster<SetPlace>,
}

impl PlannedSet {
    /// Whether the drones on a route pass side by side, as a crowd, instead of one behind another: they are many, as far as heard, and there
    /// is room beside the route.
    #[must_use]
    pub fn passes_as_crowd(&self, route: usize) -> bool {
        let ranks = self.parts.iter().filter(|part| usize::from(part.route) == route).map(|part| part.rank);
        !self.routes.is_between(route) && ranks.max().is_some_and(|last| usize::from(last) + 1 >= CROWD_DRONES)
    }
}
