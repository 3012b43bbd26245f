//! The neighbours that a drone keeps its distance from, and its share of each evasion.

use crate::distant_peers::{Distant, DistantPeers};
use crate::few::Few;
use crate::safety::Neighbour;
use crate::tuning::{BEACON_REACH, FRESH_BEACON_S};
use skein_leader::beacons::Beacon;
use skein_leader::peers::Peers;
use skein_protocol::downlink::{SensedNeighbour, Senses};
use skein_protocol::payload::QueuePlace;
use skein_protocol::{DroneId, PlanStamp, SimTime, Vec2};

/// A drone's share of an evasion, if neither has precedence.
const EVEN_SHARE: f64 = 0.5;

/// Peers are looked at in each tick up to this distance, in reaches. So one at the reach, as in a formation whose spacing divides it, does not
/// leave and come back in each tick. Chosen by hand.
const KEPT_REACH: f64 = 1.02;

/// Constants of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NeighbourParams {
    /// Least distance between two drones, m.
    pub(crate) safe_distance_m: f64,
    /// Neighbours within this distance are sensed, m; `None` without a sensor that ranges them.
    pub(crate) ranging_m: Option<f64>,
    /// Share of an evasion that the rear one of two queued drones takes, 0.5 to 1.
    pub(crate) precedence_share: f64,
}

/// What the table is made from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NeighbourView<'a> {
    /// When the drone gives its command.
    pub(crate) now: SimTime,
    /// The senses predicted for the moment at which that command takes effect.
    pub(crate) senses: &'a Senses<'a>,
    /// What the drone knows of its peers.
    pub(crate) peers: &'a Peers,
    /// The plan it obeys.
    pub(crate) obeyed: PlanStamp,
    /// Its places in the queues of the sets that it has still to leave; unused entries have set 0.
    pub(crate) places: &'a [QueuePlace],
}

/// A peer within reach, as its last beacon has it.
#[derive(Clone, Copy, Debug)]
struct NearPeer {
    id: DroneId,
    stamp: SimTime,
    /// World frame, m.
    position: Vec2,
    /// World frame, m/s.
    velocity: Vec2,
}

impl NearPeer {
    #[inline]
    fn new((id, pose): (DroneId, Beacon<'_>)) -> Self {
        let (position, velocity) = pose.flight();
        Self { id, stamp: pose.stamp(), position, velocity }
    }

    /// Where it is relative to this drone if it has kept its velocity, m.
    #[inline]
    fn away(&self, senses: &Senses<'_>) -> Vec2 {
        self.position + self.velocity * senses.now.since(self.stamp) - senses.position()
    }
}

/// Finds the neighbours of a drone.
#[derive(Clone, Debug)]
pub(crate) struct NeighbourTable {
    params: NeighbourParams,
    distant: DistantPeers<NearPeer>,
}

impl NeighbourTable {
    /// A table that has seen no peers.
    pub(crate) fn new(params: NeighbourParams) -> Self {
        Self { params, distant: DistantPeers::default() }
    }

    /// Fetches what [`Self::update`] reads into the cache: call it a short time before, when all messages are heard.
    pub(crate) fn warm(&self, peers: &Peers) {
        self.distant.warm(peers.changes());
    }

    /// Adds the neighbours: first those that are ranged, then those known by beacon alone. Call once per tick.
    pub(crate) fn update(&mut self, view: &NeighbourView<'_>, neighbours: &mut Few<Neighbour>) {
        let (Self { params, distant: distant_peers }, senses) = (self, view.senses);
        let queues = view.places.iter().any(|place| place.set != 0);
        if queues {
            let ranged = senses.neighbours.iter().map(|sensed| sensed.drone);
            ranged.chain(distant_peers.kept().iter().map(|peer| peer.id)).for_each(|peer| view.peers.warm_queue(peer));
        }
        let even = !queues && view.peers.are_all_living(view.now);
        let share = |other| if even { EVEN_SHARE } else { params.share(view, other) };
        for sensed in senses.neighbours {
            neighbours.push(Neighbour {
                id: sensed.drone,
                position_m: sensed.position(),
                velocity_mps: sensed.velocity(),
                age_s: 0.0,
                sensed: true,
                least_m: 0.0,
                share: share(sensed.drone),
            });
        }
        let reach_m = BEACON_REACH * params.safe_distance_m;
        let kept_m = KEPT_REACH * reach_m;
        let least_m = params.ranging_m.filter(|_| !senses.broken.ranging).unwrap_or(0.0);
        distant_peers.advance(senses.now, senses.position());
        let distant = |position_m: Vec2, velocity: Vec2| {
            let far = position_m.norm_squared() > kept_m * kept_m;
            far.then(|| Distant { beyond_m: position_m.norm() - kept_m, speed_mps: velocity.norm() })
        };
        let near = |index| NearPeer::new(view.peers.at(index));
        let away = |index| {
            let peer = near(index);
            distant(peer.away(senses), peer.velocity)
        };
        distant_peers.look(view.peers.stamps().len(), view.peers.changes(), away, near);
        // The world lists them by id, but another one need not.
        let mut sorted = Few::<SensedNeighbour>::new();
        let mut ranged = senses.neighbours;
        if !ranged.is_sorted_by_key(|sensed| sensed.drone) {
            sorted.extend_from_slice(ranged);
            sorted.sort_unstable_by_key(|sensed| sensed.drone);
            ranged = &sorted;
        }
        let mut ranged = ranged.iter().map(|sensed| sensed.drone).peekable();
        // Peers are visited in the order of their ids.
        distant_peers.visit(|index, peer| {
            let id = peer.id;
            while ranged.next_if(|drone| *drone < id).is_some() {}
            if ranged.peek() == Some(&id) || !view.peers.is_living_at(index, view.now) {
                return None;
            }
            let position_m = peer.away(senses);
            let far = distant(position_m, peer.velocity);
            if position_m.norm_squared() <= reach_m * reach_m {
                let velocity_mps = peer.velocity - senses.velocity();
                let (age_s, share) = (senses.now.since(peer.stamp), share(id));
                neighbours.push(Neighbour { id, position_m, velocity_mps, age_s, sensed: false, least_m, share });
            }
            far
        });
    }
}

impl NeighbourParams {
    /// This drone's share of an evasion, 0 to 1. It is 1 if the other drone is silent, and one half between drones that do
    /// not share a queue. The rear drone of a queue takes more than half. The front one takes less, but only while a fresh
    /// beacon shows that the other obeys the same plan.
    fn share(&self, view: &NeighbourView<'_>, other: DroneId) -> f64 {
        let Some(pose) = view.peers.last_of_living(other, view.now) else { return 1.0 };
        let is_fresh = || view.now.since(pose.stamp()) <= FRESH_BEACON_S;
        for mine in view.places.iter().filter(|place| place.set != 0) {
            let same = |place: &QueuePlace| place.set == mine.set && place.route == mine.route;
            let Some(theirs) = pose.queue().find(same) else { continue };
            if mine.rank > theirs.rank {
                return self.precedence_share;
            }
            if mine.rank < theirs.rank && is_fresh() && pose.obeyed() == view.obeyed {
                return 1.0 - self.precedence_share;
            }
        }
        EVEN_SHARE
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use skein_protocol::payload::{MAX_PLACES, Pose};

    const PARAMS: NeighbourParams =
        NeighbourParams { safe_distance_m: 30.0, ranging_m: Some(60.0), precedence_share: 0.8 };

    fn place(rank: u16) -> QueuePlace {
        QueuePlace { remaining_m: 50.0, set: 7, route: 1, rank }
    }

    /// This drone's share against a ranged neighbour that was heard `age_s` ago in its queue with this rank, or never.
    fn share(mine: Option<u16>, theirs: Option<(u16, f64)>) -> f64 {
        let now = SimTime::from_secs(10.0);
        let mut peers = Peers::new(2, 2.0);
        if let Some((rank, age_s)) = theirs {
            let stamp = SimTime::from_secs(10.0 - age_s);
            let queue = [place(rank), QueuePlace::default()];
            peers.hear(stamp, DroneId(1), Pose { stamp, queue, ..Pose::zeroed() });
        }
        let neighbours =
            [SensedNeighbour { position_m: [40.0, 0.0, 0.0], velocity_mps: [0.0; 3], drone: DroneId(1), reserved: 0 }];
        let senses = Senses::new((500, now), ([0.0; 3], [0.0; 3]), &[], &neighbours, &[]);
        let mut places = [QueuePlace::default(); MAX_PLACES];
        places[0] = mine.map_or_else(QueuePlace::default, place);
        let mut table = NeighbourTable::new(PARAMS);
        let obeyed = PlanStamp::default();
        let mut found = Few::new();
        table.update(&NeighbourView { now, senses: &senses, peers: &peers, obeyed, places: &places }, &mut found);
        assert_eq!(found.len(), 1, "a neighbour that is ranged and heard counts once");
        found[0].share
    }

    #[test]
    fn a_silent_neighbour_leaves_the_whole_evasion_to_this_drone() {
        assert_eq!(share(None, None), 1.0);
    }

    #[test]
    fn the_rear_drone_of_a_queue_takes_the_larger_share() {
        assert_eq!(share(Some(3), Some((2, 0.1))), 0.8);
        assert!((share(Some(1), Some((2, 0.1))) - 0.2).abs() < 1e-12);
        assert_eq!(share(None, Some((2, 0.1))), 0.5, "they share no queue");
    }

    #[test]
    fn the_front_drone_takes_less_only_while_the_beacon_is_fresh() {
        assert_eq!(share(Some(1), Some((2, 0.5))), 0.5);
    }

    /// The drones that are neighbours, and whether they are sensed, if these are ranged, in this order, and drones 1 to 4 are known by beacons
    /// that say that they are this far away, m.
    fn found(ranged: &[u32], away_m: f64) -> Vec<(u32, bool)> {
        let stamp = SimTime::from_secs(10.0);
        let mut peers = Peers::new(5, 2.0);
        for id in 1..5 {
            peers.hear(stamp, DroneId(id), Pose { stamp, position_m: [away_m, 0.0, 0.0], ..Pose::zeroed() });
        }
        let ranged = ranged.iter().map(|id| SensedNeighbour {
            position_m: [40.0, 0.0, 0.0],
            velocity_mps: [0.0; 3],
            drone: DroneId(*id),
            reserved: 0,
        });
        let ranged: Vec<SensedNeighbour> = ranged.collect();
        let senses = Senses::new((500, stamp), ([0.0; 3], [0.0; 3]), &[], &ranged, &[]);
        let places = [QueuePlace::default(); MAX_PLACES];
        let view =
            NeighbourView { now: stamp, senses: &senses, peers: &peers, obeyed: PlanStamp::default(), places: &places };
        let mut found = Few::new();
        NeighbourTable::new(PARAMS).update(&view, &mut found);
        found.iter().map(|neighbour| (neighbour.id.0, neighbour.sensed)).collect()
    }

    #[test]
    fn a_peer_known_by_beacon_is_a_neighbour_up_to_the_reach_and_no_farther() {
        let reach_m = BEACON_REACH * PARAMS.safe_distance_m;
        assert_eq!(found(&[2, 3, 4], 0.999 * reach_m), [(2, true), (3, true), (4, true), (1, false)]);
        assert_eq!(found(&[2, 3, 4], 1.001 * reach_m), [(2, true), (3, true), (4, true)]);
    }

    #[test]
    fn a_neighbour_that_is_ranged_counts_once_in_whatever_order_they_are_ranged() {
        assert_eq!(found(&[4, 1, 3], 50.0), [(4, true), (1, true), (3, true), (2, false)]);
    }
}
