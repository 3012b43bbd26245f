//! Where one drone flies past an obstacle set.

use crate::roster::OfDrone;
use skein_protocol::payload::Assignment;
use skein_protocol::{DroneId, GroupId};

/// What a drone keeps of an assignment for as long as its set is being passed. Each drone keeps this for all drones of the swarm
/// and every set, so it is small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPlace {
    /// The drone that the place is for.
    pub drone: DroneId,
    /// The drone's group under this plan.
    pub group: GroupId,
    /// Route past the set, 0 = rightmost.
    pub route: u16,
    /// Place in the queue of that route, 0 = first.
    pub rank: u16,
}

impl OfDrone for SetPlace {
    fn drone(&self) -> DroneId {
        self.drone
    }
}

impl From<&Assignment> for SetPlace {
    fn from(part: &Assignment) -> Self {
        Self { drone: part.drone, group: part.group, route: part.route, rank: part.rank }
    }
}
