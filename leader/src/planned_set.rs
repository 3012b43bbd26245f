//! An obstacle set that is being passed.

use crate::roster::Roster;
use crate::routes::Routes;
use crate::set_place::SetPlace;
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
