//! Drones that send nothing any more.

use skein_protocol::{SimTime, Vec2};

/// A drone that is not heard any more: it may be dead and hover, or out of reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Silent {
    /// Where it is ranged, or would have stopped after its last beacon, world frame, m.
    pub place: Vec2,
    /// When it was heard last; the start of the mission if it never was.
    pub since: SimTime,
    /// Whether it is known to have hung still for long.
    pub hangs: bool,
}
