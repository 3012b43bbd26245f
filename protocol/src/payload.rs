//! Layouts of the message payloads: plain data of fixed size, versioned by [`VERSION`].
//!
//! A payload is read from shared memory only through [`crate::Message::decode`] or [`crate::MessageRef::read`], which
//! check every field. Kinds and phases are integers here and enums everywhere else: see [`crate::wire`].

use crate::Vec2;
use crate::ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
use crate::shape::ConvexShape;
use crate::time::SimTime;
use crate::wire::{ArrivalsKind, LeadershipKind, Phase};
use bytemuck::{Pod, Zeroable};
use std::fmt;

/// Version of all layouts in this module. A frame of another version is refused.
pub const VERSION: u16 = 2;

/// Maximum number of obstacles in one set.
pub const MAX_SET: usize = 32;

/// Maximum number of routes past one set: one more than obstacles.
pub const MAX_ROUTES: usize = MAX_SET + 1;

/// Number of sets for which a beacon can report a place: the one the drone is passing and the next.
pub const MAX_PLACES: usize = 2;

/// [`Pose::flags`]: the drone believes that it leads, in the term [`Pose::term`].
pub const POSE_LEADS: u32 = 1;
/// [`Pose::flags`]: a sensor of the drone is broken; another drone should lead if possible.
pub const POSE_IMPAIRED: u32 = 2;

/// [`Assignment::route`] of a drone that has no obstacle to pass.
pub const NO_ROUTE: u16 = u16::MAX;

/// A place in the queue past one obstacle set.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct QueuePlace {
    /// Length of the path that remains to the set's gate, m; negative once past it.
    pub remaining_m: f64,
    /// The obstacle set, by its [`set_tag`]; 0 in an unused entry.
    pub set: u32,
    /// Route past the set, 0 = rightmost.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
}

impl QueuePlace {
    /// Rank of a drone without an assigned place: behind all others.
    pub const NO_RANK: u16 = u16::MAX;
}

/// A short name of an obstacle set; never 0. `set` holds the ids in ascending order.
#[must_use]
pub fn set_tag(set: &[ObstacleId]) -> u32 {
    (xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(set)) as u32).max(1)
}

/// The 10 Hz beacon of a drone: its state and the plan it obeys.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Pose {
    /// Time of the state.
    pub stamp: SimTime,
    /// World frame, m.
    pub position_m: [f64; 2],
    /// World frame, m/s.
    pub velocity_mps: [f64; 2],
    /// The drone's places in queues, nearest set first.
    pub queue: [QueuePlace; MAX_PLACES],
    /// The plan it obeys.
    pub obeyed: PlanStamp,
    /// Its group.
    pub group: GroupId,
    /// The term it obeys, or in which it leads.
    pub term: Ballot,
    /// Incarnation of its process.
    pub incarnation: u32,
    /// [`POSE_LEADS`], [`POSE_IMPAIRED`].
    pub flags: u32,
    /// Always 0.
    pub reserved: u32,
}

impl Pose {
    /// Whether the drone believes that it leads.
    #[must_use]
    pub fn leads(&self) -> bool {
        self.flags & POSE_LEADS != 0
    }

    /// Whether a sensor of the drone is broken.
    #[must_use]
    pub fn is_impaired(&self) -> bool {
        self.flags & POSE_IMPAIRED != 0
    }
}

/// An obstacle that a drone has sensed, for the drones that have not.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Obstacle {
    /// The obstacle's outline, world frame.
    pub shape: ConvexShape,
    /// The world's number of the obstacle.
    pub id: ObstacleId,
    /// The drone that sensed it first, as far as the sender knows.
    pub witness: DroneId,
}

/// A message about leadership: a claim, a heartbeat, a pre-vote, its rejection, or a transfer.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Leadership {
    /// Time of sending. In a pre-vote and in its rejection: when the source last heard of the leader.
    pub stamp: SimTime,
    /// The term.
    pub ballot: Ballot,
    /// A [`LeadershipKind`], see [`Leadership::kind`].
    pub kind: u32,
    /// The group that the term is about.
    pub group: GroupId,
    /// Number of the last plan made in this term; 0 if none.
    pub epoch: u32,
    /// The drone that is asked to take over; [`DroneId::NONE`] unless this is a transfer.
    pub heir: DroneId,
}

impl Leadership {
    /// What the message says. Decoding refuses unknown numbers; in a payload that was never decoded, such a number
    /// counts as a heartbeat.
    #[must_use]
    pub fn kind(&self) -> LeadershipKind {
        LeadershipKind::from_wire(self.kind).unwrap_or(LeadershipKind::Heartbeat)
    }
}

impl fmt::Debug for Leadership {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Leadership")
            .field("stamp", &self.stamp)
            .field("ballot", &self.ballot)
            .field("kind", &self.kind())
            .field("group", &self.group)
            .field("epoch", &self.epoch)
            .field("heir", &self.heir)
            .finish()
    }
}

/// What a leader has decided for its group.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Plan {
    /// The time for which the anchor holds; receivers extrapolate by its velocity.
    pub stamp: SimTime,
    /// Term and number.
    pub id: PlanStamp,
    /// The group that the plan is for.
    pub group: GroupId,
    /// A [`Phase`], see [`Plan::phase`].
    pub phase: u32,
    /// Number of drones in the plan; the target shape is the formation of that many.
    pub members: u32,
    /// Position of the formation's front slot at `stamp`, world frame, m.
    pub anchor_m: [f64; 2],
    /// Velocity of the front slot, m/s.
    pub anchor_mps: [f64; 2],
    /// Abscissa at which the anchor stops, m; infinity if it never stops.
    pub anchor_stop_x_m: f64,
    /// Forecast: seconds from `stamp` until the last drone passes the gate; NaN unless avoiding.
    pub predicted_s: f64,
    /// Number of groupings that were simulated before the choice.
    pub candidates: u32,
    /// Number of routes past the set; 0 unless avoiding.
    pub routes: u32,
    /// Number of obstacles in use below, at most [`MAX_SET`].
    pub set_count: u32,
    /// The obstacle set, in ascending order.
    pub set: [ObstacleId; MAX_SET],
    /// Always 0.
    pub reserved: u32,
}

impl Plan {
    /// What the plan tells its group to do. Decoding refuses unknown numbers; in a payload that was never decoded, such
    /// a number counts as [`Phase::Cruise`].
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::from_wire(self.phase).unwrap_or_default()
    }

    /// Position (world frame, m) and velocity (m/s) of the anchor at `now`. The anchor moves on from its stamp until it
    /// reaches the abscissa where it stops.
    #[must_use]
    pub fn anchor_at(&self, now: SimTime) -> (Vec2, Vec2) {
        let (start, velocity) = (Vec2::from(self.anchor_m), Vec2::from(self.anchor_mps));
        let here = start + velocity * now.since(self.stamp);
        if velocity.x > 0.0 && here.x >= self.anchor_stop_x_m {
            return (Vec2::new(self.anchor_stop_x_m.max(start.x), here.y), Vec2::zeros());
        }
        (here, velocity)
    }
}

impl fmt::Debug for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Plan")
            .field("stamp", &self.stamp)
            .field("id", &self.id)
            .field("group", &self.group)
            .field("phase", &self.phase())
            .field("members", &self.members)
            .field("anchor_m", &self.anchor_m)
            .field("anchor_mps", &self.anchor_mps)
            .field("anchor_stop_x_m", &self.anchor_stop_x_m)
            .field("predicted_s", &self.predicted_s)
            .field("candidates", &self.candidates)
            .field("routes", &self.routes)
            .field("set_count", &self.set_count)
            .field("set", &self.set)
            .field("reserved", &self.reserved)
            .finish()
    }
}

/// One drone's part in a plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Assignment {
    /// The plan that it belongs to.
    pub id: PlanStamp,
    /// The group that the plan is for.
    pub scope: GroupId,
    /// The drone's group under this plan: the scope, or a group split from it.
    pub group: GroupId,
    /// The drone that the part is for.
    pub drone: DroneId,
    /// Leader of the drone's group.
    pub leader: DroneId,
    /// The drone's slot, relative to the anchor, m.
    pub slot_m: [f64; 2],
    /// Free-flight time to the gate when the plan was made, s; 0 unless avoiding. The queue is in this order.
    pub arrival_s: f64,
    /// Route, 0 = rightmost; [`NO_ROUTE`] unless avoiding.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
    /// Always 0.
    pub reserved: u32,
}

/// When one member of the source's group can be at the gate of an obstacle set. Leaders of groups that have the same set
/// ahead exchange these rows, and each splits the union of all rows.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Arrivals {
    /// When the row was made.
    pub stamp: SimTime,
    /// The source's term.
    pub ballot: Ballot,
    /// The member.
    pub drone: DroneId,
    /// The group that the source leads.
    pub group: GroupId,
    /// Short name of the set: [`set_tag`].
    pub set: u32,
    /// Number of routes in use below, from right to left, at most [`MAX_ROUTES`].
    pub routes: u32,
    /// An [`ArrivalsKind`], see [`Arrivals::kind`].
    pub kind: u32,
    /// For each route: seconds from the stamp to the gate in free flight; infinite if the drone cannot take the route,
    /// negative if it is past the gate.
    pub gate_s: [f32; MAX_ROUTES],
}

impl Arrivals {
    /// What the message is for. Decoding refuses unknown numbers; in a payload that was never decoded, such a number
    /// counts as [`ArrivalsKind::Report`].
    #[must_use]
    pub fn kind(&self) -> ArrivalsKind {
        ArrivalsKind::from_wire(self.kind).unwrap_or_default()
    }
}

impl fmt::Debug for Arrivals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Arrivals")
            .field("stamp", &self.stamp)
            .field("ballot", &self.ballot)
            .field("drone", &self.drone)
            .field("group", &self.group)
            .field("set", &self.set)
            .field("routes", &self.routes)
            .field("kind", &self.kind())
            .field("gate_s", &self.gate_s)
            .finish()
    }
}

/// The source is past these obstacles: beyond the rear edge of the set by the planning distance.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Passed {
    /// Time of sending.
    pub stamp: SimTime,
    /// Number of obstacles in use below, at most [`MAX_SET`].
    pub set_count: u32,
    /// The obstacles, in ascending order.
    pub set: [ObstacleId; MAX_SET],
    /// Always 0.
    pub reserved: u32,
}
