//! Who is there: the last beacon of each peer, and how old it is. Bounded by the size of the swarm.

use skein_protocol::payload::Pose;
use skein_protocol::{DroneId, SimTime, Vec2};
use std::collections::BTreeMap;

/// A peer counts as gone after this many times the usual gap between two of its beacons, if that is longer than the
/// time-out: at 50 % loss the chance that so many are lost in a row is one in ten million.
const PATIENCE: f64 = 12.0;
/// Weight of a new gap in the running mean.
const NOVELTY: f64 = 0.1;

/// What is known of one peer.
#[derive(Clone, Copy, Debug)]
struct Peer {
    pose: Pose,
    /// When its last beacon came in, however long it was on the air.
    heard: SimTime,
    /// Running mean of the time between two beacons that came in, s.
    gap_s: f64,
}

/// The last beacon heard of each peer.
#[derive(Clone, Debug)]
pub struct Peers {
    drones: u32,
    timeout_s: f64,
    /// Running mean of the time that beacons were on the air, s.
    delay_s: f64,
    last: BTreeMap<DroneId, Peer>,
}

impl Peers {
    /// Peers among `drones` drones; one that is silent for `timeout_s`, or much longer than usual, counts as gone.
    #[must_use]
    pub fn new(drones: u32, timeout_s: f64) -> Self {
        Self { drones, timeout_s, delay_s: 0.0, last: BTreeMap::new() }
    }

    /// Takes a beacon. One that is older than what is known, from the future, or of nobody in the swarm is ignored.
    pub fn hear(&mut self, now: SimTime, source: DroneId, pose: Pose) {
        if source.0 >= self.drones || pose.stamp > now {
            return;
        }
        let known = self.last.entry(source).or_insert(Peer { pose, heard: now, gap_s: 0.0 });
        if (pose.incarnation, pose.stamp) > (known.pose.incarnation, known.pose.stamp) {
            let gap_s = known.gap_s + NOVELTY * (now.since(known.heard) - known.gap_s);
            *known = Peer { pose, heard: now, gap_s };
            self.delay_s += NOVELTY * (now.since(pose.stamp) - self.delay_s);
        }
    }

    /// How long a beacon is on the air, s: a running mean.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Forgets a peer.
    pub fn forget(&mut self, peer: DroneId) {
        self.last.remove(&peer);
    }

    /// How long a peer may be silent before it counts as gone, s: `base_s`, or more if its beacons come in rarely.
    #[must_use]
    pub fn patience_s(&self, peer: DroneId, base_s: f64) -> f64 {
        self.last.get(&peer).map_or(base_s, |known| base_s.max(PATIENCE * known.gap_s))
    }

    /// Whether a beacon of the peer came in lately.
    #[must_use]
    pub fn is_living(&self, peer: DroneId, now: SimTime) -> bool {
        self.last.get(&peer).is_some_and(|known| self.lives(known, now))
    }

    fn lives(&self, peer: &Peer, now: SimTime) -> bool {
        now.since(peer.heard) <= self.timeout_s.max(PATIENCE * peer.gap_s)
    }

    /// The last beacon of a peer, however old.
    #[must_use]
    pub fn last(&self, peer: DroneId) -> Option<&Pose> {
        self.last.get(&peer).map(|known| &known.pose)
    }

    /// Peers that are not silent for too long, by id.
    pub fn living(&self, now: SimTime) -> impl Iterator<Item = (DroneId, &Pose)> {
        self.last.iter().filter(move |(_, known)| self.lives(known, now)).map(|(&id, known)| (id, &known.pose))
    }

    /// Peers that were heard once and are silent now, by id: they may still hang in the air.
    pub fn silent(&self, now: SimTime) -> impl Iterator<Item = (DroneId, &Pose)> {
        self.last.iter().filter(move |(_, known)| !self.lives(known, now)).map(|(&id, known)| (id, &known.pose))
    }
}

/// Where a pose is by now if its drone kept its velocity.
#[must_use]
pub fn extrapolated(pose: &Pose, now: SimTime) -> Vec2 {
    Vec2::from(pose.position_m) + Vec2::from(pose.velocity_mps) * now.since(pose.stamp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_protocol::payload::Pose;

    fn pose(stamp_s: f64, x: f64) -> Pose {
        Pose { stamp: SimTime::from_secs(stamp_s), position_m: [x, 0.0], velocity_mps: [10.0, 0.0], ..bytemuck_zero() }
    }

    fn bytemuck_zero() -> Pose {
        Pose {
            stamp: SimTime::ZERO,
            position_m: [0.0; 2],
            velocity_mps: [0.0; 2],
            queue: Default::default(),
            obeyed: Default::default(),
            group: Default::default(),
            term: Default::default(),
            incarnation: 1,
            flags: 0,
            reserved: 0,
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
        assert_eq!(peers.last(DroneId(1)).unwrap().position_m[0], 5.0);
        assert!(peers.last(DroneId(7)).is_none());
        assert_eq!(extrapolated(peers.last(DroneId(1)).unwrap(), now).x, 10.0);
    }

    #[test]
    fn a_silent_peer_is_gone_and_remembered() {
        let mut peers = Peers::new(4, 1.0);
        peers.hear(SimTime::ZERO, DroneId(1), pose(0.0, 0.0));
        assert_eq!(peers.living(SimTime::from_secs(1.0)).count(), 1);
        assert_eq!(peers.living(SimTime::from_secs(1.1)).count(), 0);
        assert_eq!(peers.silent(SimTime::from_secs(1.1)).count(), 1);
    }

    #[test]
    fn a_long_way_on_the_air_is_no_silence_and_rare_beacons_are_waited_for() {
        let mut peers = Peers::new(4, 1.0);
        for i in 0..200 {
            let now = 3.0 + 0.5 * f64::from(i);
            peers.hear(SimTime::from_secs(now), DroneId(1), pose(now - 3.0, 0.0));
            assert!(peers.is_living(DroneId(1), SimTime::from_secs(now + 0.4)));
        }
        let last = 3.0 + 0.5 * 199.0;
        assert!(peers.is_living(DroneId(1), SimTime::from_secs(last + 5.9)));
        assert!(!peers.is_living(DroneId(1), SimTime::from_secs(last + 6.1)));
        assert!((peers.patience_s(DroneId(1), 1.0) - 6.0).abs() < 1e-3);
    }
}
