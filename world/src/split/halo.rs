//! What one part tells another at the end of a tick.

use crate::body::Body;
use crate::process::Process;
use skein_protocol::frame::{AirFrame, FRAME_PAYLOAD};
use skein_protocol::slot::Slot;

/// Bytes of a body on a network: number, position, velocity, and whether it flies.
const BODY_LEN: usize = size_of::<u32>() + 6 * size_of::<f64>() + size_of::<u32>();
/// Bytes of a drone that moves to another part: its body with its energy, its last answer, its incarnation and sequence number.
const MOVER_LEN: usize = BODY_LEN + size_of::<f64>() + size_of::<Slot>() + 2 * size_of::<u32>();
/// Bytes of the numbers of bodies, frames and movers.
const HEAD_LEN: usize = 3 * size_of::<u32>();

/// What one part tells another at the end of a tick. It holds nothing else of the world.
#[derive(Clone, Debug, Default)]
pub struct Halo {
    /// Bodies that drones in the other tile may sense, by id.
    pub(super) bodies: Vec<(u32, Body)>,
    /// Frames that drones in the other tile may hear.
    pub(super) frames: Vec<AirFrame>,
    /// Drones that have come into the other tile.
    pub(super) movers: Vec<Mover>,
}

/// A drone on its way to another part.
#[derive(Clone, Debug)]
pub(super) struct Mover {
    pub(super) id: u32,
    pub(super) body: Body,
    pub(super) process: Process,
}

impl Halo {
    /// Its size on a network, bytes. Of a frame, only the payload that is in use counts.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        HEAD_LEN + self.body_bytes() + self.frame_bytes() + self.movers.len() * MOVER_LEN
    }

    /// Size of its bodies on a network, bytes.
    #[must_use]
    pub fn body_bytes(&self) -> usize {
        self.bodies.len() * BODY_LEN
    }

    /// Size of its frames on a network, bytes.
    #[must_use]
    pub fn frame_bytes(&self) -> usize {
        let head = size_of::<AirFrame>() - FRAME_PAYLOAD;
        self.frames.iter().map(|frame| head + frame.frame.len as usize).sum()
    }

    /// Number of bodies.
    #[must_use]
    pub fn bodies(&self) -> usize {
        self.bodies.len()
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// Number of drones that have come into the other tile.
    #[must_use]
    pub fn movers(&self) -> usize {
        self.movers.len()
    }
}
