//! What a tick adds to the digest.

use super::{ALWAYS_FOLDED, World};
use skein_protocol::frame::AirFrame;

impl World {
    pub(super) fn fold(&mut self) {
        self.folded.clear();
        let mut word = |value: u64| self.folded.extend_from_slice(&value.to_le_bytes());
        word(self.tick);
        for (body, process) in self.bodies.iter().zip(&self.processes) {
            let state = [body.position.x, body.position.y, body.velocity.x, body.velocity.y, body.energy_j];
            state.into_iter().for_each(|value| word(value.to_bits()));
            word(u64::from(body.alive));
            if body.alive {
                word(u64::from(process.slot.heard));
                process.slot.dropped[..ALWAYS_FOLDED].iter().for_each(|&count| word(u64::from(count)));
                word(process.slot.heard_hash);
                let later = std::iter::once(&process.slot.duplicates).chain(&process.slot.dropped[ALWAYS_FOLDED..]);
                later.zip(1u64..).filter(|(count, _)| **count > 0).for_each(|(&count, which)| {
                    word(which << 32 | u64::from(count));
                });
            }
        }
        self.digest.bytes(&self.folded);
        // Once here, instead of by everybody who hears it: who heard which frame is in the hashes above.
        for AirFrame { source, sequence, frame, .. } in &self.sent {
            let len = frame.payload.len().min(frame.len as usize);
            self.digest.word(u64::from(source.0) << 32 | u64::from(*sequence)).word(u64::from(frame.kind));
            self.digest.bytes(&frame.payload[..len]);
        }
    }
}
