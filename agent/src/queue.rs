//! The queue of drones on a shared route. The foremost drone has precedence; the others merge behind it (paper, results).

use skein_leader::beacons::Beacon;
use skein_leader::peers::Peers;
use skein_protocol::SimTime;
use skein_protocol::payload::QueuePlace;

/// A drone ahead in a queue, as far as this drone knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// Its place in the queue, from 0.
    pub rank: u16,
    /// Path that it still has to fly to the gate, m; negative past the gate.
    pub remaining_m: f64,
}

/// What the speed in a queue depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueueParams {
    /// h: time between two drones at a gate, s.
    pub headway_s: f64,
    /// v: nominal speed, m/s.
    pub speed_mps: f64,
    /// δ: a queued drone flies no slower than v − δ, m/s.
    pub speed_change_mps: f64,
}

/// The speed at which a drone with `remaining_m` to the gate arrives one headway after the drone before it, m/s:
/// t₁ = s₁/v, t_k = max(s_k/v, t_{k−1} + h), speed s/t, within [v − δ, v]. A drone past the gate was there at s_k/v, whenever those before
/// it arrive. Past the gate the speed is v.
#[must_use]
pub fn queue_speed(queue: &[Ahead], remaining_m: f64, params: &QueueParams) -> f64 {
    let QueueParams { headway_s, speed_mps, speed_change_mps } = *params;
    let free = |s: f64| s / speed_mps;
    let next = |t: f64, s: f64| free(s).max(if s > 0.0 { t + headway_s } else { t });
    let before = queue.iter().fold(f64::NEG_INFINITY, |t, one| next(t, one.remaining_m));
    let mine = free(remaining_m).max(before + headway_s);
    if remaining_m <= 0.0 || mine <= 1e-6 {
        return speed_mps;
    }
    (remaining_m / mine).clamp(speed_mps - speed_change_mps, speed_mps)
}

/// What the last beacon of a peer says about a queue that this drone is in as well.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Queued {
    /// The peer's index of [`Peers::stamps`].
    peer: u32,
    stamp: SimTime,
    speed_mps: f64,
    place: QueuePlace,
}

/// Finds the speed of a drone that stands in one or several queues.
#[derive(Clone, Debug, Default)]
pub(crate) struct QueuePacer {
    /// This drone's places when it looked last.
    mine: Vec<QueuePlace>,
    /// Number of changes of the peers when it looked last; `None` if it has to look at all of them.
    seen: Option<usize>,
    /// The places of peers before one of `mine`, by rank. All other places are of no interest, so they are not kept.
    before: Vec<Queued>,
    /// The ranks of `before`, in the same order. Apart from it, so that a search touches little memory.
    ranks: Vec<u16>,
    /// By the index of a peer: how many entries of `before` are its own.
    entries: Vec<u8>,
    /// Memory for the queue that is looked at.
    ahead: Vec<Ahead>,
}

impl QueuePacer {
    /// The lowest speed that one of the queues asks for, m/s; infinite if there is none.
    pub(crate) fn speed_mps(
        &mut self,
        places: impl Iterator<Item = QueuePlace> + Clone,
        peers: &Peers,
        now: SimTime,
        params: impl Fn(QueuePlace) -> QueueParams,
    ) -> f64 {
        self.follow(places.clone(), peers);
        let mut speed = f64::INFINITY;
        for place in places {
            self.collect_ahead(place, peers, now);
            speed = speed.min(queue_speed(&self.ahead, place.remaining_m, &params(place)));
        }
        speed
    }

    /// Whether no living drone before this place has still to reach the gate, as far as it was heard in [`Self::speed_mps`].
    pub(crate) fn is_first(&mut self, place: QueuePlace, peers: &Peers, now: SimTime) -> bool {
        self.collect_ahead(place, peers, now);
        self.ahead.iter().all(|one| one.remaining_m <= 0.0)
    }

    /// Takes over the beacons that are new, and all of them if the places of this drone or the peers are others.
    fn follow(&mut self, places: impl Iterator<Item = QueuePlace> + Clone, peers: &Peers) {
        let key = |place: &QueuePlace| (place.set, place.route, place.rank);
        if !places.clone().map(|place| key(&place)).eq(self.mine.iter().map(key)) {
            self.mine.clear();
            self.mine.extend(places);
            self.seen = None;
        }
        if self.mine.is_empty() {
            return;
        }
        let changes = peers.changes();
        let changed = self.seen.and_then(|seen| changes.since(seen));
        self.seen = Some(changes.count());
        if let Some(changed) = changed {
            changed.for_each(|index| self.note(index as u32, &peers.at(index).1));
            return;
        }
        self.before.clear();
        self.ranks.clear();
        self.entries.clear();
        self.entries.resize(peers.stamps().len(), 0);
        peers.all().zip(0..).for_each(|((_, pose), index)| self.note(index, &pose));
    }

    /// Notes the places of a peer that are before one of this drone's.
    fn note(&mut self, peer: u32, pose: &Beacon<'_>) {
        let mine = &self.mine;
        let is_before = |place: &QueuePlace| mine.iter().any(|own| is_ahead(place, own));
        let places = pose.queue().filter(is_before);
        let news = places.map(|place| Queued { peer, stamp: pose.stamp(), speed_mps: pose.velocity().norm(), place });
        let known = self.entries[peer as usize];
        if known == 1
            && let (Some(new), 1) = (news.clone().next(), news.clone().count())
            && let Some(at) = self.find(peer, new.place.rank)
        {
            self.before[at] = new;
            return;
        }
        if known > 0 {
            self.before.retain(|known| known.peer != peer);
            self.ranks.clear();
            self.ranks.extend(self.before.iter().map(|known| known.place.rank));
            self.entries[peer as usize] = 0;
        }
        for new in news {
            let at = self.ranks.partition_point(|rank| *rank <= new.place.rank);
            self.before.insert(at, new);
            self.ranks.insert(at, new.place.rank);
            self.entries[peer as usize] += 1;
        }
    }

    /// The index in `before` of a peer's entry with this rank.
    fn find(&self, peer: u32, rank: u16) -> Option<usize> {
        let first = self.ranks.partition_point(|known| *known < rank);
        let same = self.ranks[first..].iter().take_while(|known| **known == rank).count();
        (first..first + same).find(|at| self.before[*at].peer == peer)
    }

    /// Collects the living peers with a place before `mine` on the same route of the same set, sorted by rank. The remaining
    /// path in a beacon is shortened by what the peer has flown since it sent the beacon.
    fn collect_ahead(&mut self, mine: QueuePlace, peers: &Peers, now: SimTime) {
        self.ahead.clear();
        for known in self.before.iter().filter(|known| is_ahead(&known.place, &mine)) {
            if peers.is_living_at(known.peer as usize, now) {
                let flown_m = known.speed_mps * now.since(known.stamp);
                let remaining_m = known.place.remaining_m - flown_m;
                self.ahead.push(Ahead { rank: known.place.rank, remaining_m });
            }
        }
        self.ahead.sort_unstable_by(|a, b| a.rank.cmp(&b.rank).then(a.remaining_m.total_cmp(&b.remaining_m)));
    }
}

/// Whether a place is before another one on the same route of the same set.
fn is_ahead(place: &QueuePlace, mine: &QueuePlace) -> bool {
    place.set == mine.set && place.route == mine.route && place.rank < mine.rank
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::DroneId;
    use skein_protocol::payload::Pose;

    const PARAMS: QueueParams = QueueParams { headway_s: 4.0, speed_mps: 10.0, speed_change_mps: 5.0 };

    fn ahead(rank: u16, remaining_m: f64) -> Ahead {
        Ahead { rank, remaining_m }
    }

    #[test]
    fn the_first_flies_at_nominal_speed_and_the_second_leaves_a_headway() {
        assert_eq!(queue_speed(&[], 100.0, &PARAMS), 10.0);
        // The first passes in 10 s, so the second is due after 14 s: 126 m in 14 s.
        assert!((queue_speed(&[ahead(0, 100.0)], 126.0, &PARAMS) - 9.0).abs() < 1e-12);
        // Already far enough behind.
        assert_eq!(queue_speed(&[ahead(0, 100.0)], 150.0, &PARAMS), 10.0);
    }

    #[test]
    fn delays_add_up_and_the_speed_stays_within_its_band() {
        let three = [ahead(0, 100.0), ahead(1, 100.0), ahead(2, 100.0)];
        assert!((queue_speed(&three, 154.0, &PARAMS) - 7.0).abs() < 1e-12);
        assert_eq!(queue_speed(&three, 50.0, &PARAMS), 5.0);
    }

    #[test]
    fn only_living_drones_ahead_in_the_same_queue_count() {
        let now = SimTime::from_secs(10.0);
        let place = |route, rank| QueuePlace { remaining_m: 100.0, set: 7, route, rank };
        let none = QueuePlace::default();
        let mut peers = Peers::new(8, 1.0);
        let hear = |peers: &mut Peers, id, at_s, queue| {
            let (stamp, velocity_mps) = (SimTime::from_secs(at_s), [10.0, 0.0, 0.0]);
            peers.hear(stamp, DroneId(id), Pose { stamp, velocity_mps, queue, ..Pose::zeroed() });
        };
        let mut pacer = QueuePacer::default();
        let mut queue = |peers: &Peers| {
            pacer.speed_mps([place(1, 5)].into_iter(), peers, now, |_| PARAMS);
            pacer.ahead.clone()
        };
        hear(&mut peers, 0, 9.5, [place(1, 2), none]);
        hear(&mut peers, 1, 10.0, [none, place(1, 0)]);
        hear(&mut peers, 2, 10.0, [place(0, 1), QueuePlace { set: 8, ..place(1, 1) }]);
        hear(&mut peers, 3, 5.0, [place(1, 1), none]);
        hear(&mut peers, 4, 10.0, [place(1, 9), none]);
        assert_eq!(queue(&peers), [ahead(0, 100.0), ahead(2, 95.0)]);
        hear(&mut peers, 0, 10.0, [place(1, 3), none]);
        assert_eq!(queue(&peers), [ahead(0, 100.0), ahead(3, 100.0)]);
        hear(&mut peers, 5, 10.0, [place(1, 4), none]);
        assert_eq!(queue(&peers).len(), 3);
    }

    #[test]
    fn what_is_kept_of_the_beacons_agrees_with_a_look_at_all() {
        let mut peers = Peers::new(12, 1.0);
        let mut pacer = QueuePacer::default();
        for step in 0..3000_u32 {
            let draw =
                |salt: u32, below: u32| (step.wrapping_mul(0x9e37_79b9) ^ salt.wrapping_mul(0x85eb_ca6b)) % below;
            let stamp = SimTime::from_secs(0.01 * f64::from(step + 1));
            let place = |salt| QueuePlace {
                remaining_m: f64::from(draw(salt, 97)),
                set: 7 * u32::from(draw(salt + 1, 3) > 0),
                route: draw(salt + 2, 2) as u16,
                rank: draw(salt + 3, 5) as u16,
            };
            let queue = [place(10), place(20)];
            peers.hear(stamp, DroneId(draw(30, 12)), Pose { stamp, queue, ..Pose::zeroed() });
            let places = [0, 1].map(|route| QueuePlace { remaining_m: 300.0, set: 7, route, rank: 4 });
            let mut anew = QueuePacer::default();
            for place in places {
                pacer.speed_mps(places.into_iter(), &peers, stamp, |_| PARAMS);
                pacer.collect_ahead(place, &peers, stamp);
                anew.speed_mps(places.into_iter(), &peers, stamp, |_| PARAMS);
                anew.collect_ahead(place, &peers, stamp);
                assert_eq!(pacer.ahead, anew.ahead, "step {step}");
            }
        }
    }

    #[test]
    fn a_drone_is_first_once_all_before_it_are_past_the_gate_or_have_given_up() {
        let now = SimTime::from_secs(10.0);
        let place = |remaining_m, rank| QueuePlace { remaining_m, set: 7, route: 1, rank };
        let mut peers = Peers::new(4, 1.0);
        let (mut pacer, mut heard_s) = (QueuePacer::default(), 9.0);
        let mut is_first_with = |theirs| {
            heard_s += 0.1;
            let stamp = SimTime::from_secs(heard_s);
            peers.hear(stamp, DroneId(0), Pose { stamp, queue: [theirs, QueuePlace::default()], ..Pose::zeroed() });
            pacer.speed_mps([place(80.0, 3)].into_iter(), &peers, now, |_| PARAMS);
            pacer.is_first(place(80.0, 3), &peers, now)
        };
        assert!(!is_first_with(place(30.0, 2)));
        assert!(is_first_with(place(-5.0, 2)));
        assert!(!is_first_with(place(30.0, 0)));
        assert!(is_first_with(place(30.0, QueuePlace::NO_RANK)));
    }

    #[test]
    fn past_the_gate_no_drone_waits() {
        assert_eq!(queue_speed(&[ahead(0, 5.0)], -1.0, &PARAMS), 10.0);
        // A drone that passed long ago delays no other.
        assert_eq!(queue_speed(&[ahead(0, -60.0)], 10.0, &PARAMS), 10.0);
    }
}
