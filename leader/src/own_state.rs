//! What a drone knows of its own motion.

use skein_protocol::Vec2;

/// A drone's own motion in the current tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OwnState {
    /// Number of the tick.
    pub tick: u64,
    /// Horizontal part of the position, world frame, m.
    pub position: Vec2,
    /// Horizontal part of the velocity, world frame, m/s.
    pub velocity: Vec2,
    /// Height above the ground, m.
    pub altitude_m: f64,
    /// Vertical velocity, upward, m/s.
    pub climb_mps: f64,
}
