//! The queue on a shared route (paper, results: the drone farthest ahead has precedence, the others merge behind it).

use skein_leader::membership::Peers;
use skein_protocol::payload::QueuePlace;
use skein_protocol::{SimTime, Vec2};

/// One drone in a queue, as far as this drone knows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// Its place.
    pub rank: u16,
    /// Path it still has to fly to the gate, m; negative past it.
    pub remaining_m: f64,
}

/// Collects the living peers on the same route of the same set with a place before `mine`, by place, into `queue`.
/// A beacon's remaining path is shortened by what the peer has flown since.
pub fn ahead_of(mine: QueuePlace, peers: &Peers, now: SimTime, queue: &mut Vec<Ahead>) {
    queue.clear();
    for (_, pose) in peers.living(now) {
        let flown_m = Vec2::from(pose.velocity_mps).norm() * now.since(pose.stamp);
        let same = |place: &&QueuePlace| place.set == mine.set && place.route == mine.route && place.rank < mine.rank;
        queue.extend(
            pose.queue.iter().filter(same).map(|p| Ahead { rank: p.rank, remaining_m: p.remaining_m - flown_m }),
        );
    }
    queue.sort_unstable_by(|a, b| a.rank.cmp(&b.rank).then(a.remaining_m.total_cmp(&b.remaining_m)));
}

/// The speed at which a drone with `remaining_m` to the gate reaches it `headway_s` after the one before:
/// t₁ = s₁/v, t_k = max(s_k/v, t_{k−1} + h), speed s/t, within [v − δ, v]. m/s.
#[must_use]
pub fn queue_speed(queue: &[Ahead], remaining_m: f64, headway_s: f64, speed_mps: f64, change_mps: f64) -> f64 {
    let free = |s: f64| s / speed_mps;
    let before = queue.iter().fold(f64::NEG_INFINITY, |t, one| free(one.remaining_m).max(t + headway_s));
    let mine = free(remaining_m).max(before + headway_s);
    if remaining_m <= 0.0 || mine <= 1e-6 {
        return speed_mps;
    }
    (remaining_m / mine).clamp(speed_mps - change_mps, speed_mps)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ahead(rank: u16, remaining_m: f64) -> Ahead {
        Ahead { rank, remaining_m }
    }

    #[test]
    fn the_first_flies_freely_and_the_second_leaves_a_headway() {
        assert_eq!(queue_speed(&[], 100.0, 4.0, 10.0, 5.0), 10.0);
        // The first is through in 10 s, so the second is due at 14 s: 126 m in 14 s.
        assert!((queue_speed(&[ahead(0, 100.0)], 126.0, 4.0, 10.0, 5.0) - 9.0).abs() < 1e-12);
        // Far enough behind already.
        assert_eq!(queue_speed(&[ahead(0, 100.0)], 150.0, 4.0, 10.0, 5.0), 10.0);
    }

    #[test]
    fn delays_add_up_and_the_speed_stays_within_its_band() {
        let three = [ahead(0, 100.0), ahead(1, 100.0), ahead(2, 100.0)];
        assert!((queue_speed(&three, 154.0, 4.0, 10.0, 5.0) - 7.0).abs() < 1e-12);
        assert_eq!(queue_speed(&three, 50.0, 4.0, 10.0, 5.0), 5.0);
    }

    #[test]
    fn past_the_gate_nobody_waits() {
        assert_eq!(queue_speed(&[ahead(0, 5.0)], -1.0, 4.0, 10.0, 5.0), 10.0);
        // One that passed long ago delays nobody.
        assert_eq!(queue_speed(&[ahead(0, -60.0)], 10.0, 4.0, 10.0, 5.0), 10.0);
    }
}
