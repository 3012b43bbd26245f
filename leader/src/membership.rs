//! Who is there: the last beacon of each peer, and how old it is. Bounded by the size of the swarm.

use crate::adaptive_timeout::AdaptiveTimeout;
use skein_protocol::payload::Pose;
use skein_protocol::{DroneId, GroupId, PlanStamp, SimTime, Vec2};

/// Weight of a new delay in the running mean.
const NOVELTY: f64 = 0.1;
/// A beacon that was on the air for longer tells nothing about the air, s.
const MAX_DELAY_S: f64 = 60.0;

/// What is known of one peer.
#[derive(Clone, Copy, Debug)]
struct Peer {
    /// How long it may be silent, s: what its rhythm says.
    patience_s: f64,
    /// Of its beacons, by when they came in, however long they were on the air.
    adaptive_timeout: AdaptiveTimeout,
    pose: Pose,
}

impl Peer {
    fn lives(&self, now: SimTime) -> bool {
        now.since(self.adaptive_timeout.last()) <= self.patience_s
    }
}

/// The last beacon heard of each peer.
#[derive(Clone, Debug)]
pub struct Peers {
    drones: u32,
    timeout_s: f64,
    /// Running mean of the time that beacons were on the air, s.
    delay_s: f64,
    /// Who was heard, ascending: a place among them is found without touching what is known of the others.
    ids: Vec<DroneId>,
    /// What is known of each of them: looked through in every tick, and seldom added to.
    last: Vec<Peer>,
}

impl Peers {
    /// Peers among `drones` drones; one that is silent for `timeout_s`, or much longer than usual, counts as gone.
    #[must_use]
    pub fn new(drones: u32, timeout_s: f64) -> Self {
        Self { drones, timeout_s, delay_s: 0.0, ids: Vec::new(), last: Vec::new() }
    }

    /// Takes a beacon. One that is older than what is known, from the future, or of nobody in the swarm is ignored.
    /// Simulated time alone tells what is older: a process that is started again says everything later.
    pub fn hear(&mut self, now: SimTime, source: DroneId, pose: Pose) {
        let delay_s = now.since(pose.stamp);
        if source.0 >= self.drones || !(0.0..=MAX_DELAY_S).contains(&delay_s) {
            return;
        }
        match self.place(source) {
            Err(place) => {
                let adaptive_timeout = AdaptiveTimeout::new(now);
                let patience_s = adaptive_timeout.patience_s(self.timeout_s);
                self.ids.insert(place, source);
                self.last.insert(place, Peer { patience_s, adaptive_timeout, pose });
            }
            Ok(place) if pose.stamp > self.last[place].pose.stamp => {
                let peer = &mut self.last[place];
                peer.pose = pose;
                peer.adaptive_timeout.hear(now, 0.0, peer.patience_s);
                peer.patience_s = peer.adaptive_timeout.patience_s(self.timeout_s);
                self.delay_s += NOVELTY * (delay_s - self.delay_s);
            }
            Ok(_) => {}
        }
    }

    fn place(&self, peer: DroneId) -> Result<usize, usize> {
        self.ids.binary_search(&peer)
    }

    fn get(&self, peer: DroneId) -> Option<&Peer> {
        self.place(peer).ok().map(|place| &self.last[place])
    }

    /// How long a beacon is on the air, s: a running mean.
    #[must_use]
    pub fn delay_s(&self) -> f64 {
        self.delay_s
    }

    /// Forgets a peer.
    pub fn forget(&mut self, peer: DroneId) {
        if let Ok(place) = self.place(peer) {
            self.ids.remove(place);
            self.last.remove(place);
        }
    }

    /// As if all peers were one group and obeyed this plan.
    pub fn unite(&mut self, stamp: PlanStamp) {
        for Peer { pose, .. } in &mut self.last {
            (pose.group, pose.term, pose.obeyed) = (GroupId::ALL, stamp.ballot, stamp);
        }
    }

    /// Whether a beacon of the peer came in lately.
    #[must_use]
    pub fn is_living(&self, peer: DroneId, now: SimTime) -> bool {
        self.get(peer).is_some_and(|known| known.lives(now))
    }

    /// The last beacon of a peer, however old.
    #[must_use]
    pub fn last(&self, peer: DroneId) -> Option<&Pose> {
        self.get(peer).map(|known| &known.pose)
    }

    /// The last beacon of a peer that is not silent for too long.
    #[must_use]
    pub fn last_of_living(&self, peer: DroneId, now: SimTime) -> Option<&Pose> {
        self.get(peer).filter(|known| known.lives(now)).map(|known| &known.pose)
    }

    /// Peers that are not silent for too long, by id.
    pub fn living(&self, now: SimTime) -> impl Iterator<Item = (DroneId, &Pose)> + Clone {
        self.known().filter(move |(_, known)| known.lives(now)).map(|(id, known)| (id, &known.pose))
    }

    /// Peers that were heard once and are silent now, by id: they may still hang in the air.
    pub fn silent(&self, now: SimTime) -> impl Iterator<Item = (DroneId, &Pose)> {
        self.known().filter(move |(_, known)| !known.lives(now)).map(|(id, known)| (id, &known.pose))
    }

    fn known(&self) -> impl Iterator<Item = (DroneId, &Peer)> + Clone {
        self.ids.iter().copied().zip(&self.last)
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
        let mut peers = Peers::new(4, 0.4);
        let mut heard = 0.0;
        for i in 0..2000u32 {
            // As if every other beacon were lost.
            heard += 0.1 * f64::from(1 + i.wrapping_mul(0x9e37_79b9).leading_zeros());
            peers.hear(SimTime::from_secs(heard), DroneId(1), pose(heard - 0.1, 0.0));
        }
        assert!(peers.is_living(DroneId(1), SimTime::from_secs(heard + 1.5)));
        assert!(!peers.is_living(DroneId(1), SimTime::from_secs(heard + 4.0)));
    }

    #[test]
    fn a_beacon_that_boasts_of_its_incarnation_does_not_silence_the_next() {
        let mut peers = Peers::new(4, 1.0);
        let now = SimTime::from_secs(3.0);
        peers.hear(now, DroneId(1), Pose { incarnation: u32::MAX, ..pose(1.0, 1.0) });
        peers.hear(now, DroneId(1), pose(2.0, 2.0));
        assert_eq!(peers.last(DroneId(1)).unwrap().position_m[0], 2.0);
    }
}
