//! Return of a drone that waits in vain for others that it has lost: where radios do not reach far, it flies back to where it heard them
//! last, or to where it ranges them. Drones that keep apart by words cannot go on past each other's lines until they hear each other again
//! (docs/safety.md). Drones that range each other can, but parts of a swarm that settled out of each other's reach would stay apart.

use crate::tuning::{IN_REACH, LEAD_FOUND_S, LOOK_FOR_LOST_S, LOST_PACE};
use skein_leader::beacons::Beacon;
use skein_leader::params::PlannerParams;
use skein_leader::peers::Peers;
use skein_protocol::downlink::Senses;
use skein_protocol::{DroneId, SimTime, Vec2};
use std::cmp::Reverse;

/// The patience is doubled at most this many times.
const MOST_DOUBLINGS: u32 = 2;
/// By words, a drone waits where it looks for a lost one for this many times its patience. So it is there when the lost one comes, which
/// looks for it after the same time.
const WAITS: f64 = 2.0;
/// By ranging, a drone waits there for this long, s: it would range the lost one.
const LOOK_S: f64 = 10.0;
/// By ranging, a drone has this many times the patience: the others can go on.
const RANGING_PATIENCE: f64 = 3.0;
/// By ranging, a drone that hears more drones than it has lost waits this many times its patience longer: the lost ones may be dead, and while
/// it looks for them it leaves a gap.
const MAJORITY_TURNS: u32 = 3;
/// A beacon that is older than this does not show how a drone flies now, s.
const OLD_S: f64 = 3.0;
/// A flight back may take this many times as long as a straight flight would.
const DETOUR_FACTOR: f64 = 3.0;

/// The other drones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Others<'a> {
    /// This drone.
    pub(crate) me: DroneId,
    /// What it has heard of the others.
    pub(crate) peers: &'a Peers,
    /// Where each drone started, by id, world frame, m; none if a drone does not know that.
    pub(crate) starts_m: &'a [Vec2],
    /// Deceleration of full braking, m/s².
    pub(crate) braking_mps2: f64,
    /// Distance over which drones hear each other, m; infinite without a limit. Then none is lost.
    pub(crate) range_m: f64,
    /// Whether it keeps apart from them by words.
    pub(crate) by_words: bool,
}

impl Others<'_> {
    /// The drones that are lost: those that are ranged but too far away to be heard, and those that are neither ranged nor heard.
    fn lost(&self, senses: &Senses<'_>) -> impl Iterator<Item = Lost> {
        self.ranged(senses).chain(self.unseen(senses))
    }

    /// The drones that are ranged but too far away to be heard.
    fn ranged(&self, senses: &Senses<'_>) -> impl Iterator<Item = Lost> {
        let now = senses.now;
        let silent = senses.neighbours.iter().filter(move |seen| !self.peers.is_living(seen.drone, now));
        let far = silent.filter(|seen| seen.position().norm() > IN_REACH * self.range_m);
        far.map(move |seen| Lost { drone: seen.drone, since: now, place: senses.position() + seen.position() })
    }

    /// Where to look for a drone, world frame, m: where it is ranged, but only into its reach; or else `place`.
    fn place_of(&self, lost: DroneId, senses: &Senses<'_>, place: Vec2) -> Vec2 {
        let Some(seen) = senses.neighbours.iter().find(|seen| seen.drone == lost) else { return place };
        let is_far = seen.position().norm() > IN_REACH * self.range_m;
        senses.position() + if is_far { seen.position() } else { Vec2::zeros() }
    }

    /// How many living drones are closer to where a lost one may be (world frame, m): those look for it first. By words, drones do not wait for
    /// each other: two that have lost each other look at the same time.
    fn closer(&self, place: Vec2, senses: &Senses<'_>) -> u32 {
        let own_m = (place - senses.position()).norm();
        let living = self.peers.living(senses.now).filter(|_| !self.by_words);
        living.map(|(_, pose)| u32::from((place - pose.position()).norm() < own_m)).sum()
    }

    /// How many turns longer a drone waits that hears more drones than it has lost: those that have lost more look for the others first.
    fn majority_turns(&self, senses: &Senses<'_>, lost: usize) -> u32 {
        let hears_most = !self.by_words && self.peers.living(senses.now).count() > lost;
        if hears_most { MAJORITY_TURNS } else { 0 }
    }

    /// The drones that are neither ranged nor heard.
    fn unseen(&self, senses: &Senses<'_>) -> impl Iterator<Item = Lost> {
        let silent = self.peers.silent(senses.now);
        let stopped = move |pose: Beacon<'_>| pose.stopped(self.braking_mps2);
        let heard = silent.map(move |(drone, pose)| Lost { drone, since: pose.stamp(), place: stopped(pose) });
        let started = (0..).map(DroneId).zip(self.starts_m).filter(|(drone, _)| *drone != self.me);
        let unheard = started.filter(|(drone, _)| self.peers.last(*drone).is_none());
        let unheard = unheard.map(|(drone, &place)| Lost { drone, since: SimTime::ZERO, place });
        heard.chain(unheard).filter(|lost| !senses.neighbours.iter().any(|seen| seen.drone == lost.drone))
    }
}

/// Where a drone that was found is by now, world frame, m. What is passed on may be old: it does not fly on as it did then.
fn expected(pose: Beacon<'_>, now: SimTime) -> Vec2 {
    pose.position() + pose.velocity() * now.since(pose.stamp()).min(OLD_S)
}

/// A lost drone.
#[derive(Clone, Copy, Debug)]
struct Lost {
    drone: DroneId,
    /// When it was ranged or heard last.
    since: SimTime,
    /// Where it is ranged, or would have stopped when it was heard last, world frame, m.
    place: Vec2,
}

/// Looks for lost drones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reunion {
    /// Nominal speed, m/s.
    speed_mps: f64,
    /// How long the drone waits in one place before it looks for a lost one for the first time, s.
    patience_s: f64,
    task: Task,
    /// Number of flights that found no drone since the last that did.
    failed: u32,
}

/// What a drone does about lost ones.
#[derive(Clone, Copy, Debug)]
enum Task {
    /// Nothing: the drone goes its own way. Where it has been since when, world frame, m.
    Own { stay: Option<(SimTime, Vec2)> },
    /// It flies to where a lost drone is ranged, or else to where it was heard last: `place`, world frame, m.
    Look { lost: DroneId, place: Vec2, until: SimTime },
    /// It goes its own way no faster than the drone that it has found.
    Lead { found: DroneId, until: SimTime },
}

impl Reunion {
    /// That of one drone in a swarm of `drones`.
    pub(crate) fn new(drones: u32, planner: &PlannerParams) -> Self {
        Self {
            speed_mps: planner.speed_mps,
            // If all drones wait one behind another, the last one has passed.
            patience_s: LOOK_FOR_LOST_S + planner.file_s(drones),
            task: Task::Own { stay: None },
            failed: 0,
        }
    }

    /// The place to fly back to, world frame, m. `None` while the drone goes its own way.
    pub(crate) fn place(&mut self, senses: &Senses<'_>, others: &Others<'_>) -> Option<Vec2> {
        if others.range_m.is_infinite() {
            return None;
        }
        let (now, position) = (senses.now, senses.position());
        match self.task {
            Task::Own { stay } => self.wait(senses, others, stay),
            Task::Look { lost, place, until } => {
                if others.peers.is_living(lost, now) {
                    (self.task, self.failed) = (Task::Lead { found: lost, until: now.after(LEAD_FOUND_S) }, 0);
                } else if now < until {
                    if !others.by_words && (place - position).norm() <= IN_REACH * others.range_m {
                        self.task = Task::Look { lost, place, until: until.min(now.after(LOOK_S)) };
                    }
                    return Some(others.place_of(lost, senses, place));
                } else {
                    (self.task, self.failed) = (Task::Own { stay: None }, self.failed + 1);
                }
                None
            }
            Task::Lead { found, until } => {
                if let Some(lost) = others.lost(senses).find(|lost| lost.drone == found) {
                    return Some(self.look_for(&lost, now, position, others.by_words));
                }
                if now >= until {
                    self.task = Task::Own { stay: None };
                }
                let place = expected(others.peers.last_of_living(found, now)?, now);
                Some(place).filter(|place| (place - position).norm() > IN_REACH * others.range_m)
            }
        }
    }

    /// Waits for a while in one place before it looks for a lost drone: the one heard last first, and another one each time.
    fn wait(&mut self, senses: &Senses<'_>, others: &Others<'_>, stay: Option<(SimTime, Vec2)>) -> Option<Vec2> {
        let (now, position) = (senses.now, senses.position());
        let near_m = LOST_PACE * self.speed_mps * LOOK_FOR_LOST_S;
        let stay = stay.filter(|(_, place)| (position - place).norm() <= near_m).unwrap_or((now, position));
        self.task = Task::Own { stay: Some(stay) };
        if now.since(stay.0) < self.patience_s(others.by_words) {
            return None;
        }
        let mut lost: Vec<Lost> = others.lost(senses).collect();
        lost.sort_by_key(|lost| (Reverse(lost.since), lost.drone));
        let Some(next) = lost.get(self.failed as usize % lost.len().max(1)) else {
            self.task = Task::Own { stay: None };
            return None;
        };
        let turn = others.closer(next.place, senses) + others.majority_turns(senses, lost.len());
        if now.since(stay.0) < f64::from(1 + turn) * self.patience_s(others.by_words) {
            return None;
        }
        Some(self.look_for(next, now, position, others.by_words))
    }

    /// Waits no longer: the drone is in a queue that moves without word from others.
    pub(crate) fn rest(&mut self) {
        self.task = Task::Own { stay: None };
    }

    /// How long the drone waits in one place before it looks for a lost one, s.
    fn patience_s(&self, by_words: bool) -> f64 {
        let times = if by_words { 1.0 } else { RANGING_PATIENCE };
        times * self.patience_s * f64::from(1 << self.failed.min(MOST_DOUBLINGS))
    }

    /// Begins to fly to where a lost drone may be.
    fn look_for(&mut self, lost: &Lost, now: SimTime, position: Vec2, by_words: bool) -> Vec2 {
        let flight_s = DETOUR_FACTOR * (lost.place - position).norm() / self.speed_mps;
        let look_s = if by_words { WAITS * self.patience_s(true) } else { LOOK_S };
        self.task = Task::Look { lost: lost.drone, place: lost.place, until: now.after(flight_s + look_s) };
        lost.place
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::downlink::SensedNeighbour;
    use skein_protocol::payload::Pose;

    const RANGE_M: f64 = 100.0;

    /// Drone 1 of two.
    struct Searcher {
        reunion: Reunion,
        peers: Peers,
        starts_m: Vec<Vec2>,
        range_m: f64,
        by_words: bool,
    }

    impl Searcher {
        fn new(range_m: f64) -> Self {
            let reunion = Reunion::new(2, &crate::test_params::planner());
            Self { reunion, peers: Peers::new(3, 1.0), starts_m: Vec::new(), range_m, by_words: true }
        }

        /// Hears drone 0 at this abscissa, m, at this speed, m/s.
        fn hear(&mut self, now_s: f64, x_m: f64, speed_mps: f64) {
            let now = SimTime::from_secs(now_s);
            let (position_m, velocity_mps) = ([x_m, 0.0, 0.0], [speed_mps, 0.0, 0.0]);
            self.peers.hear(now, DroneId(0), Pose { stamp: now, position_m, velocity_mps, ..Pose::zeroed() });
        }

        /// Hears of drone 0 as it was `old_s` ago, at this abscissa, m, at this speed, m/s.
        fn hear_late(&mut self, now_s: f64, old_s: f64, x_m: f64, speed_mps: f64) {
            let (stamp, now) = (SimTime::from_secs(now_s - old_s), SimTime::from_secs(now_s));
            let (position_m, velocity_mps) = ([x_m, 0.0, 0.0], [speed_mps, 0.0, 0.0]);
            self.peers.hear_of(now, DroneId(0), Pose { stamp, position_m, velocity_mps, ..Pose::zeroed() });
        }

        /// Where it looks for drone 0, if it is at this abscissa, m.
        fn looks_at(&mut self, now_s: f64, x_m: f64) -> Option<f64> {
            self.looks_at_seen(now_s, x_m, &[])
        }

        /// The same, if it ranges these drones.
        fn looks_at_seen(&mut self, now_s: f64, x_m: f64, seen: &[SensedNeighbour]) -> Option<f64> {
            let at = ([x_m, 0.0, 0.0], [0.0; 3]);
            let senses = Senses::new((0, SimTime::from_secs(now_s)), at, &[], seen, &[]);
            let others = Others {
                me: DroneId(1),
                peers: &self.peers,
                starts_m: &self.starts_m,
                braking_mps2: 5.0,
                range_m: self.range_m,
                by_words: self.by_words,
            };
            self.reunion.place(&senses, &others).map(|place| place.x)
        }
    }

    /// The times from 1 s to 59 s at which a drone at these places looks for the other one, which it heard last at 0 s.
    fn times(range_m: f64, place: impl Fn(f64) -> f64) -> Vec<u32> {
        let mut searcher = Searcher::new(range_m);
        searcher.hear(0.0, -50.0, 0.0);
        (1..60).filter(|&second| searcher.looks_at(second.into(), place(second.into())).is_some()).collect()
    }

    #[test]
    fn a_drone_that_waits_flies_to_where_it_heard_a_lost_one_last() {
        // It waits for 30 s and a headway of 4 s for each drone.
        assert_eq!(times(RANGE_M, |_| 0.0), (39..60).collect::<Vec<_>>());
        assert_eq!(times(f64::INFINITY, |_| 0.0), [0; 0], "all drones hear each other");
        assert_eq!(times(RANGE_M, |second| 5.0 * second), [0; 0], "it is on its way");
    }

    #[test]
    fn a_drone_looks_where_the_lost_one_would_have_stopped_or_where_it_started() {
        let mut searcher = Searcher::new(RANGE_M);
        searcher.hear(0.0, -50.0, 10.0);
        assert_eq!(searcher.looks_at(1.0, 0.0), None);
        assert_eq!(searcher.looks_at(40.0, 0.0), Some(-40.0));
        let mut searcher = Searcher { starts_m: vec![Vec2::new(-70.0, 0.0), Vec2::zeros()], ..Searcher::new(RANGE_M) };
        assert_eq!(searcher.looks_at(1.0, 0.0), None);
        assert_eq!(searcher.looks_at(40.0, 0.0), Some(-70.0));
    }

    #[test]
    fn a_drone_that_found_a_lost_one_stays_in_its_reach() {
        let mut searcher = Searcher::new(RANGE_M);
        searcher.hear(0.0, -50.0, 0.0);
        searcher.looks_at(1.0, 0.0);
        assert_eq!(searcher.looks_at(40.0, 0.0), Some(-50.0));
        searcher.hear(41.0, -60.0, 0.0);
        assert_eq!(searcher.looks_at(41.0, 0.0), None);
        assert_eq!(searcher.looks_at(41.1, 0.0), None, "60 m away");
        assert_eq!(searcher.looks_at(41.2, 20.0), Some(-60.0), "80 m away");
        assert_eq!(searcher.looks_at(45.0, 0.0), Some(-60.0), "it is lost again");
    }

    #[test]
    fn a_drone_that_finds_nobody_waits_longer_than_the_other_one_before_it_gives_up() {
        let mut searcher = Searcher::new(RANGE_M);
        searcher.hear(0.0, -50.0, 0.0);
        let looks: Vec<bool> = (1..400).map(|second| searcher.looks_at(second.into(), 0.0).is_some()).collect();
        let stretches: Vec<(bool, usize)> = looks.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect();
        assert_eq!(stretches, [(false, 38), (true, 91), (false, 77), (true, 167), (false, 26)]);
    }

    #[test]
    fn a_drone_that_ranges_has_more_patience_and_looks_once() {
        let mut searcher = Searcher { by_words: false, ..Searcher::new(RANGE_M) };
        searcher.hear(0.0, -50.0, 0.0);
        let looks: Vec<i32> = (1..200).filter(|&second| searcher.looks_at(second.into(), 0.0).is_some()).collect();
        assert_eq!(looks, (115..126).collect::<Vec<_>>(), "it would hear the lost one from where it is");
        let mut searcher = Searcher { by_words: false, ..Searcher::new(RANGE_M) };
        searcher.hear(0.0, -50.0, 0.0);
        let queues = (1..200).filter(|&second| {
            searcher.reunion.rest();
            searcher.looks_at(second.into(), 0.0).is_some()
        });
        assert_eq!(queues.count(), 0);
    }

    #[test]
    fn the_drone_that_is_closest_to_a_lost_one_looks_for_it_first() {
        let looks = |other_x_m: f64, by_words: bool| {
            let mut searcher = Searcher { by_words, ..Searcher::new(RANGE_M) };
            searcher.hear(0.0, -50.0, 0.0);
            let mut look = |second: u32| {
                let now = SimTime::from_secs(second.into());
                let other = Pose { stamp: now, position_m: [other_x_m, 0.0, 0.0], ..Pose::zeroed() };
                searcher.peers.hear(now, DroneId(2), other);
                searcher.looks_at(second.into(), 0.0)
            };
            (1..400).find_map(|second| look(second).map(|_| second))
        };
        let [behind, ahead] = [20.0, -20.0].map(|x_m| looks(x_m, false));
        assert_eq!((behind, ahead), (Some(115), Some(229)));
        assert_eq!(looks(-20.0, true), looks(20.0, true), "by words, drones that have lost each other meet");
    }

    #[test]
    fn a_drone_that_is_where_the_lost_one_was_waits_there_for_ten_seconds() {
        let mut searcher = Searcher { by_words: false, ..Searcher::new(RANGE_M) };
        searcher.hear(0.0, -2000.0, 0.0);
        let there = |second: u32| if second < 300 { 0.0 } else { -2000.0 };
        let looks = (1..500).filter(|&second| searcher.looks_at(second.into(), there(second)).is_some());
        assert_eq!(looks.collect::<Vec<_>>(), (115..310).collect::<Vec<_>>());
    }

    #[test]
    fn a_drone_does_not_follow_one_that_it_found_farther_than_it_can_have_heard_it_fly() {
        let mut searcher = Searcher::new(RANGE_M);
        searcher.hear(0.0, -50.0, 0.0);
        searcher.looks_at(1.0, 0.0);
        assert_eq!(searcher.looks_at(40.0, 0.0), Some(-50.0));
        // What it hears is passed on, and 20 s old from then on. The drone flew at 10 m/s.
        (0..20).for_each(|beacon| searcher.hear_late(40.0 + f64::from(beacon), 20.0, -60.0, 10.0));
        assert_eq!(searcher.looks_at(60.0, 0.0), None);
        assert_eq!(
            searcher.looks_at(60.1, 0.0),
            None,
            "it was 60 m away, and flew 30 m at most before it was heard no more"
        );
    }

    /// Where drone 1, which stands at x = 0, looks for a drone that it ranges at this abscissa, m, but does not hear, at each second.
    fn looks_at_ranged(x_m: f64, hears_from_s: u32) -> Vec<(u32, f64)> {
        let mut searcher = Searcher { by_words: false, ..Searcher::new(RANGE_M) };
        let mut looks = Vec::new();
        for second in 1..=200 {
            if second >= hears_from_s {
                searcher.hear(second.into(), x_m, 0.0);
            }
            let seen = [SensedNeighbour { drone: DroneId(0), position_m: [x_m, 0.0, 0.0], ..Zeroable::zeroed() }];
            looks.extend(searcher.looks_at_seen(second.into(), 0.0, &seen).map(|x_m| (second, x_m)));
        }
        looks
    }

    #[test]
    fn a_drone_comes_into_reach_of_one_that_it_ranges_but_does_not_hear() {
        let far = looks_at_ranged(90.0, 1000);
        // It has three times the patience. The flight may take 27 s, and it waits for 10 s.
        assert_eq!(far, (115..152).map(|second| (second, 90.0)).collect::<Vec<_>>());
        assert_eq!(looks_at_ranged(70.0, 1000), [], "that drone would be heard, if it could speak");
        assert_eq!(looks_at_ranged(90.0, 1), [], "it is heard");
        let found = looks_at_ranged(90.0, 130);
        assert_eq!(found[..15], far[..15]);
        assert!(found[15..].iter().all(|(second, _)| (130..191).contains(second)), "it stays in reach for a minute");
    }
}
