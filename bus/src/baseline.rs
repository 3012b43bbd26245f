//! The baseline of `skein bench runtime`: raw shared memory, one word that wakes all processes, and one counter of missing
//! answers. It does without deaths, deadlines and services, which a swarm needs.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::futex::{self, SLICE};
use crate::segment::{Atomics, Segment, SharedArray, open_inherited};
use skein_protocol::slot::Slot;
use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

const STOP: u32 = u32::MAX;

#[repr(C, align(128))]
#[derive(Debug)]
struct Words {
    tick: AtomicU32,
    /// Drones that have not answered.
    left: AtomicU32,
    /// Processes that have attached and serve.
    here: AtomicU32,
    drones: u32,
    down_len: u32,
    read_len: u32,
}

// SAFETY: the integers that are not atomics stay as they were when the segment was made; only the atomics change while
// processes share it.
unsafe impl Atomics for Words {}

/// A mapped baseline.
#[derive(Debug)]
pub struct Baseline {
    words: SharedArray<Words>,
    slots: SharedArray<Slot>,
    /// What the world sends in a tick.
    down: SharedArray<u8>,
    read_len: usize,
    memfd: Option<OwnedFd>,
}

const SLOTS: usize = size_of::<Words>();

fn down_at(drones: usize) -> usize {
    SLOTS + drones * size_of::<Slot>()
}

impl Baseline {
    /// Makes a baseline. In each tick, the world writes `down_len` bytes, every drone reads `read_len` of them, and every
    /// drone writes one [`Slot`].
    ///
    /// # Errors
    /// [`BusError::System`].
    pub fn create(drones: usize, down_len: usize, read_len: usize) -> Result<Self, BusError> {
        let (segment, memfd) = Segment::create("skein-baseline", down_at(drones) + down_len)?;
        let segment = Arc::new(segment);
        let words = Words {
            tick: AtomicU32::new(0),
            left: AtomicU32::new(0),
            here: AtomicU32::new(0),
            drones: drones as u32,
            down_len: down_len as u32,
            read_len: read_len.min(down_len) as u32,
        };
        // SAFETY: the pointer is aligned and into a new mapping, which no other process has yet.
        unsafe { segment.array::<Words>(0, 1).pointer(0).write(words) };
        Ok(Self { memfd: Some(memfd), ..Self::over(&segment, drones, down_len, read_len.min(down_len)) })
    }

    /// Maps the baseline whose descriptor was inherited under this number.
    ///
    /// # Errors
    /// [`BusError::Io`], [`BusError::System`]; [`BusError::Control`] if the descriptor is not a baseline's.
    pub fn attach(fd: RawFd) -> Result<Self, BusError> {
        let (file, size) = open_inherited(fd)?;
        let wrong = || BusError::Control(format!("descriptor {fd} is not a baseline's"));
        if size < SLOTS {
            return Err(wrong());
        }
        let segment = Arc::new(Segment::map(file.as_fd(), size)?);
        let words: SharedArray<Words> = segment.array(0, 1);
        let Words { drones, down_len, read_len, .. } = words.get(0);
        let (drones, down_len, read_len) = (*drones as usize, *down_len as usize, *read_len as usize);
        if down_at(drones) + down_len != size || read_len > down_len {
            return Err(wrong());
        }
        Ok(Self::over(&segment, drones, down_len, read_len))
    }

    fn over(segment: &Arc<Segment>, drones: usize, down_len: usize, read_len: usize) -> Self {
        let (slots, down) = (segment.array(SLOTS, drones), segment.array(down_at(drones), down_len));
        Self { words: segment.array(0, 1), slots, down, read_len, memfd: None }
    }

    /// Number of the descriptor to hand to children; `None` in a process that attached.
    #[must_use]
    pub fn fd(&self) -> Option<RawFd> {
        self.memfd.as_ref().map(AsRawFd::as_raw_fd)
    }

    /// Number of processes that have attached and serve.
    #[must_use]
    pub fn here(&self) -> u32 {
        self.words.get(0).here.load(Ordering::Acquire)
    }

    /// Tick `k`, world side: copies `down`, wakes all drones, waits for all of them and reads all slots. Returns the sum of
    /// what the drones answered.
    pub fn tick(&self, k: u32, down: &[u8]) -> u64 {
        let words = self.words.get(0);
        let count = down.len().min(self.down.count());
        if count > 0 {
            // SAFETY: `count` bytes are within both. The drones read them only between the store to the tick word and their
            // decrements, and now all of them have decremented.
            unsafe { self.down.pointer(0).as_ptr().copy_from_nonoverlapping(down.as_ptr(), count) };
        }
        words.left.store(self.slots.count() as u32, Ordering::SeqCst);
        words.tick.store(k + 1, Ordering::SeqCst);
        futex::wake_all(&words.tick);
        loop {
            let left = words.left.load(Ordering::SeqCst);
            if left == 0 {
                break;
            }
            futex::wait(&words.left, left, SLICE);
        }
        // SAFETY: every drone has written its slot before its decrement, and now waits.
        let answer = |drone| unsafe { self.slots.pointer(drone).read_volatile() }.frames_total;
        (0..self.slots.count()).fold(0, |sum, drone| answer(drone).wrapping_add(sum))
    }

    /// Ends the ticks for all drones.
    pub fn close(&self) {
        let word = &self.words.get(0).tick;
        word.store(STOP, Ordering::SeqCst);
        futex::wake_all(word);
    }

    /// Drone side, until the baseline is closed or `alive` returns false: reads its part of what the world sent and writes
    /// its slot.
    pub fn serve(&self, drone: usize, alive: impl Fn() -> bool) {
        let words = self.words.get(0);
        if drone >= self.slots.count() {
            return;
        }
        words.here.fetch_add(1, Ordering::AcqRel);
        let mut last = 0;
        loop {
            let seen = words.tick.load(Ordering::SeqCst);
            if seen == STOP {
                return;
            }
            if seen == last {
                futex::wait(&words.tick, seen, SLICE);
                if words.tick.load(Ordering::SeqCst) == seen && !alive() {
                    return;
                }
                continue;
            }
            last = seen;
            let frames_total = self.read(drone);
            // SAFETY: the slot is this drone's own, and the world reads it only after the decrement.
            unsafe { self.slots.pointer(drone).write_volatile(Slot { frames_total, ..Slot::default() }) };
            if words.left.fetch_sub(1, Ordering::SeqCst) == 1 {
                futex::wake_all(&words.left);
            }
        }
    }

    /// The sum of the words that a drone reads in a tick.
    fn read(&self, drone: usize) -> u64 {
        if self.read_len == 0 {
            return 0;
        }
        // SAFETY: the bytes are within the mapping, and the world writes them only while no drone is between the opening of
        // a tick and its decrement; this one is.
        let down = unsafe { std::slice::from_raw_parts(self.down.pointer(0).as_ptr(), self.down.count()) };
        let first = drone * 8 % (down.len() - self.read_len + 1);
        let words = down[first..first + self.read_len].chunks_exact(8);
        let word = |bytes: &[u8]| bytes.try_into().map_or(0, u64::from_le_bytes);
        words.fold(0u64, |sum, bytes| word(bytes).wrapping_add(sum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_drone_reads_what_the_world_sent() {
        let world = Baseline::create(3, 16, 16).unwrap();
        std::thread::scope(|scope| {
            for drone in 0..3 {
                let fd = world.fd().unwrap();
                scope.spawn(move || Baseline::attach(fd).unwrap().serve(drone, || true));
            }
            while world.here() < 3 {
                std::thread::yield_now();
            }
            let mut down = [0u8; 16];
            (down[0], down[8]) = (7, 1);
            for k in 0..100 {
                assert_eq!(world.tick(k, &down), 3 * 8);
            }
            world.close();
        });
    }
}
