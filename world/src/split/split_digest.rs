//! One digest over all parts.

use super::tick_share::TickShare;
use crate::tick_digest::TickDigest;
use skein_protocol::Tick;
use skein_protocol::frame::AirFrame;

/// The digest of a world that is divided: that of the same world in one piece.
#[derive(Clone, Default)]
pub struct SplitDigest {
    digest: TickDigest,
    frames: Vec<AirFrame>,
}

impl SplitDigest {
    /// Adds a tick, of which all parts give their shares.
    pub fn fold(&mut self, tick: Tick, shares: &[TickShare]) {
        let mut drones = Vec::new();
        for share in shares {
            let mut first = 0;
            for &(id, end) in &share.drones {
                drones.push((id, &share.words[first..end]));
                first = end;
            }
        }
        drones.sort_unstable_by_key(|(id, _)| *id);
        self.frames.clear();
        self.frames.extend(shares.iter().flat_map(|share| &share.frames));
        self.frames.sort_unstable_by_key(|frame| (frame.source, frame.sequence));
        self.digest.fold_words(tick, drones.into_iter().map(|(_, words)| words), &self.frames);
    }

    /// The digest over all ticks folded so far.
    #[must_use]
    pub fn value(&self) -> u64 {
        self.digest.value()
    }
}
