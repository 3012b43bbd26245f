//! What a drone knows of its own motion.

use skein_protocol::Vec2;

/// A drone's own motion in the current tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnState {
    /// Number of the tick.
    pub tick: u64,
    /// Position, world frame, m.
    pub position: Vec2,
    /// Velocity, world frame, m/s.
    pub velocity: Vec2,
}
