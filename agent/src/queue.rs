//! The queue of drones on a shared route. The foremost drone has precedence; the others merge behind it (paper, results).

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

/// Collects into `queue` the living peers with a place before `mine` on the same route of the same set, sorted by rank.
/// The remaining path in a beacon is shortened by what the peer has flown since it sent the beacon.
pub fn ahead_of(mine: QueuePlace, peers: &Peers, now: SimTime, queue: &mut Vec<Ahead>) {
    queue.clear();
    for (_, pose) in peers.living(now) {
        let flown_m = pose.velocity().norm() * now.since(pose.stamp);
        let same = |place: &&QueuePlace| place.set == mine.set && place.route == mine.route && place.rank < mine.rank;
        queue.extend(
            pose.queue.iter().filter(same).map(|p| Ahead { rank: p.rank, remaining_m: p.remaining_m - flown_m }),
        );
    }
    queue.sort_unstable_by(|a, b| a.rank.cmp(&b.rank).then(a.remaining_m.total_cmp(&b.remaining_m)));
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

/// Finds the speed of a drone that stands in one or several queues.
#[derive(Clone, Debug, Default)]
pub(crate) struct QueuePacer {
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
        let mut speed = params.speed_mps;
        for place in places {
            ahead_of(place, peers, now, &mut self.ahead);
            speed = speed.min(queue_speed(&self.ahead, place.remaining_m, params));
        }
        speed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn past_the_gate_no_drone_waits() {
        assert_eq!(queue_speed(&[ahead(0, 5.0)], -1.0, &PARAMS), 10.0);
        // A drone that passed long ago delays no other.
        assert_eq!(queue_speed(&[ahead(0, -60.0)], 10.0, &PARAMS), 10.0);
    }
}
