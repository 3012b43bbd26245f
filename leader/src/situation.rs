//! What a leader knows when it decides.

use crate::ledger::Ledger;
use crate::member::Member;
use crate::obstacles::Obstacles;
use skein_protocol::{Ballot, GroupId, SimTime, Vec2};

/// What a leader knows when it decides: a read-only view, made anew for each decision.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The current time.
    pub now: SimTime,
    /// The leader's term.
    pub ballot: Ballot,
    /// The group that it leads.
    pub scope: GroupId,
    /// The living members of that group, the leader included, by id.
    pub members: &'a [Member],
    /// Living drones of other groups, by id.
    pub others: &'a [Member],
    /// How long a message takes to arrive, s.
    pub delay_s: f64,
    /// Where silent drones may hover, world frame, m.
    pub silent: &'a [Vec2],
    /// Known obstacles.
    pub obstacles: &'a Obstacles,
    /// What was planned so far.
    pub ledger: &'a Ledger,
}
