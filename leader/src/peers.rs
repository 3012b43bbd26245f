//! Which drones are there: the last beacon of each peer, and how old it is. Memory is bounded by the size of the swarm.

use crate::beacons::{Beacon, Beacons};
use crate::changes::Changes;
use crate::heard::{Heard, Timeouts};
use crate::quiet_blocks::QuietBlocks;
use crate::tuning::{DELAY_WEIGHT, DIRECT_S};
use skein_protocol::digest::Digest;
use skein_protocol::payload::Pose;
use skein_protocol::{Ballot, DroneId, GroupId, PlanStamp, SimTime};
use std::borrow::Borrow;

/// A beacon that took longer to arrive does not count, s.
const MAX_DELAY_S: f64 = 60.0;

/// Time between two looks for silent peers, in time-outs. A look at all of them costs as much as a few beacons per peer.
const LOOK_TIMEOUTS: f64 = 0.25;

/// Of so many peers the age is told at a time. By hand.
const AGES: usize = 64;

/// From this number of drones on, what a drone knows of the others may not be in the cache. Chosen by hand.
const LARGE: u32 = 64;

/// The last beacon heard of each peer.
#[derive(Clone, Debug)]
pub struct Peers {
    drones: u32,
    base: Timeouts,
    /// Running mean of the beacons' delay, s.
    delay_s: f64,
    /// Until when none of them is silent for too long.
    quiet: QuietBlocks,
    /// When peers are looked at again.
    next_look: SimTime,
    /// The peers heard, ascending. Apart from their beacons, so that a search touches little memory.
    ids: Vec<DroneId>,
    /// If the peers heard are the lowest ids but this one, as of the last look at all peers: then no search is needed.
    all_but: Option<DroneId>,
    /// The last beacon of each of them, in the same order, and when each was heard.
    beacons: Beacons,
    /// Of their time stamps.
    changes: Changes,
    /// Those that were heard without a relay, ascending: all that may still count as heard so, and some that no longer do. In a wide
    /// swarm they are few.
    near: Vec<DroneId>,
    /// All of `near` certainly count as heard without a relay until then.
    direct_until: SimTime,
}

impl Peers {
    /// No peers yet, in a swarm of `drones`. A peer that is silent for longer than `timeout_s`, or on a bad link for much
    /// longer than usual, counts as gone.
    #[must_use]
    pub fn new(drones: u32, timeout_s: f64) -> Self {
        Self {
            drones,
            base: Timeouts { direct_s: timeout_s, relayed_s: timeout_s },
            delay_s: 0.0,
            quiet: QuietBlocks::default(),
            next_look: SimTime::ZERO,
            ids: Vec::new(),
            all_but: None,
            beacons: Beacons::default(),
            changes: Changes::default(),
            near: Vec::new(),
            direct_until: SimTime::MAX,
        }
    }

    /// The same, where the states of drones that are not heard themselves come less often: time-outs are longer for those by this factor.
    pub(crate) fn relayed_less(mut self, factor: f64) -> Self {
        self.base.relayed_s = factor * self.base.direct_s;
        self
    }

    /// Takes a beacon. A beacon is ignored if it is older than the last one, from the future, or of no drone of the swarm.
    /// Age is by simulated time alone, which goes on when a process is restarted.
    pub fn hear(&mut self, now: SimTime, source: DroneId, pose: impl Borrow<Pose>) {
        self.take(now, source, pose.borrow(), true);
    }

    /// Takes a beacon that another drone passed on. It is ignored if the peer itself is heard.
    pub fn hear_of(&mut self, now: SimTime, peer: DroneId, pose: impl Borrow<Pose>) {
        if !self.is_heard_now(peer, now) {
            self.take(now, peer, pose.borrow(), false);
        }
    }

    fn take(&mut self, now: SimTime, source: DroneId, pose: &Pose, direct: bool) {
        let delay_s = now.since(pose.stamp);
        if source.0 >= self.drones || !(0.0..=MAX_DELAY_S).contains(&delay_s) {
            return;
        }
        let place = self.place(source);
        let before = place.ok().map(|place| self.beacons.heard(place).direct());
        if let Some(heard) = before.filter(|heard| direct && now.since(*heard) > self.base.direct_s) {
            self.note_near(heard, source);
        }
        match place {
            Err(place) => {
                if direct {
                    self.note_near(now, source);
                }
                let heard = Heard::first(now, direct, self.base);
                self.ids.insert(place, source);
                self.quiet.insert(place, heard.lives_until(self.base), self.ids.len());
                self.all_but = None;
                self.beacons.insert(place, pose, heard, !direct);
                self.changes.note_moved(self.ids.len());
            }
            Ok(place) if pose.stamp > self.beacons.stamps()[place] => {
                let heard = self.beacons.replace(place, pose, !direct);
                heard.again(now, direct, self.base);
                let until = heard.lives_until(self.base);
                self.changes.note(place);
                self.quiet.note(place, until);
                if direct {
                    self.delay_s += DELAY_WEIGHT * (delay_s - self.delay_s);
                }
            }
            Ok(_) => {}
        }
        if now >= self.next_look {
            self.look_for_silence(now);
        }
    }

    /// Adds a peer to those heard without a relay. It was last heard so at this time, or later.
    fn note_near(&mut self, heard: SimTime, peer: DroneId) {
        self.direct_until = self.direct_until.min(self.base.certain_until(heard));
        if let Err(place) = self.near.binary_search(&peer) {
            self.near.insert(place, peer);
        }
    }

    /// Finds out anew until when no peer is silent for too long. In a wide swarm most peers are far away. They may be silent for longer, and
    /// they are looked at less often.
    fn look_for_silence(&mut self, now: SimTime) {
        self.next_look = now.after(LOOK_TIMEOUTS * self.base.direct_s);
        self.look_near(now);
        let (beacons, base) = (&self.beacons, self.base);
        self.quiet.look(self.next_look, self.ids.len(), |place| beacons.heard(place).lives_until(base));
        self.all_but = self.all_but.or_else(|| lowest_but_one(&self.ids));
        self.beacons.tidy();
    }

    fn look_near(&mut self, now: SimTime) {
        let mut near = std::mem::take(&mut self.near);
        self.direct_until = SimTime::MAX;
        near.retain(|id| {
            let Some(peer) = self.get(*id).copied() else { return false };
            let stays = !peer.is_far(now, self.base);
            if stays {
                self.direct_until = self.direct_until.min(self.base.certain_until(peer.direct()));
            }
            stays
        });
        self.near = near;
    }

    /// The index of a peer, or where it belongs. Once all drones have been heard, no search is needed: the index is the id,
    /// less one for the ids above this drone's own.
    #[inline]
    fn place(&self, peer: DroneId) -> Result<usize, usize> {
        known_place(self.all_but, self.ids.len(), peer).map_or_else(|| self.search(peer), Ok)
    }

    fn search(&self, peer: DroneId) -> Result<usize, usize> {
        let guess = |index: usize| (self.ids.get(index) == Some(&peer)).then_some(index);
        let found = guess(peer.index()).or_else(|| guess(peer.index().checked_sub(1)?));
        found.map_or_else(|| self.ids.binary_search(&peer), Ok)
    }

    fn get(&self, peer: DroneId) -> Option<&Heard> {
        self.place(peer).ok().map(|place| self.beacons.heard(place))
    }

    /// Fetches all about a peer into the cache, but for what [`Self::warm_full`] does.
    #[inline]
    pub(crate) fn warm(&self, peer: DroneId) {
        if let Ok(place) = self.place(peer) {
            self.beacons.warm(place);
        }
    }

    /// Fetches what a peer says more than what is passed on into the cache. It reads what [`Self::warm`] fetches.
    #[inline]
    pub(crate) fn warm_full(&self, peer: DroneId) {
        if let Ok(place) = self.place(peer) {
            self.beacons.warm_full(place);
        }
    }

    /// Fetches a peer's places in queues into the cache.
    #[inline]
    pub fn warm_queue(&self, peer: DroneId) {
        if let Ok(place) = self.place(peer) {
            self.beacons.warm_queue(place);
        }
    }

    /// Whether the swarm is so large that what a drone knows of it does not stay in the cache.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.drones >= LARGE
    }

    /// Fetches all about the peers that may count as heard without a relay into the cache.
    pub(crate) fn warm_near(&self) {
        if !self.is_large() {
            return;
        }
        self.near.iter().for_each(|peer| self.warm(*peer));
        self.beacons.warm_few();
    }

    /// Fetches the time stamp of a peer's last beacon into the cache.
    #[inline]
    pub(crate) fn warm_stamp(&self, peer: DroneId) {
        if let Ok(place) = self.place(peer) {
            self.beacons.warm_stamp(place);
        }
    }

    /// Whether a peer's own beacon was heard just now.
    pub(crate) fn is_heard_now(&self, peer: DroneId, now: SimTime) -> bool {
        self.get(peer).is_some_and(|known| now.since(known.direct()) <= DIRECT_S)
    }

    /// Whether a peer is heard without a relay.
    pub(crate) fn is_direct(&self, peer: DroneId, now: SimTime) -> bool {
        self.get(peer).is_some_and(|known| known.is_direct(now, self.base))
    }

    /// The peers that are heard without a relay, by id.
    pub(crate) fn direct(&self, now: SimTime) -> impl Iterator<Item = (DroneId, Beacon<'_>)> + Clone {
        let all = now <= self.direct_until;
        self.near(move |place| all || self.beacons.heard(place).is_direct(now, self.base))
    }

    /// Number of peers that may count as heard without a relay.
    pub(crate) fn direct_count(&self) -> usize {
        self.near.len()
    }

    /// The peers whose own beacon was heard within the last `within_s`, by id.
    pub(crate) fn heard_within(&self, now: SimTime, within_s: f64) -> impl Iterator<Item = (DroneId, Beacon<'_>)> {
        self.near(move |place| now.since(self.beacons.heard(place).direct()) <= within_s)
    }

    /// Those of the peers that may count as heard without a relay which do, by id. `counts`: whether the peer at an index does.
    fn near(&self, counts: impl Fn(usize) -> bool + Clone) -> impl Iterator<Item = (DroneId, Beacon<'_>)> + Clone {
        let near = self.near.iter().filter_map(|&id| Some((id, self.place(id).ok()?)));
        let near = near.filter(move |&(_, place)| counts(place));
        near.map(|(id, place)| (id, self.beacons.get(place)))
    }

    /// What drone `me` says in [`Pose::hears`].
    pub(crate) fn hears(&self, me: DroneId, now: SimTime) -> u32 {
        if self.near.len() + 1 >= self.drones as usize && now <= self.direct_until {
            return 0;
        }
        let mut heard = 0;
        let hash = hash_of(self.direct(now).map(|(id, _)| id).inspect(|_| heard += 1).chain([me]));
        if heard == 0 || heard + 1 >= self.drones as usize { 0 } else { hash }
    }

    /// How long a beacon takes to arrive, s: a running mean.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Whether some peer may hear other drones than those with which all drones are heard, or may obey an earlier term in this scope.
    /// This needs no look at each peer.
    pub(crate) fn may_differ(&self, term: Ballot, scope: GroupId) -> bool {
        self.beacons.some_hear_parts() || self.beacons.some_lag(term, scope)
    }

    /// Forgets a peer.
    pub fn forget(&mut self, peer: DroneId) {
        if let Ok(place) = self.place(peer) {
            self.ids.remove(place);
            self.all_but = None;
            self.beacons.remove(place);
            self.quiet.remove(place, self.ids.len());
            self.changes.note_moved(self.ids.len());
            self.near.retain(|near| *near != peer);
        }
    }

    /// Makes all peers members of one group that obeys this plan.
    pub fn unite(&mut self, stamp: PlanStamp) {
        self.beacons.unite(stamp);
    }

    /// Whether the peer is not silent for too long.
    #[must_use]
    pub fn is_living(&self, peer: DroneId, now: SimTime) -> bool {
        self.place(peer).is_ok_and(|place| self.is_living_at(place, now))
    }

    /// The last beacon of a peer, however old.
    #[must_use]
    pub fn last(&self, peer: DroneId) -> Option<Beacon<'_>> {
        self.place(peer).ok().map(|place| self.beacons.get(place))
    }

    /// The time stamp of a peer's last beacon.
    pub(crate) fn stamp_of(&self, peer: DroneId) -> Option<SimTime> {
        self.place(peer).ok().map(|place| self.stamps()[place])
    }

    /// As [`Self::stamp_of`], for many peers in turn.
    #[inline]
    pub(crate) fn stamp_finder(&self) -> impl Fn(DroneId) -> Option<SimTime> + '_ {
        let (stamps, all_but) = (self.stamps(), self.all_but);
        move |peer| match known_place(all_but, stamps.len(), peer) {
            Some(place) => stamps.get(place).copied(),
            None => self.stamp_of(peer),
        }
    }

    /// The last beacon of a peer that is not silent for too long.
    #[must_use]
    pub fn last_of_living(&self, peer: DroneId, now: SimTime) -> Option<Beacon<'_>> {
        let place = self.place(peer).ok().filter(|&place| self.is_living_at(place, now));
        place.map(|place| self.beacons.get(place))
    }

    /// Peers that are not silent for too long, by id.
    pub fn living(&self, now: SimTime) -> impl Iterator<Item = (DroneId, Beacon<'_>)> + Clone {
        let all = self.quiet.are_quiet(now);
        let living = self.all().enumerate().filter(move |&(place, _)| all || self.is_living_at(place, now));
        living.map(|(_, peer)| peer)
    }

    /// Whether certainly every other drone of the swarm was heard and is not silent for too long. This needs no look at each peer.
    #[must_use]
    pub fn are_all_living(&self, now: SimTime) -> bool {
        self.ids.len() + 1 >= self.drones as usize && self.quiet.are_quiet(now)
    }

    /// Peers that were heard once and are silent now, by id. They may still hover somewhere.
    pub fn silent(&self, now: SimTime) -> impl Iterator<Item = (DroneId, Beacon<'_>)> {
        let suspects = self.quiet.suspects(now, self.ids.len());
        suspects.filter(move |&place| !self.beacons.heard(place).lives(now, self.base)).map(|place| self.at(place))
    }

    /// The time stamps of the last beacons of all peers ever heard, by id, without the beacons themselves.
    #[must_use]
    pub fn stamps(&self) -> &[SimTime] {
        self.beacons.stamps()
    }

    /// All peers ever heard, ascending, in the order of [`Self::stamps`].
    pub(crate) fn ids(&self) -> &[DroneId] {
        &self.ids
    }

    /// The changes of [`Self::stamps`].
    #[must_use]
    pub fn changes(&self) -> &Changes {
        &self.changes
    }

    /// All peers ever heard, by id, with their last beacons.
    pub fn all(&self) -> impl Iterator<Item = (DroneId, Beacon<'_>)> + Clone {
        self.ids.iter().copied().zip(self.beacons.iter())
    }

    /// The id and the last beacon of the peer at this index of [`Self::stamps`].
    ///
    /// # Panics
    /// If there is no such peer.
    #[must_use]
    pub fn at(&self, index: usize) -> (DroneId, Beacon<'_>) {
        (self.ids[index], self.beacons.get(index))
    }

    /// Whether the peer at this index of [`Self::stamps`] is not silent for too long.
    ///
    /// # Panics
    /// If there is no such peer.
    #[must_use]
    pub fn is_living_at(&self, index: usize, now: SimTime) -> bool {
        self.quiet.is_quiet(index, now) || self.beacons.heard(index).lives(now, self.base)
    }

    /// Adds how old the last beacons of living peers are, s. Of more than 64 peers it looks at 64, in turn from the one at the index `first`
    /// on, modulo the number of peers.
    pub fn ages_s(&self, now: SimTime, first: u64, ages: &mut Vec<f64>) {
        let count = self.ids.len();
        if count <= AGES && self.quiet.are_quiet(now) {
            ages.extend(self.stamps().iter().map(|stamp| now.since(*stamp)));
            return;
        }
        let first = if count > AGES { (first % count as u64) as usize } else { 0 };
        let places = (first..count).chain(0..first).take(AGES);
        let living = places.filter(|&place| self.is_living_at(place, now));
        ages.extend(living.map(|place| now.since(self.stamps()[place])));
    }
}

/// The index of a peer among `count` peers, if they are the lowest ids but one.
#[inline]
fn known_place(all_but: Option<DroneId>, count: usize, peer: DroneId) -> Option<usize> {
    let missing = all_but.filter(|missing| *missing != peer && peer.index() <= count)?;
    Some(peer.index() - usize::from(peer > missing))
}

/// The id that is missing among the lowest ids, if these ascending ids are all others; `None` if more are missing.
fn lowest_but_one(ids: &[DroneId]) -> Option<DroneId> {
    let missing = ids.iter().zip(0..).find(|&(id, place)| id.0 != place).map_or(ids.len() as u32, |(_, place)| place);
    ids.last().is_none_or(|last| last.index() <= ids.len()).then_some(DroneId(missing))
}

/// A hash of a set of drones, whatever their order; never 0.
fn hash_of(drones: impl Iterator<Item = DroneId>) -> u32 {
    let sum = drones.fold(0_u64, |sum, id| sum.wrapping_add(Digest::chain(1, u64::from(id.0))));
    ((sum >> 32) as u32).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn pose(stamp_s: f64, x: f64) -> Pose {
        Pose {
            stamp: SimTime::from_secs(stamp_s),
            position_m: [x, 0.0, 50.0],
            velocity_mps: [10.0, 0.0, 0.0],
            incarnation: 1,
            ..Pose::zeroed()
        }
    }

    #[test]
    fn an_older_beacon_that_comes_late_is_ignored() {
        let mut peers = Peers::new(4, 1.0);
        let now = SimTime::from_secs(2.0);
        peers.hear(now, DroneId(1), pose(1.5, 5.0));
        peers.hear(now, DroneId(1), pose(1.4, 4.0));
        peers.hear(now, DroneId(1), pose(9.0, 90.0));
        peers.hear(now, DroneId(7), pose(1.5, 5.0));
        assert_eq!(peers.last(DroneId(1)).unwrap().position().x, 5.0);
        assert!(peers.last(DroneId(7)).is_none());
        assert_eq!(peers.last(DroneId(1)).unwrap().extrapolated(now).x, 10.0);
    }

    #[test]
    fn a_silent_peer_is_gone_but_remembered() {
        let mut peers = Peers::new(4, 1.0);
        peers.hear(SimTime::ZERO, DroneId(1), pose(0.0, 0.0));
        assert_eq!(peers.living(SimTime::from_secs(1.0)).count(), 1);
        assert_eq!(peers.living(SimTime::from_secs(1.1)).count(), 0);
        assert_eq!(peers.silent(SimTime::from_secs(1.1)).count(), 1);
    }

    #[test]
    fn where_states_are_passed_on_less_often_only_those_peers_count_as_living_for_longer() {
        let lives_s = |factor, direct: bool| {
            let mut peers = Peers::new(4, 1.0).relayed_less(factor);
            let period_s = if direct { 1.0 } else { factor };
            let last_s = (0..200).map(|state| period_s * f64::from(state)).fold(0.0, |_, at_s| {
                let (now, beacon) = (SimTime::from_secs(at_s), pose(at_s, 0.0));
                if direct {
                    peers.hear(now, DroneId(1), beacon)
                } else {
                    peers.hear_of(now, DroneId(1), beacon)
                }
                at_s
            });
            let lives =
                |silence_s: &u32| peers.is_living(DroneId(1), SimTime::from_secs(last_s + f64::from(*silence_s)));
            (0..1000).take_while(lives).last().unwrap()
        };
        assert_eq!([1.0, 5.0].map(|factor| lives_s(factor, false)), [4, 20]);
        assert_eq!([1.0, 5.0].map(|factor| lives_s(factor, true)), [1, 1]);
    }

    #[test]
    fn all_ids_but_one_are_known_without_a_search() {
        let missing = |ids: &[u32]| lowest_but_one(&ids.iter().map(|id| DroneId(*id)).collect::<Vec<_>>());
        let found = [&[][..], &[0, 1, 2], &[1, 2, 3], &[0, 1, 3], &[0, 2, 4], &[0, 1, 4]].map(missing);
        assert_eq!(found, [Some(0), Some(3), Some(0), Some(2), None, None].map(|id| id.map(DroneId)));
        let mut peers = Peers::new(6, 1.0);
        let now = SimTime::from_secs(3.0);
        for id in [0, 1, 3, 4, 5] {
            peers.hear(now, DroneId(id), pose(2.5, f64::from(id)));
        }
        peers.look_for_silence(now);
        assert_eq!(peers.all_but, Some(DroneId(2)));
        let x = |peers: &Peers, id| peers.last(DroneId(id)).map(|beacon| beacon.position().x);
        assert_eq!(
            [0, 1, 2, 3, 5, 6, u32::MAX].map(|id| x(&peers, id)),
            [Some(0.0), Some(1.0), None, Some(3.0), Some(5.0), None, None]
        );
        peers.forget(DroneId(3));
        assert_eq!([1, 3, 4].map(|id| x(&peers, id)), [Some(1.0), None, Some(4.0)]);
        peers.hear(now, DroneId(2), pose(2.5, 2.0));
        assert_eq!([1, 2, 4].map(|id| x(&peers, id)), [Some(1.0), Some(2.0), Some(4.0)]);
    }

    #[test]
    fn what_is_known_of_all_at_once_agrees_with_a_look_at_each() {
        let mut peers = Peers::new(10, 1.0).relayed_less(2.0);
        let mut was_silent = std::collections::BTreeSet::new();
        let (mut living, mut certain) = (0, 0);
        for tick in 0..600u32 {
            let now = SimTime::from_secs(0.1 * f64::from(tick));
            // Some are far away for a while, and for some of that time no word of them comes.
            let away = |id: u32| (tick / 60 + id) % 3;
            let heard = |id: u32| tick.wrapping_mul(0x9e37_79b9).rotate_left(5 * id) % 16 < 2 + id;
            // Drone 5 falls silent.
            for id in (0..9).filter(|id| heard(*id) && (*id != 5 || tick < 300)) {
                let pose = pose(0.1 * f64::from(tick), 0.0);
                match (id, away(id)) {
                    (3.., 1) if id % 2 == 0 => {}
                    (3.., 1 | 2) => peers.hear_of(now, DroneId(id), pose),
                    _ => peers.hear(now, DroneId(id), pose),
                }
            }
            let silent: Vec<u32> = peers.silent(now).map(|(id, _)| id.0).collect();
            let heard = (0..9).filter(|&id| peers.last(DroneId(id)).is_some());
            let lives = |id: &u32| peers.get(DroneId(*id)).is_some_and(|heard| heard.lives(now, peers.base));
            assert_eq!(silent, heard.filter(|id| !lives(id)).collect::<Vec<_>>(), "tick {tick}");
            let all_living = (0..9).all(|id| lives(&id));
            assert!(all_living || !peers.are_all_living(now), "tick {tick}");
            certain += u32::from(peers.are_all_living(now));
            living += u32::from(all_living);
            was_silent.extend(silent.iter().copied());
            let ages: Vec<f64> = peers.living(now).map(|(_, beacon)| now.since(beacon.stamp())).collect();
            let mut found = Vec::new();
            peers.ages_s(now, 0, &mut found);
            assert_eq!(found, ages);
            let direct: Vec<DroneId> = peers.direct(now).map(|(id, _)| id).collect();
            let hash = if [0, 9].contains(&direct.len()) { 0 } else { hash_of(direct.into_iter().chain([DroneId(9)])) };
            assert_eq!(peers.hears(DroneId(9), now), hash, "tick {tick}");
            let finder = peers.stamp_finder();
            assert!((0..12).map(DroneId).all(|id| finder(id) == peers.last(id).map(|beacon| beacon.stamp())));
            assert_eq!(peers.living(now).count() + silent.len(), peers.stamps().len());
        }
        assert!(was_silent.len() > 1 && was_silent.len() < 9, "{was_silent:?}");
        assert!(2 * certain > living && certain < 300, "{certain} of {living}");
        assert!(!peers.is_living(DroneId(5), SimTime::from_secs(60.0)));
        peers.forget(DroneId(5));
        assert!(peers.last(DroneId(5)).is_none() && peers.last(DroneId(6)).is_some());
    }

    #[test]
    fn the_ages_of_many_peers_are_told_in_turn() {
        let mut peers = Peers::new(200, 1.0);
        let now = SimTime::from_secs(2.0);
        (0..200).for_each(|id| peers.hear(now, DroneId(id), pose(1.0 + 0.005 * f64::from(id), 0.0)));
        let told = |first| {
            let mut ages_s = Vec::new();
            peers.ages_s(now, first, &mut ages_s);
            ages_s.iter().map(|age_s| ((1.0 - age_s) / 0.005).round() as u32).collect::<Vec<_>>()
        };
        assert_eq!(told(100), (100..164).collect::<Vec<_>>());
        assert_eq!(told(200 + 180), (180..200).chain(0..44).collect::<Vec<_>>());
    }

    #[test]
    fn a_peer_that_falls_silent_is_missed_as_soon_as_it_does_not_count_as_heard() {
        let mut peers = Peers::new(5, 1.0);
        let mut missed = 0;
        for tick in 1..1200_u32 {
            let now = SimTime::from_secs(0.01 * f64::from(tick));
            // Drone 3 falls silent at 10 s.
            for id in (0..4).filter(|id| tick.is_multiple_of(10) && (*id != 3 || tick <= 1000)) {
                peers.hear(now, DroneId(id), pose(0.01 * f64::from(tick), 0.0));
            }
            let direct: Vec<DroneId> = peers.direct(now).map(|(id, _)| id).collect();
            let hash = if [0, 4].contains(&direct.len()) { 0 } else { hash_of(direct.into_iter().chain([DroneId(4)])) };
            assert_eq!(peers.hears(DroneId(4), now), hash, "tick {tick}");
            assert!(peers.direct_until >= now || !(100..1090).contains(&tick), "no look at each: tick {tick}");
            missed += u32::from(hash != 0);
        }
        assert!((90..110).contains(&missed), "{missed}");
    }

    #[test]
    fn delay_is_not_silence_and_a_lossy_link_has_a_longer_timeout() {
        let mut peers = Peers::new(4, 0.4);
        let mut heard = 0.0;
        for i in 0..2000u32 {
            // Half of the beacons are lost.
            heard += 0.1 * f64::from(1 + i.wrapping_mul(0x9e37_79b9).leading_zeros());
            peers.hear(SimTime::from_secs(heard), DroneId(1), pose(heard - 0.1, 0.0));
        }
        assert!(peers.is_living(DroneId(1), SimTime::from_secs(heard + 1.5)));
        assert!(!peers.is_living(DroneId(1), SimTime::from_secs(heard + 4.0)));
    }

    #[test]
    fn a_high_incarnation_does_not_suppress_later_beacons() {
        let mut peers = Peers::new(4, 1.0);
        let now = SimTime::from_secs(3.0);
        peers.hear(now, DroneId(1), Pose { incarnation: u32::MAX, ..pose(1.0, 1.0) });
        peers.hear(now, DroneId(1), pose(2.0, 2.0));
        assert_eq!(peers.last(DroneId(1)).unwrap().position().x, 2.0);
    }
}
