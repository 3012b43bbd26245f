//! What a rollout needs of a pilot.

use skein_leader::plan_bundle::PlanBundle;
use skein_pilot::Pilot;
use skein_protocol::payload::{Assignment, Plan};
use skein_protocol::{DroneId, PlanStamp, SimTime, Vec2};

/// A pilot that can be simulated: it can be cloned, given a plan, and asked what it makes of the plan.
pub trait RolloutPilot: Pilot + Clone {
    /// The drone that it flies.
    fn id(&self) -> DroneId;

    /// Adopts a plan at once, as if it had heard every message of the plan.
    fn obey(&mut self, now: SimTime, bundle: PlanBundle);

    /// Stamp of the plan that it obeys; the default, lower than any, before the first.
    fn stamp(&self) -> PlanStamp;

    /// The newest stamp that it has heard of, whether it can obey that plan yet or not.
    fn newest_stamp(&self) -> PlanStamp;

    /// The plan that it obeys.
    fn plan(&self) -> Option<&Plan>;

    /// Its assignment past the obstacle set with this tag, without the leader of its group; `None` if it has none.
    fn part_past(&self, set: u32) -> Option<Assignment>;

    /// Its assignment in a plan past an obstacle set that gives it none, being at `position` (world frame, m): the one that it
    /// has for the set, or else the shortest route.
    fn own_part(&self, plan: &Plan, position: Vec2) -> Assignment;

    /// Its slot in that plan, relative to the plan's anchor, m.
    fn slot(&self) -> Option<Vec2>;

    /// Abscissa of the last gate on its way, m; negative infinity if it has none to pass.
    fn last_gate_x_m(&self) -> f64;
}
