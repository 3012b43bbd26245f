//! Who is near, and who evades whom.

use crate::safety::{Neighbour, RANGING};
use crate::swarm_pilot::SwarmPilot;
use skein_leader::membership::extrapolated;
use skein_protocol::downlink::Senses;
use skein_protocol::payload::{MAX_PLACES, QueuePlace};
use skein_protocol::{DroneId, SimTime, Vec2};

/// A beacon that is not older shows what its drone does now, s.
const FRESH_S: f64 = 0.3;
/// Neighbours known by beacon alone count up to this many safe distances.
const BEACON_REACH: f64 = 4.0;

impl SwarmPilot {
    /// Neighbours by own senses, and beyond those by beacon, with the share of an evasion that falls to this drone. `senses`
    /// are those of the moment at which a command that is given `now` takes effect.
    pub(crate) fn find_neighbours(&mut self, now: SimTime, senses: &Senses<'_>, places: &[QueuePlace; MAX_PLACES]) {
        self.neighbours.clear();
        for sensed in senses.neighbours {
            self.neighbours.push(Neighbour {
                id: sensed.drone,
                position_m: sensed.position_m.into(),
                velocity_mps: sensed.velocity_mps.into(),
                age_s: 0.0,
                sensed: true,
                least_m: 0.0,
                share: self.share(now, sensed.drone, places),
            });
        }
        let reach_m = BEACON_REACH * self.params.safety.safe_distance_m;
        let ranges = self.params.ranging && !senses.broken.ranging;
        let least_m = if ranges { RANGING * self.params.safety.safe_distance_m } else { 0.0 };
        for (id, pose) in self.leading.peers().living(now) {
            let position_m = extrapolated(pose, senses.now) - senses.position;
            if position_m.norm_squared() > reach_m * reach_m || senses.neighbours.iter().any(|n| n.drone == id) {
                continue;
            }
            let velocity_mps = Vec2::from(pose.velocity_mps) - senses.velocity;
            let (age_s, share) = (senses.now.since(pose.stamp), self.share(now, id, places));
            self.neighbours.push(Neighbour { id, position_m, velocity_mps, age_s, sensed: false, least_m, share });
        }
    }

    /// Less than half of an evasion falls to this drone only while the other shows that it obeys the same plan and is
    /// behind; more if this drone is behind; all of it if the other is silent.
    fn share(&self, now: SimTime, other: DroneId, places: &[QueuePlace; MAX_PLACES]) -> f64 {
        let Some(pose) = self.leading.peers().last_of_living(other, now) else { return 1.0 };
        let age_s = now.since(pose.stamp);
        let open = |place: &&QueuePlace| place.set != 0 && self.way.is_open_set(place.set);
        for mine in places.iter().filter(open) {
            let same = |place: &&QueuePlace| place.set == mine.set && place.route == mine.route;
            let Some(theirs) = pose.queue.iter().find(same) else { continue };
            if mine.rank > theirs.rank {
                return self.params.precedence_share;
            }
            if mine.rank < theirs.rank && age_s <= FRESH_S && pose.obeyed == self.leading.stamp() {
                return 1.0 - self.params.precedence_share;
            }
        }
        0.5
    }
}
