//! Layouts of the messages' payloads: plain data, fixed size, versioned by [`VERSION`]. A field is read from shared
//! memory only through [`crate::Message::decode`], which checks it.

use crate::ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
use crate::shape::ConvexShape;
use crate::time::SimTime;
use bytemuck::{Pod, Zeroable};

/// Version of all layouts in this module. A frame of another version is refused.
pub const VERSION: u16 = 2;

/// Most obstacles of one set.
pub const MAX_SET: usize = 32;

/// Most routes past one set: one more than obstacles.
pub const MAX_ROUTES: usize = MAX_SET + 1;

/// [`Pose::flags`]: the drone believes it leads, in the term [`Pose::term`].
pub const POSE_LEADS: u32 = 1;
/// [`Pose::flags`]: a sensor of the drone is broken, and others should lead rather.
pub const POSE_IMPAIRED: u32 = 2;

/// A place in the queue past one obstacle set.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct QueuePlace {
    /// Length of the path still to fly to the set's gate, m; negative once past it.
    pub remaining_m: f64,
    /// Which set: [`set_tag`]; 0 in an unused entry.
    pub set: u32,
    /// Route past the set, 0 = rightmost.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
}

impl QueuePlace {
    /// The rank of a drone that nobody gave a place: behind all others.
    pub const NO_RANK: u16 = u16::MAX;
}

/// Sets that a beacon can tell a place for: the one a drone is passing and the next.
pub const MAX_PLACES: usize = 2;

/// A short name of an obstacle set; never 0. Ids ascending.
#[must_use]
pub fn set_tag(set: &[ObstacleId]) -> u32 {
    (xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(set)) as u32).max(1)
}

/// Where a drone is and what it obeys: the 10 Hz beacon.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Pose {
    /// When this was true.
    pub stamp: SimTime,
    /// World frame, m.
    pub position_m: [f64; 2],
    /// World frame, m/s.
    pub velocity_mps: [f64; 2],
    /// Its places in queues, the nearest set first.
    pub queue: [QueuePlace; MAX_PLACES],
    /// The plan it obeys.
    pub obeyed: PlanStamp,
    /// Its group.
    pub group: GroupId,
    /// The term it obeys, or leads in.
    pub term: Ballot,
    /// Of its process.
    pub incarnation: u32,
    /// [`POSE_LEADS`], [`POSE_IMPAIRED`].
    pub flags: u32,
    /// Always 0.
    pub reserved: u32,
}

/// An obstacle that somebody sensed, for those who cannot.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Obstacle {
    /// The obstacle's outline, world frame.
    pub shape: ConvexShape,
    /// The world's number for it.
    pub id: ObstacleId,
    /// Who sensed it first, as far as the sender knows.
    pub witness: DroneId,
}

/// [`Leadership::kind`]: the source wants to lead and asks who objects.
pub const LEADERSHIP_CLAIM: u32 = 1;
/// [`Leadership::kind`]: the source leads and is alive.
pub const LEADERSHIP_HEARTBEAT: u32 = 2;

/// [`Leadership::kind`]: the source misses the leader of this term and asks who has heard of it since the stamp.
pub const LEADERSHIP_PROBE: u32 = 3;
/// [`Leadership::kind`]: the source heard of this term's leader, at the stamp the last time: the answer to a probe.
pub const LEADERSHIP_OBJECTION: u32 = 4;
/// [`Leadership::kind`]: the source leads and asks the drone in [`Leadership::heir`] to take over.
pub const LEADERSHIP_YIELD: u32 = 5;

/// A claim to lead, a leader's heartbeat, and what is said about a leader that is missed or yields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Leadership {
    /// When it was said; of a probe and an objection, when its source last heard of the leader.
    pub stamp: SimTime,
    /// The term.
    pub ballot: Ballot,
    /// A `LEADERSHIP_…`.
    pub kind: u32,
    /// The group it is about.
    pub group: GroupId,
    /// Number of the last plan made in this term; 0 if none.
    pub epoch: u32,
    /// Who is asked to take over; [`DroneId::NONE`] unless yielding.
    pub heir: DroneId,
}

/// [`Plan::phase`]: fly in formation, the anchor moves on.
pub const PHASE_CRUISE: u32 = 0;
/// [`Plan::phase`]: go around the obstacle set, each by its route and rank.
pub const PHASE_AVOID: u32 = 1;
/// [`Plan::phase`]: take the slots of the target shape again.
pub const PHASE_REFORM: u32 = 2;

/// What a leader decided for its group.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Plan {
    /// The moment for which the anchor holds; receivers extrapolate by its velocity.
    pub stamp: SimTime,
    /// Term and number.
    pub id: PlanStamp,
    /// The group that is planned for.
    pub group: GroupId,
    /// [`PHASE_CRUISE`], [`PHASE_AVOID`] or [`PHASE_REFORM`].
    pub phase: u32,
    /// Number of drones planned for: the target shape is the formation of so many.
    pub members: u32,
    /// Where the formation's front slot is at `stamp`, world frame, m.
    pub anchor_m: [f64; 2],
    /// How the front slot moves, m/s.
    pub anchor_mps: [f64; 2],
    /// The anchor moves no further than this abscissa, m; infinity: never stops.
    pub anchor_stop_x_m: f64,
    /// Forecast: seconds from `stamp` until the last drone passes the gate; NaN unless avoiding.
    pub predicted_s: f64,
    /// Groupings that were simulated forward before the choice.
    pub candidates: u32,
    /// Routes past the set; 0 unless avoiding.
    pub routes: u32,
    /// Obstacles in use below, at most [`MAX_SET`], in ascending order.
    pub set_count: u32,
    /// The obstacle set.
    pub set: [ObstacleId; MAX_SET],
    /// Always 0.
    pub reserved: u32,
}

/// One drone's part in a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Assignment {
    /// The plan it belongs to.
    pub id: PlanStamp,
    /// The group that the plan is for.
    pub scope: GroupId,
    /// The group the drone is in under this plan: the scope or split from it.
    pub group: GroupId,
    /// Whom it is for.
    pub drone: DroneId,
    /// Who leads that group.
    pub leader: DroneId,
    /// Its slot, relative to the anchor, m.
    pub slot_m: [f64; 2],
    /// Free-flight time to the gate when the plan was made, s; 0 unless avoiding. Orders the queue.
    pub arrival_s: f64,
    /// Route, 0 = rightmost; [`NO_ROUTE`] unless avoiding.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
    /// Always 0.
    pub reserved: u32,
}

/// [`Assignment::route`] of a drone that has no obstacle to pass.
pub const NO_ROUTE: u16 = u16::MAX;

/// [`Arrivals::flags`]: the source waits for the rows of the other groups before it decides.
pub const ARRIVALS_ASK: u32 = 1;
/// [`Arrivals::flags`]: a decision of the one leader who thinks for several groups: the only route in use is the drone's.
pub const ARRIVALS_CHOSEN: u32 = 2;

/// When one member of the source's group can be at the gate of an obstacle set, for the leaders of the groups that have
/// the same set ahead: all of them split the union of the rows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Arrivals {
    /// When the row was made.
    pub stamp: SimTime,
    /// The source's term.
    pub ballot: Ballot,
    /// Whose row it is.
    pub drone: DroneId,
    /// The group that the source leads.
    pub group: GroupId,
    /// Short name of the set: [`set_tag`].
    pub set: u32,
    /// Routes in use below, from right to left, at most [`MAX_ROUTES`].
    pub routes: u32,
    /// [`ARRIVALS_ASK`], [`ARRIVALS_CHOSEN`].
    pub flags: u32,
    /// Along each route, seconds from the stamp to the gate in free flight; infinite: not that way; negative past it.
    pub gate_s: [f32; MAX_ROUTES],
}

/// The source is past these obstacles: beyond the rear edge and the planning distance.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Passed {
    /// When it was said.
    pub stamp: SimTime,
    /// Obstacles in use below.
    pub set_count: u32,
    /// The obstacles, ascending.
    pub set: [ObstacleId; MAX_SET],
    /// Always 0.
    pub reserved: u32,
}
