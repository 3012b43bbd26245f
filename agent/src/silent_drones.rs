//! Drones that send nothing any more: they may be dead and hover where they were.

use skein_leader::peers::Peers;
use skein_leader::routes::Body;
use skein_protocol::Vec2;
use skein_protocol::downlink::Senses;

/// Where the silent drones are assumed to be.
#[derive(Clone, Debug, Default)]
pub(crate) struct SilentDrones {
    /// World frame, m.
    positions: Vec<Vec2>,
}

impl SilentDrones {
    /// Finds the silent drones. A ranged one is where it is ranged, whether it was ever heard or not. Another one is where
    /// it has come to rest since its last beacon, braking at `braking_mps2`.
    pub(crate) fn update(&mut self, senses: &Senses<'_>, peers: &Peers, braking_mps2: f64) {
        let ranged = senses.neighbours.iter().filter(|n| !peers.is_living(n.drone, senses.now));
        self.positions.clear();
        self.positions.extend(ranged.map(|n| senses.position() + n.position()));
        for (_, pose) in peers.silent(senses.now).filter(|(id, _)| !senses.neighbours.iter().any(|n| n.drone == *id)) {
            self.positions.push(pose.stopped(braking_mps2));
        }
    }

    /// Their positions, world frame, m.
    pub(crate) fn positions(&self) -> &[Vec2] {
        &self.positions
    }

    /// Discs of this radius around them, for path planning.
    pub(crate) fn bodies(&self, radius_m: f64) -> Vec<Body> {
        self.positions.iter().map(|&centre_m| Body { centre_m, radius_m }).collect()
    }
}
