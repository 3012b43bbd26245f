//! Layouts of the message payloads. They are plain data of fixed size and have one common version, [`VERSION`].
//!
//! A payload is read from shared memory only through [`crate::Message::decode`] or [`crate::MessageRef::read`], which
//! check every field. Kinds and phases are integers in payloads and enums in all other code: see [`crate::wire`].

use crate::Vec2;
use crate::course::Course;
use crate::ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
use crate::shape::ConvexShape;
use crate::space::horizontal;
use crate::time::SimTime;
use crate::wire::{ArrivalsKind, LeadershipKind, Phase};
use bytemuck::{Pod, Zeroable};
use std::fmt;

/// Version of all layouts in this module. A receiver rejects a frame of another version.
pub const VERSION: u16 = 7;

/// Maximum number of obstacles in one set.
pub const MAX_SET: usize = 32;

/// Maximum number of routes past one set: one more than the number of obstacles.
pub const MAX_ROUTES: usize = MAX_SET + 1;

/// Number of obstacle sets for which a beacon can report a place in the queue: the set that the drone is passing and
/// the next set.
pub const MAX_PLACES: usize = 2;

/// Maximum number of separators in one message.
pub const MAX_SEPARATORS: usize = 7;

/// [`Pose::flags`]: the drone believes that it leads, in the term [`Pose::term`].
pub const POSE_LEADS: u32 = 1;
/// [`Pose::flags`]: a sensor of the drone is broken; another drone should lead if possible.
pub const POSE_IMPAIRED: u32 = 2;
/// [`Pose::flags`]: the drone flies in a formation of the whole swarm, but has never reached the end of an obstacle that the formation's
/// plan names as passed.
pub const POSE_BEFORE: u32 = 4;

/// [`Assignment::route`] of a drone that has no obstacle to pass.
pub const NO_ROUTE: u16 = u16::MAX;

/// A place in the queue past one obstacle set.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct QueuePlace {
    /// Length of the path that remains to the set's gate, m; negative once the drone is past the gate.
    pub remaining_m: f64,
    /// The [`set_tag`] of the obstacle set; 0 in an unused entry.
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

/// A hash that names an obstacle set; never 0. `set` must hold the ids in ascending order.
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
    /// Position, world frame, m.
    pub position_m: [f64; 3],
    /// Velocity, world frame, m/s.
    pub velocity_mps: [f64; 3],
    /// The drone's places in queues, nearest set first.
    pub queue: [QueuePlace; MAX_PLACES],
    /// The plan that the drone obeys.
    pub obeyed: PlanStamp,
    /// The drone's group.
    pub group: GroupId,
    /// The term that the drone obeys, or in which it leads.
    pub term: Ballot,
    /// Number of the drone's current process, from 1; each restart adds 1.
    pub incarnation: u32,
    /// Combination of [`POSE_LEADS`], [`POSE_IMPAIRED`] and [`POSE_BEFORE`].
    pub flags: u32,
    /// A hash of the drones that the drone hears without a relay, itself included. Two drones that hear the same drones have
    /// the same hash. 0 if the drone hears nobody, hears all drones of the swarm, or does not say.
    pub hears: u32,
}

impl Pose {
    /// The horizontal part of the position, world frame, m.
    #[must_use]
    pub fn position(&self) -> Vec2 {
        horizontal(self.position_m)
    }

    /// The horizontal part of the velocity, world frame, m/s.
    #[must_use]
    pub fn velocity(&self) -> Vec2 {
        horizontal(self.velocity_mps)
    }

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

    /// Whether the drone has never reached the end of an obstacle that its formation names as passed.
    #[must_use]
    pub fn is_before(&self) -> bool {
        self.flags & POSE_BEFORE != 0
    }
}

/// Maximum number of drones in one [`Presence`].
pub const MAX_PRESENT: usize = 6;

/// The state of a drone that the source of the message has heard of.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Present {
    /// Time of the state.
    pub stamp: SimTime,
    /// The drone.
    pub drone: DroneId,
    /// Number of the drone's process, as in [`Pose::incarnation`].
    pub incarnation: u32,
    /// As in [`Pose::flags`].
    pub flags: u32,
    /// Position, world frame, m.
    pub position_m: [f32; 3],
    /// Horizontal velocity, world frame, m/s.
    pub velocity_mps: [f32; 2],
}

/// The states of drones that some drones do not hear themselves. All of them are in one group and obey one term and one plan.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Presence {
    /// The plan that the drones obey.
    pub obeyed: PlanStamp,
    /// The drones' group.
    pub group: GroupId,
    /// The term that the drones obey.
    pub term: Ballot,
    /// Number of entries of `drones` in use, at most [`MAX_PRESENT`].
    pub count: u32,
    /// The drones.
    pub drones: [Present; MAX_PRESENT],
}

impl Presence {
    /// The drones.
    #[must_use]
    pub fn present(&self) -> &[Present] {
        &self.drones[..MAX_PRESENT.min(self.count as usize)]
    }

    /// The last beacon of one of the drones, as far as it is passed on: without the climb, the places in queues, and the drones
    /// that it hears.
    #[must_use]
    pub fn pose(&self, present: &Present) -> Pose {
        let ([x, y, z], [vx, vy]) = (present.position_m.map(f64::from), present.velocity_mps.map(f64::from));
        Pose {
            stamp: present.stamp,
            position_m: [x, y, z],
            velocity_mps: [vx, vy, 0.0],
            queue: [QueuePlace::default(); MAX_PLACES],
            obeyed: self.obeyed,
            group: self.group,
            term: self.term,
            incarnation: present.incarnation,
            flags: present.flags,
            hears: 0,
        }
    }

    /// The last beacons of all these drones, see [`Self::pose`].
    pub fn poses(&self) -> impl Iterator<Item = (DroneId, Pose)> + '_ {
        self.present().iter().map(|present| (present.drone, self.pose(present)))
    }
}

/// An obstacle that a drone has sensed, sent to the drones that have not sensed it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Obstacle {
    /// The obstacle's outline, world frame.
    pub shape: ConvexShape,
    /// The obstacle's number in the world.
    pub id: ObstacleId,
    /// The drone that sensed the obstacle first, as far as the sender knows.
    pub witness: DroneId,
}

/// A message about leadership: a claim, a heartbeat, a pre-vote, its rejection, or a transfer.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Leadership {
    /// Time of sending. In a pre-vote and in its rejection: when the leader sent the newest sign of life that the source knows, by
    /// the leader's clock.
    pub stamp: SimTime,
    /// The term.
    pub ballot: Ballot,
    /// A [`LeadershipKind`], see [`Leadership::kind`].
    pub kind: u16,
    /// How often the message was passed on. A drone that passes it on adds 1.
    pub hops: u16,
    /// The group that the term is about.
    pub group: GroupId,
    /// Number of the last plan made in this term; 0 if none.
    pub epoch: u32,
    /// The drone that is asked to take over; [`DroneId::NONE`] unless this is a transfer.
    pub heir: DroneId,
}

impl Leadership {
    /// What the message says. Decoding rejects unknown numbers. In a payload that was never decoded, an unknown number
    /// counts as a heartbeat.
    #[must_use]
    pub fn kind(&self) -> LeadershipKind {
        LeadershipKind::from_wire(self.kind.into()).unwrap_or(LeadershipKind::Heartbeat)
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
            .field("hops", &self.hops)
            .finish()
    }
}

/// What a leader has decided for its group.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Plan {
    /// The time at which `anchor_m` is valid. Receivers extrapolate the anchor with its velocity.
    pub stamp: SimTime,
    /// The plan's term and number.
    pub id: PlanStamp,
    /// The group that the plan is for.
    pub group: GroupId,
    /// A [`Phase`], see [`Plan::phase`].
    pub phase: u32,
    /// Number of drones in the plan. The target shape is the formation of that many drones.
    pub members: u32,
    /// Position of the formation's front slot at `stamp`, world frame, m.
    pub anchor_m: [f64; 2],
    /// Velocity of the front slot, world frame, m/s.
    pub anchor_mps: [f64; 2],
    /// How far along the course the anchor stops, m; infinity if it never stops. With [`Course::East`] this is an x coordinate.
    pub anchor_stop_x_m: f64,
    /// Predicted time from `stamp` until the last drone passes the gate, s; NaN unless the phase is [`Phase::Avoid`].
    pub predicted_s: f64,
    /// Number of groupings that the leader simulated before it chose this one.
    pub candidates: u32,
    /// Number of routes past the set; 0 unless the phase is [`Phase::Avoid`].
    pub routes: u32,
    /// Number of entries of `set` in use, at most [`MAX_SET`].
    pub set_count: u32,
    /// In ascending order: the obstacles of the set while avoiding; the obstacles that all drones of the plan have passed, of more than
    /// [`MAX_SET`] those that end farthest on, while re-forming; none while cruising.
    pub set: [ObstacleId; MAX_SET],
    /// The course of the mission, see [`Plan::course`].
    pub course: u32,
}

impl Plan {
    /// What the plan tells its group to do. Decoding rejects unknown numbers. In a payload that was never decoded, an
    /// unknown number counts as [`Phase::Cruise`].
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::from_wire(self.phase).unwrap_or_default()
    }

    /// The course of the mission: [`Course::quarters`] on the wire. Decoding rejects unknown numbers.
    #[must_use]
    pub fn course(&self) -> Course {
        Course::from_quarters(self.course)
    }

    /// Position (world frame, m) and velocity (world frame, m/s) of the anchor at `now`. The anchor moves from the time
    /// of its stamp until it reaches [`Plan::anchor_stop_x_m`].
    #[must_use]
    pub fn anchor_at(&self, now: SimTime) -> (Vec2, Vec2) {
        let course = self.course();
        let (start, velocity) = (course.from_world(self.anchor_m.into()), course.from_world(self.anchor_mps.into()));
        let here = start + velocity * now.since(self.stamp);
        if velocity.x > 0.0 && here.x >= self.anchor_stop_x_m {
            let moved_s = ((self.anchor_stop_x_m - start.x) / velocity.x).max(0.0);
            let stop = Vec2::new(self.anchor_stop_x_m.max(start.x), start.y + velocity.y * moved_s);
            return (course.to_world(stop), Vec2::zeros());
        }
        (course.to_world(here), course.to_world(velocity))
    }

    /// When the anchor has come to its stop; `None` if it never does.
    #[must_use]
    pub fn anchor_stops(&self) -> Option<SimTime> {
        let along = |v: [f64; 2]| self.course().along(v.into());
        let (way_m, speed_mps) = (self.anchor_stop_x_m - along(self.anchor_m), along(self.anchor_mps));
        if speed_mps <= 0.0 || way_m <= 0.0 {
            return (self.anchor_mps == [0.0; 2] || speed_mps > 0.0).then_some(self.stamp);
        }
        way_m.is_finite().then(|| self.stamp.after(way_m / speed_mps))
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
            .field("course", &self.course())
            .finish()
    }
}

/// What a plan assigns to one drone.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Assignment {
    /// The plan that the assignment belongs to.
    pub id: PlanStamp,
    /// The group that the plan is for.
    pub scope: GroupId,
    /// The drone's group under this plan: the scope, or a group that was split from it.
    pub group: GroupId,
    /// The drone that the assignment is for.
    pub drone: DroneId,
    /// Leader of the drone's group.
    pub leader: DroneId,
    /// The drone's slot in the formation, relative to the anchor, m.
    pub slot_m: [f64; 2],
    /// Free-flight time to the gate when the plan was made, s; 0 unless the phase is [`Phase::Avoid`]. The queue is in
    /// this order.
    pub arrival_s: f64,
    /// Route past the set, 0 = rightmost; [`NO_ROUTE`] unless the phase is [`Phase::Avoid`].
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
    /// Always 0.
    pub reserved: u32,
}

/// Maximum number of drones in one [`AssignmentList`].
pub const MAX_LISTED: usize = 8;

/// What an [`AssignmentList`] says of one drone.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct ListedAssignment {
    /// The drone.
    pub drone: DroneId,
    /// As in [`Assignment::route`].
    pub route: u16,
    /// As in [`Assignment::rank`].
    pub rank: u16,
    /// As in [`Assignment::slot_m`], m.
    pub slot_m: [f64; 2],
    /// As in [`Assignment::arrival_s`], s.
    pub arrival_s: f64,
}

/// Assignments of drones of one group that the source passes on. On the wire it is as long as the entries in use.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AssignmentList {
    /// The plan that the assignments belong to.
    pub id: PlanStamp,
    /// The group that the plan is for.
    pub scope: GroupId,
    /// The drones' group under this plan.
    pub group: GroupId,
    /// Leader of that group.
    pub leader: DroneId,
    /// Number of entries of `drones` in use, at most [`MAX_LISTED`].
    pub count: u32,
    /// Always 0.
    pub reserved: u64,
    /// The drones.
    pub drones: [ListedAssignment; MAX_LISTED],
}

impl AssignmentList {
    /// A list of one assignment.
    #[must_use]
    pub fn of(first: &Assignment) -> Self {
        let Assignment { id, scope, group, leader, .. } = *first;
        let mut list = Self { id, scope, group, leader, ..Self::default() };
        list.push(first);
        list
    }

    /// Adds an assignment. Returns whether it fits: it belongs to the same plan and group, and there is room.
    pub fn push(&mut self, part: &Assignment) -> bool {
        let fits = self.takes(part);
        if let Some(entry) = self.drones.get_mut(self.count as usize).filter(|_| fits) {
            let Assignment { drone, route, rank, slot_m, arrival_s, .. } = *part;
            *entry = ListedAssignment { drone, route, rank, slot_m, arrival_s };
            self.count += 1;
        }
        fits
    }

    /// Whether an assignment would fit.
    #[must_use]
    pub fn takes(&self, part: &Assignment) -> bool {
        let same = (self.id, self.scope, self.group, self.leader) == (part.id, part.scope, part.group, part.leader);
        same && (self.count as usize) < MAX_LISTED
    }

    /// The assignments.
    pub fn assignments(&self) -> impl Iterator<Item = Assignment> + '_ {
        let Self { id, scope, group, leader, .. } = *self;
        let listed = self.drones.iter().take(self.count as usize);
        listed.map(move |one| {
            let ListedAssignment { drone, route, rank, slot_m, arrival_s } = *one;
            Assignment { id, scope, group, drone, leader, slot_m, arrival_s, route, rank, reserved: 0 }
        })
    }

    /// Number of bytes on the wire of a list of so many assignments.
    #[must_use]
    pub(crate) const fn len_of(count: usize) -> usize {
        size_of::<Self>() - (MAX_LISTED - count) * size_of::<ListedAssignment>()
    }
}

/// When one member of the source's group can be at the gate of an obstacle set. If several groups have the same set ahead,
/// their leaders exchange these rows, and each leader plans the split from the union of all rows.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Arrivals {
    /// Time at which the row was made.
    pub stamp: SimTime,
    /// The source's term.
    pub ballot: Ballot,
    /// The member that the row is about.
    pub drone: DroneId,
    /// The group that the source leads.
    pub group: GroupId,
    /// The [`set_tag`] of the obstacle set.
    pub set: u32,
    /// Number of entries of `gate_s` in use, at most [`MAX_ROUTES`]. Routes are numbered from right to left.
    pub routes: u32,
    /// An [`ArrivalsKind`], see [`Arrivals::kind`].
    pub kind: u32,
    /// For each route: time from the stamp to the gate in free flight, s. The time is infinite if the drone cannot take
    /// the route, and negative if the drone is past the gate.
    pub gate_s: [f32; MAX_ROUTES],
}

impl Arrivals {
    /// What the message is for. Decoding rejects unknown numbers. In a payload that was never decoded, an unknown number
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

/// Reports that a drone is past these obstacles: beyond the rear edge of the set by the planning distance.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Passed {
    /// Time of sending.
    pub stamp: SimTime,
    /// Number of entries of `set` in use, at most [`MAX_SET`].
    pub set_count: u32,
    /// The obstacles, in ascending order.
    pub set: [ObstacleId; MAX_SET],
    /// 0 if the source itself is past them. Otherwise the source passes a report on, of the drone with this number less 1.
    pub of: u32,
}

impl Passed {
    /// The drone that is past the obstacles, in a message of `source`.
    #[must_use]
    pub fn drone(&self, source: DroneId) -> DroneId {
        self.of.checked_sub(1).map_or(source, DroneId)
    }
}

/// A line between two drones. The drone that says it is bound to stay on its side of it (docs/safety.md, "By word alone"). The line moves along its normal, brakes and stops.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Separator {
    /// The time from which the line brakes. Before it, the line moves at `speed_mps`.
    pub stamp: SimTime,
    /// Where the line stops: the component of its points along the normal, m from the origin of the world frame.
    pub stop_m: f64,
    /// Direction of the normal, rad, counter-clockwise from the course of the mission ([`Course`]; from +x with [`Course::East`]). The normal points to the side of the drone with the lower id.
    pub angle_rad: f32,
    /// Speed of the line along the normal, m/s. It is positive if the line moves to the side of the drone with the lower id.
    pub speed_mps: f32,
    /// Deceleration of the line until it stops, m/s², > 0 if the speed is not 0.
    pub deceleration_mps2: f32,
    /// The other drone.
    pub peer: DroneId,
    /// Number of the line among the lines of the two drones. Later lines have higher numbers.
    pub number: u32,
    /// The incarnation of the drone that is bound to the line, from 1.
    pub incarnation: u16,
    /// The incarnation of the other drone for which the line is meant, from 1.
    pub peer_incarnation: u16,
}

/// Lines that a drone is bound to, each between that drone and one other drone.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Separation {
    /// Number of entries of `separators` in use, at most [`MAX_SEPARATORS`].
    pub count: u32,
    /// 0 if the source itself is bound to the lines. Otherwise the source passes on lines of the drone with this number less 1.
    pub of: u32,
    /// The lines.
    pub separators: [Separator; MAX_SEPARATORS],
}

impl Separation {
    /// The drone that is bound to the lines, in a message of `source`.
    #[must_use]
    pub fn drone(&self, source: DroneId) -> DroneId {
        self.of.checked_sub(1).map_or(source, DroneId)
    }

    /// The entries in use.
    #[must_use]
    pub fn separators(&self) -> &[Separator] {
        &self.separators[..(self.count as usize).min(MAX_SEPARATORS)]
    }
}
