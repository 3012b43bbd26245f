//! The digest of a mission: a hash over every tick's states, answers and frames, bit by bit.

use crate::body::Body;
use crate::drones::DroneTable;
use crate::process::Process;
use skein_protocol::Tick;
use skein_protocol::digest::Digest;
use skein_protocol::frame::AirFrame;
use skein_protocol::radio::DropReason;

/// This number of drop counters is in every digest. The number of duplicates and the later drop counters are in it only
/// if they are not 0, so that a mission without them keeps the digest it had before those counters existed.
const ALWAYS_FOLDED: usize = DropReason::Queue as usize;

/// The digest so far.
#[derive(Clone, Default)]
pub(crate) struct TickDigest {
    digest: Digest,
    /// The words of one tick, in reused memory.
    words: Vec<u8>,
}

impl TickDigest {
    /// The digest over all ticks folded so far.
    pub(crate) fn value(&self) -> u64 {
        self.digest.value()
    }

    /// Folds one tick: its number, every drone's state and what it received, and the frames that were sent.
    pub(crate) fn fold(&mut self, tick: Tick, drones: &DroneTable, frames: &[AirFrame]) {
        self.words.clear();
        write(&mut self.words, [tick]);
        for (body, process) in drones.bodies().iter().zip(drones.processes()) {
            Self::write_drone(&mut self.words, body, process);
        }
        self.digest.bytes(&self.words);
        self.fold_frames(frames);
    }

    /// As [`TickDigest::fold`], with the words of each drone by id.
    pub(crate) fn fold_words<'a>(&mut self, tick: Tick, drones: impl Iterator<Item = &'a [u8]>, frames: &[AirFrame]) {
        self.digest.word(tick);
        drones.for_each(|words| _ = self.digest.bytes(words));
        self.fold_frames(frames);
    }

    /// The words of one drone: its state and what it received.
    pub(crate) fn write_drone(words: &mut Vec<u8>, body: &Body, process: &Process) {
        let (position, velocity) = (body.position(), body.velocity());
        let state = [position.x, position.y, position.z, velocity.x, velocity.y, velocity.z, body.energy_j()];
        write(words, state.map(f64::to_bits));
        write(words, [u64::from(body.is_alive())]);
        if !body.is_alive() {
            return;
        }
        let slot = process.slot();
        let dropped: [u64; ALWAYS_FOLDED] = std::array::from_fn(|reason| slot.dropped[reason].into());
        write(words, [u64::from(slot.heard)]);
        write(words, dropped);
        write(words, [slot.heard_hash]);
        let later = std::iter::once(&slot.duplicates).chain(&slot.dropped[ALWAYS_FOLDED..]);
        for (&count, which) in later.zip(1u64..).filter(|(count, _)| **count > 0) {
            write(words, [which << 32 | u64::from(count)]);
        }
    }

    /// Each frame is folded once here, not once per receiver: the hashes of the drones say who received which frame.
    fn fold_frames(&mut self, frames: &[AirFrame]) {
        for AirFrame { source, sequence, frame, .. } in frames {
            let len = frame.payload.len().min(frame.len as usize);
            self.digest.word(u64::from(source.0) << 32 | u64::from(*sequence)).word(u64::from(frame.kind));
            self.digest.bytes(&frame.payload[..len]);
        }
    }
}

fn write<const COUNT: usize>(words: &mut Vec<u8>, values: [u64; COUNT]) {
    words.extend_from_slice(values.map(u64::to_le_bytes).as_flattened());
}
