//! What a part adds to a tick.

use skein_protocol::DroneId;
use skein_protocol::frame::AirFrame;

/// What all parts are told of a part before halos are sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Announcement {
    /// Number of frames that its drones sent in the tick.
    pub(super) sent: u32,
    /// Drones that hear differently far than most, and the parts to which they belong from the next tick on.
    pub(super) owners: Vec<(DroneId, usize)>,
}

impl Announcement {
    /// Its size on a network, bytes.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        2 * size_of::<u32>() + self.owners.len() * 2 * size_of::<u32>()
    }
}

/// What a part adds to the digest of a tick.
#[derive(Clone, Debug)]
pub struct TickShare {
    /// What all parts are told.
    pub announcement: Announcement,
    /// For each of its drones, by id: where its words end in `words`.
    pub(super) drones: Vec<(DroneId, usize)>,
    pub(super) words: Vec<u8>,
    /// The frames that its drones sent.
    pub(super) frames: Vec<AirFrame>,
}

impl TickShare {
    /// Its size on a network, bytes: what a digest over all parts costs.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        let head = 2 * size_of::<u32>();
        let frames: usize = self.frames.iter().map(|frame| 2 * head + frame.frame.len as usize).sum();
        self.drones.len() * head + self.words.len() + frames
    }
}
