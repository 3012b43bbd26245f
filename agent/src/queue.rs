//! The queue of drones on a shared route. The foremost drone has precedence; the others merge behind it (paper, results).

use skein_leader::peers::Peers;
use skein_protocol::SimTime;
use skein_protocol::payload::{MAX_PLACES, Pose, QueuePlace};

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
/// t₁ = s₁/v, t_k = max(s_k/v, t_{k−1} + h), speed s/t, within [v − δ, v]. Past the gate it is v.
#[must_use]
pub fn queue_speed(queue: &[Ahead], remaining_m: f64, params: &QueueParams) -> f64 {
    let QueueParams { headway_s, speed_mps, speed_change_mps } = *params;
    let free = |s: f64| s / speed_mps;
    let before = queue.iter().fold(f64::NEG_INFINITY, |t, one| free(one.remaining_m).max(t + headway_s));
    let mine = free(remaining_m).max(before + headway_s);
    if remaining_m <= 0.0 || mine <= 1e-6 {
        return speed_mps;
    }
    (remaining_m / mine).clamp(speed_mps - speed_change_mps, speed_mps)
}

/// What the last beacon of a peer says about queues. All peers are looked at in each tick, so this is kept apart from the
/// rest of their beacons.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Queued {
    stamp: SimTime,
    speed_mps: f64,
    places: [QueuePlace; MAX_PLACES],
}

impl Queued {
    fn of(pose: &Pose) -> Self {
        Self { stamp: pose.stamp, speed_mps: pose.velocity().norm(), places: pose.queue }
    }
}

/// Finds the speed of a drone that stands in one or several queues.
#[derive(Clone, Debug, Default)]
pub(crate) struct QueuePacer {
    /// Of each peer ever heard, by id.
    peers: Vec<Queued>,
    /// Memory for the queue that is looked at.
    ahead: Vec<Ahead>,
}

impl QueuePacer {
    /// The lowest speed that one of the queues asks for, m/s; the nominal speed if there is none.
    pub(crate) fn speed_mps(
        &mut self,
        places: impl Iterator<Item = QueuePlace>,
        peers: &Peers,
        now: SimTime,
        params: &QueueParams,
    ) -> f64 {
        let (mut speed, mut is_current) = (params.speed_mps, false);
        for place in places {
            if !std::mem::replace(&mut is_current, true) {
                self.follow(peers);
            }
            self.collect_ahead(place, peers, now);
            speed = speed.min(queue_speed(&self.ahead, place.remaining_m, params));
        }
        speed
    }

    /// Takes over the beacons that are new.
    fn follow(&mut self, peers: &Peers) {
        let stamps = peers.stamps();
        if self.peers.len() != stamps.len() {
            self.peers.clear();
            self.peers.extend(peers.all().map(|(_, pose)| Queued::of(pose)));
        }
        for (index, (known, &stamp)) in self.peers.iter_mut().zip(stamps).enumerate() {
            if known.stamp != stamp {
                *known = Queued::of(peers.at(index).1);
            }
        }
    }

    /// Collects the living peers with a place before `mine` on the same route of the same set, sorted by rank. The remaining
    /// path in a beacon is shortened by what the peer has flown since it sent the beacon.
    fn collect_ahead(&mut self, mine: QueuePlace, peers: &Peers, now: SimTime) {
        self.ahead.clear();
        let is_ahead = |p: &&QueuePlace| p.set == mine.set && p.route == mine.route && p.rank < mine.rank;
        for (index, known) in self.peers.iter().enumerate() {
            for place in known.places.iter().filter(is_ahead) {
                if peers.is_living_at(index, now) {
                    let flown_m = known.speed_mps * now.since(known.stamp);
                    self.ahead.push(Ahead { rank: place.rank, remaining_m: place.remaining_m - flown_m });
                }
            }
        }
        self.ahead.sort_unstable_by(|a, b| a.rank.cmp(&b.rank).then(a.remaining_m.total_cmp(&b.remaining_m)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::DroneId;

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
            pacer.speed_mps([place(1, 5)].into_iter(), peers, now, &PARAMS);
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
    fn past_the_gate_no_drone_waits() {
        assert_eq!(queue_speed(&[ahead(0, 5.0)], -1.0, &PARAMS), 10.0);
        // A drone that passed long ago delays no other.
        assert_eq!(queue_speed(&[ahead(0, -60.0)], 10.0, &PARAMS), 10.0);
    }
}
