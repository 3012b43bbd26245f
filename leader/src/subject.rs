//! What a message that may be passed on is about.

use skein_protocol::{DroneId, GroupId};

/// What a message is about. Of the messages about the same, only the newest is passed on. In the order of urgency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Subject {
    /// The plan for this group.
    Plan(GroupId),
    /// The assignment of this drone in a plan for this group.
    Part(GroupId, DroneId),
    /// The arrivals of this drone, of this kind.
    Arrivals(u32, DroneId),
    /// What this drone has passed.
    Passed(DroneId),
}

impl Subject {
    /// The drone that it is about.
    pub(crate) fn drone(&self) -> Option<DroneId> {
        match *self {
            Self::Plan(_) => None,
            Self::Part(_, drone) | Self::Arrivals(_, drone) | Self::Passed(drone) => Some(drone),
        }
    }
}
