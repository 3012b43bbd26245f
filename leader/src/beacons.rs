//! The last beacons of many drones, in little memory. A drone of a swarm of a thousand keeps a thousand of them, in which most drones
//! obey the same plan.

use crate::beacon_states::{BriefState, FullStates};
use crate::growth::make_room;
use crate::heard::Heard;
use crate::shared_values::SharedValues;
use skein_protocol::payload::{MAX_PLACES, POSE_BEFORE, POSE_IMPAIRED, POSE_LEADS, Pose, QueuePlace};
use skein_protocol::{Ballot, GroupId, PlanStamp, SimTime, Vec2, prefetch};
use std::fmt;

/// One beacon per index. Every value of every beacon is kept as it was heard.
#[derive(Clone, Default)]
pub(crate) struct Beacons {
    /// Their time stamps. Each tick reads all of them.
    stamps: Vec<SimTime>,
    lines: Vec<Line>,
    /// By index, until the first beacon comes that was passed on.
    full: FullStates,
    /// Whether one has come.
    divided: bool,
    allegiances: SharedValues<Allegiance>,
    /// Number of the drones that say which part of the swarm they hear: [`Pose::hears`].
    hearing_parts: usize,
}

/// What is kept of a drone, in one line of the cache: a large swarm does not fit into it.
#[repr(align(64))]
#[derive(Clone, Copy, Debug)]
struct Line {
    heard: Heard,
    /// Index of the drone's [`Allegiance`].
    allegiance: u32,
    /// Not used before the first beacon comes that was passed on.
    state: BriefState,
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

impl Beacons {
    /// The time stamps, by index.
    pub(crate) fn stamps(&self) -> &[SimTime] {
        &self.stamps
    }

    /// The beacon at an index.
    #[inline]
    pub(crate) fn get(&self, index: usize) -> Beacon<'_> {
        Beacon { beacons: self, index }
    }

    /// The state at an index.
    #[inline]
    fn state(&self, index: usize) -> BriefState {
        if self.divided { self.lines[index].state } else { BriefState::at(index) }
    }

    /// From now on, states are not by index.
    fn divide(&mut self) {
        self.divided = true;
        self.lines.iter_mut().enumerate().for_each(|(index, line)| line.state = BriefState::at(index));
    }

    /// When the drone at an index was heard.
    #[inline]
    pub(crate) fn heard(&self, index: usize) -> &Heard {
        &self.lines[index].heard
    }

    /// Fetches a beacon into the cache, but for what [`Self::warm_full`] does.
    #[inline]
    pub(crate) fn warm(&self, index: usize) {
        self.warm_stamp(index);
        prefetch(&self.lines[index]);
        if !self.divided {
            self.full.warm(&BriefState::at(index));
        }
    }

    /// Fetches what a beacon says more than one that is passed on into the cache.
    #[inline]
    pub(crate) fn warm_full(&self, index: usize) {
        if self.divided {
            self.full.warm(&self.lines[index].state);
        }
    }

    /// Fetches what all beacons say more than those that are passed on into the cache, if they are few.
    #[inline]
    pub(crate) fn warm_few(&self) {
        if self.divided && 2 * self.full.len() < self.lines.len() {
            self.full.warm_all();
        }
    }

    /// Fetches the time stamp of a beacon into the cache.
    #[inline]
    pub(crate) fn warm_stamp(&self, index: usize) {
        prefetch(&self.stamps[index]);
    }

    /// Fetches the places in queues of a beacon into the cache.
    #[inline]
    pub(crate) fn warm_queue(&self, index: usize) {
        self.full.warm_queue(&self.state(index));
    }

    /// All beacons, by index.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Beacon<'_>> + Clone {
        (0..self.lines.len()).map(|index| self.get(index))
    }

    /// Inserts a beacon. The index of those from there on rises by one. `relayed`: it was passed on.
    pub(crate) fn insert(&mut self, index: usize, pose: &Pose, heard: Heard, relayed: bool) {
        if relayed && !self.divided {
            self.divide();
        }
        let allegiance = self.allegiances.share(&pose.into());
        let state = if self.divided {
            self.full.keep(None, pose, relayed)
        } else {
            self.full.insert(index, pose);
            BriefState::at(index)
        };
        make_room(&mut self.stamps);
        make_room(&mut self.lines);
        self.stamps.insert(index, pose.stamp);
        self.lines.insert(index, Line { heard, allegiance, state });
        self.hearing_parts += usize::from(pose.hears != 0);
    }

    /// Takes a later beacon of the same drone. `relayed`: it was passed on. Returns when the drone was heard, to be changed.
    #[inline]
    pub(crate) fn replace(&mut self, index: usize, pose: &Pose, relayed: bool) -> &mut Heard {
        if relayed && !self.divided {
            self.divide();
        }
        let old = self.state(index);
        let heard_part = self.full.hears(&old) != 0;
        self.hearing_parts = self.hearing_parts + usize::from(pose.hears != 0) - usize::from(heard_part);
        let line = &mut self.lines[index];
        line.allegiance = self.allegiances.replace(line.allegiance, &pose.into());
        line.state = self.full.keep(Some(&old), pose, relayed);
        self.stamps[index] = pose.stamp;
        &mut line.heard
    }

    /// Removes a beacon. The index of those behind it falls by one.
    pub(crate) fn remove(&mut self, index: usize) {
        let state = self.state(index);
        self.hearing_parts -= usize::from(self.full.hears(&state) != 0);
        if self.divided {
            self.full.release(&state);
        } else {
            self.full.remove(index);
        }
        self.stamps.remove(index);
        self.allegiances.release(self.lines.remove(index).allegiance);
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
        self.full.tidy();
    }

    /// Makes all drones members of one group that obeys this plan.
    pub(crate) fn unite(&mut self, stamp: PlanStamp) {
        for one in self.allegiances.iter_mut() {
            (one.group, one.term, one.obeyed) = (GroupId::ALL, stamp.ballot, stamp);
        }
    }
}

/// The beacons themselves, and when they were heard: how they are kept depends on what was heard before.
impl fmt::Debug for Beacons {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter().map(|beacon| (beacon.line().heard, beacon.pose()))).finish()
    }
}

/// The last beacon of a drone. Its values have the meaning that they have in [`Pose`].
#[derive(Clone, Copy)]
pub struct Beacon<'a> {
    beacons: &'a Beacons,
    index: usize,
}

impl fmt::Debug for Beacon<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.pose().fmt(f)
    }
}

impl Beacon<'_> {
    #[inline]
    fn line(&self) -> &Line {
        &self.beacons.lines[self.index]
    }

    #[inline]
    fn state(&self) -> BriefState {
        self.beacons.state(self.index)
    }

    #[inline]
    fn allegiance(&self) -> &Allegiance {
        self.beacons.allegiances.get(self.line().allegiance)
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
        self.beacons.full.position(&self.state())
    }

    /// The horizontal part of the velocity, world frame, m/s.
    #[inline]
    #[must_use]
    pub fn velocity(&self) -> Vec2 {
        self.beacons.full.velocity(&self.state())
    }

    /// The horizontal parts of position and velocity, world frame, m and m/s.
    #[inline]
    #[must_use]
    pub fn flight(&self) -> (Vec2, Vec2) {
        self.beacons.full.flight(&self.state())
    }

    /// The drone's places in queues, nearest set first.
    #[inline]
    pub fn queue(&self) -> impl Iterator<Item = QueuePlace> + Clone {
        (0..MAX_PLACES).map(|number| self.beacons.full.queue_place(&self.state(), number))
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
        self.beacons.full.hears(&self.state())
    }

    /// Where the drone is at `now` if it has kept the velocity of this beacon, world frame, m.
    #[inline]
    #[must_use]
    pub fn extrapolated(&self, now: SimTime) -> Vec2 {
        let (position, velocity) = self.flight();
        position + velocity * now.since(self.stamp())
    }

    /// Where the drone is at rest if it has braked at `braking_mps2` since this beacon, world frame, m.
    #[must_use]
    pub fn stopped(&self, braking_mps2: f64) -> Vec2 {
        let (position, velocity) = self.flight();
        position + velocity * (velocity.norm() / (2.0 * braking_mps2))
    }

    /// All of it.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let (position_m, velocity_mps) = self.beacons.full.motion(&self.state());
        let &Allegiance { obeyed, group, term, incarnation, flags } = self.allegiance();
        let (stamp, hears) = (self.stamp(), self.hears());
        let queue = std::array::from_fn(|number| self.beacons.full.queue_place(&self.state(), number));
        Pose { stamp, position_m, velocity_mps, queue, obeyed, group, term, incarnation, flags, hears }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heard::Timeouts;

    const TERM: Ballot = Ballot { round: 3, ..Ballot::NONE };

    fn pose(number: u32) -> Pose {
        let place = |route| QueuePlace { remaining_m: f64::from(number), set: 9, route, rank: number as u16 };
        Pose {
            stamp: SimTime(number.into()),
            position_m: [f64::from(number), 2.0, 3.0],
            velocity_mps: [f64::from(number) / 3.0, 5.0, f64::from(number % 4 / 2)],
            queue: match number % 5 {
                0 => [place(0), place(1)],
                1 => [place(2), QueuePlace::default()],
                _ => [QueuePlace::default(); MAX_PLACES],
            },
            obeyed: PlanStamp { epoch: number % 3, ..PlanStamp::default() },
            group: GroupId::ALL.child((number % 2) as u8 + 1),
            incarnation: 1 + number % 7 / 6,
            flags: number % 4,
            hears: number % 7 / 4 * 77,
            term: Ballot { round: number / 400, ..Ballot::NONE },
        }
    }

    #[test]
    fn what_is_kept_of_a_drone_is_one_line_of_the_cache() {
        assert_eq!(size_of::<Line>(), 64);
    }

    #[test]
    fn every_beacon_is_kept_as_it_was_heard() {
        let (mut beacons, mut expected) = (Beacons::default(), Vec::new());
        let heard = Heard::first(SimTime::ZERO, true, Timeouts { direct_s: 1.0, relayed_s: 1.0 });
        for step in 0..2000u32 {
            let (at, pose) = (step.wrapping_mul(0x9e37_79b9) as usize, pose(step));
            let relayed = step > 500 && at & 0x400 != 0;
            match step % 9 {
                0..3 => {
                    let at = at % (expected.len() + 1);
                    beacons.insert(at, &pose, heard, relayed);
                    expected.insert(at, pose);
                }
                3 if expected.len() > 20 => {
                    beacons.remove(at % expected.len());
                    expected.remove(at % expected.len());
                }
                4 => beacons.tidy(),
                _ => {
                    let at = at % expected.len();
                    beacons.replace(at, &pose, relayed);
                    expected[at] = pose;
                }
            }
            assert_eq!(beacons.iter().map(|beacon| beacon.pose()).collect::<Vec<_>>(), expected);
            assert_eq!(beacons.hearing_parts, expected.iter().filter(|pose| pose.hears != 0).count());
            let lags = |pose: &Pose| pose.term < TERM && GroupId::ALL.contains(pose.group);
            assert_eq!(beacons.some_lag(TERM, GroupId::ALL), expected.iter().any(lags));
        }
    }
}
