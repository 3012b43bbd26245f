//! The last beacons of many drones, in little memory. A drone of a swarm of a thousand keeps a thousand of them, in which most drones
//! obey the same plan, and few wait in a queue.

use crate::shared_values::SharedValues;
use skein_protocol::payload::{MAX_PLACES, POSE_BEFORE, POSE_IMPAIRED, POSE_LEADS, Pose, QueuePlace};
use skein_protocol::{Ballot, GroupId, PlanStamp, SimTime, Vec2, horizontal, prefetch};
use std::fmt;

/// One beacon per index. Every value of every beacon is kept as it was heard.
#[derive(Clone, Default)]
pub(crate) struct Beacons {
    /// Their time stamps. Each tick reads all of them.
    stamps: Vec<SimTime>,
    states: Vec<State>,
    /// First and second entries of [`Pose::queue`]. A list is empty while all its entries are unused.
    queues: [Vec<QueuePlace>; MAX_PLACES],
    allegiances: SharedValues<Allegiance>,
    /// Number of the drones that say which part of the swarm they hear: [`Pose::hears`].
    hearing_parts: usize,
}

/// What differs from drone to drone. It fills one line of the cache: the states of a large swarm do not fit into it.
#[repr(align(64))]
#[derive(Clone, Copy, Debug)]
struct State {
    position_m: [f64; 3],
    velocity_mps: [f64; 3],
    /// Index of the drone's [`Allegiance`].
    allegiance: u32,
    hears: u32,
    /// Whether the drone has a place in a queue.
    queued: bool,
}

/// What most drones have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Allegiance {
    obeyed: PlanStamp,
    group: GroupId,
    term: Ballot,
    incarnation: u32,
    flags: u32,
}

impl From<&Pose> for Allegiance {
    #[inline]
    fn from(pose: &Pose) -> Self {
        let &Pose { obeyed, group, term, incarnation, flags, .. } = pose;
        Self { obeyed, group, term, incarnation, flags }
    }
}

impl State {
    #[inline]
    fn new(pose: &Pose, allegiance: u32) -> Self {
        let &Pose { position_m, velocity_mps, hears, queue, .. } = pose;
        Self { position_m, velocity_mps, allegiance, hears, queued: queue != [QueuePlace::default(); MAX_PLACES] }
    }
}

impl Beacons {
    /// The time stamps, by index.
    pub(crate) fn stamps(&self) -> &[SimTime] {
        &self.stamps
    }

    /// The beacon at an index.
    #[inline]
    pub(crate) fn get(&self, index: usize) -> Beacon<'_> {
        Beacon { beacons: self, state: &self.states[index], index }
    }

    /// Fetches a beacon into the cache.
    #[inline]
    pub(crate) fn warm(&self, index: usize) {
        self.warm_stamp(index);
        prefetch(&self.states[index]);
    }

    /// Fetches the time stamp of a beacon into the cache.
    #[inline]
    pub(crate) fn warm_stamp(&self, index: usize) {
        prefetch(&self.stamps[index]);
    }

    /// Fetches the places in queues of a beacon into the cache.
    #[inline]
    pub(crate) fn warm_queue(&self, index: usize) {
        prefetch(&self.states[index]);
        self.queues.iter().filter_map(|queue| queue.get(index)).for_each(prefetch);
    }

    /// All beacons, by index.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Beacon<'_>> + Clone {
        self.states.iter().enumerate().map(|(index, state)| Beacon { beacons: self, state, index })
    }

    /// Inserts a beacon. The index of those from there on rises by one.
    pub(crate) fn insert(&mut self, index: usize, pose: &Pose) {
        let allegiance = self.allegiances.share(&pose.into());
        self.stamps.insert(index, pose.stamp);
        self.states.insert(index, State::new(pose, allegiance));
        self.hearing_parts += usize::from(pose.hears != 0);
        for queue in self.queues.iter_mut().filter(|queue| !queue.is_empty()) {
            queue.insert(index, QueuePlace::default());
        }
        self.set_queue(index, pose);
    }

    /// Takes a later beacon of the same drone.
    #[inline]
    pub(crate) fn replace(&mut self, index: usize, pose: &Pose) {
        let state = &mut self.states[index];
        let was_queued = state.queued;
        self.hearing_parts = self.hearing_parts + usize::from(pose.hears != 0) - usize::from(state.hears != 0);
        *state = State::new(pose, self.allegiances.replace(state.allegiance, &pose.into()));
        self.stamps[index] = pose.stamp;
        if was_queued || state.queued {
            self.set_queue(index, pose);
        }
    }

    #[inline]
    fn set_queue(&mut self, index: usize, pose: &Pose) {
        for (queue, place) in self.queues.iter_mut().zip(pose.queue) {
            if let Some(kept) = queue.get_mut(index) {
                *kept = place;
            } else if place != QueuePlace::default() {
                queue.resize(self.states.len(), QueuePlace::default());
                queue[index] = place;
            }
        }
    }

    /// Removes a beacon. The index of those behind it falls by one.
    pub(crate) fn remove(&mut self, index: usize) {
        self.stamps.remove(index);
        let State { allegiance, hears, .. } = self.states.remove(index);
        self.allegiances.release(allegiance);
        self.hearing_parts -= usize::from(hears != 0);
        for queue in self.queues.iter_mut().filter(|queue| !queue.is_empty()) {
            queue.remove(index);
        }
    }

    /// Whether some drone says which part of the swarm it hears.
    pub(crate) fn some_hear_parts(&self) -> bool {
        self.hearing_parts > 0
    }

    /// Whether some drone of a group within `scope` obeys an earlier term.
    pub(crate) fn some_lag(&self, term: Ballot, scope: GroupId) -> bool {
        self.allegiances.used().any(|one| one.term < term && scope.contains(one.group))
    }

    /// Gives back the memory of queues in which no drone waits any more.
    pub(crate) fn tidy(&mut self) {
        for queue in &mut self.queues {
            if queue.iter().all(|place| *place == QueuePlace::default()) {
                *queue = Vec::new();
            }
        }
    }

    /// Makes all drones members of one group that obeys this plan.
    pub(crate) fn unite(&mut self, stamp: PlanStamp) {
        for one in self.allegiances.iter_mut() {
            (one.group, one.term, one.obeyed) = (GroupId::ALL, stamp.ballot, stamp);
        }
    }
}

/// The beacons themselves: how they are kept depends on what was heard before.
impl fmt::Debug for Beacons {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter().map(|beacon| beacon.pose())).finish()
    }
}

/// The last beacon of a drone. Its values have the meaning that they have in [`Pose`].
#[derive(Clone, Copy, Debug)]
pub struct Beacon<'a> {
    beacons: &'a Beacons,
    state: &'a State,
    index: usize,
}

impl Beacon<'_> {
    #[inline]
    fn allegiance(&self) -> &Allegiance {
        self.beacons.allegiances.get(self.state.allegiance)
    }

    /// Time of the state.
    #[inline]
    #[must_use]
    pub fn stamp(&self) -> SimTime {
        self.beacons.stamps[self.index]
    }

    /// The horizontal part of the position, world frame, m.
    #[inline]
    #[must_use]
    pub fn position(&self) -> Vec2 {
        horizontal(self.state.position_m)
    }

    /// The horizontal part of the velocity, world frame, m/s.
    #[inline]
    #[must_use]
    pub fn velocity(&self) -> Vec2 {
        horizontal(self.state.velocity_mps)
    }

    /// The drone's places in queues, nearest set first.
    #[inline]
    pub fn queue(&self) -> impl Iterator<Item = QueuePlace> + Clone {
        (0..MAX_PLACES).map(|number| self.place(number))
    }

    #[inline]
    fn place(&self, number: usize) -> QueuePlace {
        if !self.state.queued {
            return QueuePlace::default();
        }
        self.beacons.queues[number].get(self.index).copied().unwrap_or_default()
    }

    /// The plan that the drone obeys.
    #[inline]
    #[must_use]
    pub fn obeyed(&self) -> PlanStamp {
        self.allegiance().obeyed
    }

    /// The drone's group.
    #[inline]
    #[must_use]
    pub fn group(&self) -> GroupId {
        self.allegiance().group
    }

    /// The term that the drone obeys, or in which it leads.
    #[inline]
    #[must_use]
    pub fn term(&self) -> Ballot {
        self.allegiance().term
    }

    /// Number of the drone's process.
    #[inline]
    #[must_use]
    pub fn incarnation(&self) -> u32 {
        self.allegiance().incarnation
    }

    /// Flags of its state, see [`Pose::flags`].
    #[inline]
    #[must_use]
    pub fn flags(&self) -> u32 {
        self.allegiance().flags
    }

    /// Whether the drone believes that it leads.
    #[inline]
    #[must_use]
    pub fn leads(&self) -> bool {
        self.flags() & POSE_LEADS != 0
    }

    /// Whether a sensor of the drone is broken.
    #[inline]
    #[must_use]
    pub fn is_impaired(&self) -> bool {
        self.flags() & POSE_IMPAIRED != 0
    }

    /// See [`Pose::is_before`].
    #[must_use]
    pub fn is_before(&self) -> bool {
        self.flags() & POSE_BEFORE != 0
    }

    /// A hash of the drones that the drone hears without a relay.
    #[inline]
    #[must_use]
    pub fn hears(&self) -> u32 {
        self.state.hears
    }

    /// Where the drone is at `now` if it has kept the velocity of this beacon, world frame, m.
    #[inline]
    #[must_use]
    pub fn extrapolated(&self, now: SimTime) -> Vec2 {
        self.position() + self.velocity() * now.since(self.stamp())
    }

    /// Where the drone is at rest if it has braked at `braking_mps2` since this beacon, world frame, m.
    #[must_use]
    pub fn stopped(&self, braking_mps2: f64) -> Vec2 {
        let velocity = self.velocity();
        self.position() + velocity * (velocity.norm() / (2.0 * braking_mps2))
    }

    /// All of it.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let &State { position_m, velocity_mps, hears, .. } = self.state;
        let &Allegiance { obeyed, group, term, incarnation, flags } = self.allegiance();
        let (stamp, queue) = (self.stamp(), std::array::from_fn(|number| self.place(number)));
        Pose { stamp, position_m, velocity_mps, queue, obeyed, group, term, incarnation, flags, hears }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERM: Ballot = Ballot { round: 3, ..Ballot::NONE };

    fn pose(number: u32) -> Pose {
        let place = |route| QueuePlace { remaining_m: f64::from(number), set: 9, route, rank: number as u16 };
        Pose {
            stamp: SimTime(number.into()),
            position_m: [f64::from(number), 2.0, 3.0],
            velocity_mps: [f64::from(number) / 3.0, 5.0, -6.0],
            queue: match number % 5 {
                0 => [place(0), place(1)],
                1 => [place(2), QueuePlace::default()],
                _ => [QueuePlace::default(); MAX_PLACES],
            },
            obeyed: PlanStamp { epoch: number % 3, ..PlanStamp::default() },
            group: GroupId::ALL.child((number % 2) as u8 + 1),
            incarnation: 1 + number % 7 / 6,
            flags: number % 4,
            hears: number % 3 * 77,
            term: Ballot { round: number / 400, ..Ballot::NONE },
        }
    }

    #[test]
    fn every_beacon_is_kept_as_it_was_heard() {
        let (mut beacons, mut expected) = (Beacons::default(), Vec::new());
        for step in 0..2000u32 {
            let (at, pose) = (step.wrapping_mul(0x9e37_79b9) as usize, pose(step));
            match step % 9 {
                0..3 => {
                    let at = at % (expected.len() + 1);
                    beacons.insert(at, &pose);
                    expected.insert(at, pose);
                }
                3 if expected.len() > 20 => {
                    beacons.remove(at % expected.len());
                    expected.remove(at % expected.len());
                }
                4 => beacons.tidy(),
                _ => {
                    let at = at % expected.len();
                    beacons.replace(at, &pose);
                    expected[at] = pose;
                }
            }
            assert_eq!(beacons.iter().map(|beacon| beacon.pose()).collect::<Vec<_>>(), expected);
            assert_eq!(beacons.hearing_parts, expected.iter().filter(|pose| pose.hears != 0).count());
            let lags = |pose: &Pose| pose.term < TERM && GroupId::ALL.contains(pose.group);
            assert_eq!(beacons.some_lag(TERM, GroupId::ALL), expected.iter().any(lags));
        }
    }

    #[test]
    fn queues_take_memory_only_while_a_drone_waits() {
        let mut beacons = Beacons::default();
        (0..4).for_each(|index| beacons.insert(index, &pose(5)));
        (0..4).for_each(|index| beacons.replace(index, &pose(6)));
        beacons.tidy();
        assert_eq!(beacons.queues.each_ref().map(Vec::len), [4, 0]);
        (0..4).for_each(|index| beacons.replace(index, &pose(7)));
        beacons.tidy();
        assert_eq!(beacons.queues.each_ref().map(Vec::capacity), [0, 0]);
    }
}
