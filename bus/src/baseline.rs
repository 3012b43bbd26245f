//! The naive floor that benches measure against: raw shared memory, one word that wakes everybody, one counter that
//! the last one ends. No deaths, no deadlines, no services: nothing that a swarm needs.
#![allow(unsafe_code)]

use crate::control::{map, unmap};
use crate::error::BusError;
use crate::futex;
use rustix::fs::{MemfdFlags, fstat, ftruncate, memfd_create};
use skein_protocol::slot::Slot;
use std::fs::OpenOptions;
use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
use std::path::PathBuf;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

const STOP: u32 = u32::MAX;
const SLICE: Duration = Duration::from_millis(100);

#[repr(C, align(128))]
struct Words {
    tick: AtomicU32,
    /// Drones that have not answered.
    left: AtomicU32,
    /// Processes that are there.
    here: AtomicU32,
    drones: u32,
    down_len: u32,
    read_len: u32,
}

/// A mapped floor.
#[derive(Debug)]
pub struct Baseline {
    base: NonNull<u8>,
    len: usize,
    drones: usize,
    down_len: usize,
    read_len: usize,
    memfd: Option<OwnedFd>,
}

fn len(drones: usize, down_len: usize) -> usize {
    size_of::<Words>() + drones * size_of::<Slot>() + down_len
}

impl Baseline {
    /// Makes it: `down_len` bytes go down in a tick, each drone reads `read_len` of them, a [`Slot`] of each comes up.
    ///
    /// # Errors
    /// [`BusError::System`].
    pub fn create(drones: usize, down_len: usize, read_len: usize) -> Result<Self, BusError> {
        let system = BusError::system;
        let memfd = memfd_create("skein-floor", MemfdFlags::empty()).map_err(system("make the floor's segment"))?;
        let len = len(drones, down_len);
        ftruncate(&memfd, len as u64).map_err(system("size the floor's segment"))?;
        let base = map(memfd.as_fd(), len)?;
        let words = Words {
            tick: AtomicU32::new(0),
            left: AtomicU32::new(0),
            here: AtomicU32::new(0),
            drones: drones as u32,
            down_len: down_len as u32,
            read_len: read_len.min(down_len) as u32,
        };
        // SAFETY: the start of a fresh, page-aligned mapping that nobody else has yet.
        unsafe { base.cast::<Words>().write(words) };
        Ok(Self { base, len, drones, down_len, read_len: read_len.min(down_len), memfd: Some(memfd) })
    }

    /// Maps the floor whose descriptor was inherited under this number.
    ///
    /// # Errors
    /// [`BusError::Io`], [`BusError::System`]; [`BusError::Control`] if it is none.
    pub fn attach(fd: RawFd) -> Result<Self, BusError> {
        let path = PathBuf::from(format!("/proc/self/fd/{fd}"));
        let file = OpenOptions::new().read(true).write(true).open(&path).map_err(BusError::io("open", &path))?;
        let size = fstat(&file).map_err(BusError::system("look at the floor's segment"))?.st_size as usize;
        let wrong = || BusError::Control(format!("descriptor {fd} is no floor"));
        if size < size_of::<Words>() {
            return Err(wrong());
        }
        let base = map(file.as_fd(), size)?;
        let mut floor = Self { base, len: size, drones: 0, down_len: 0, read_len: 0, memfd: None };
        let (drones, down_len, read_len) = (floor.words().drones, floor.words().down_len, floor.words().read_len);
        (floor.drones, floor.down_len, floor.read_len) = (drones as usize, down_len as usize, read_len as usize);
        let fits = len(floor.drones, floor.down_len) == size && read_len <= down_len;
        if fits { Ok(floor) } else { Err(wrong()) }
    }

    /// Number of the descriptor to hand to children; `None` in a process that attached.
    #[must_use]
    pub fn fd(&self) -> Option<RawFd> {
        self.memfd.as_ref().map(AsRawFd::as_raw_fd)
    }

    fn words(&self) -> &Words {
        // SAFETY: in the mapping, aligned, as long as `self`; its atomics alone change after it was made.
        unsafe { self.base.cast::<Words>().as_ref() }
    }

    fn slots(&self) -> NonNull<Slot> {
        // SAFETY: within the mapping.
        unsafe { self.base.add(size_of::<Words>()).cast() }
    }

    fn down(&self) -> NonNull<u8> {
        // SAFETY: within the mapping.
        unsafe { self.slots().add(self.drones).cast() }
    }

    /// Processes that have said that they are there.
    #[must_use]
    pub fn here(&self) -> u32 {
        self.words().here.load(Ordering::Acquire)
    }

    /// The world's part of tick `k`: copies `down`, wakes all, waits for all, reads all slots; the sum of what they say.
    pub fn tick(&self, k: u32, down: &[u8]) -> u64 {
        let words = self.words();
        let count = down.len().min(self.down_len);
        // SAFETY: the drones read it only between the store of the tick word and their decrements.
        unsafe { self.down().as_ptr().copy_from_nonoverlapping(down.as_ptr(), count) };
        words.left.store(self.drones as u32, Ordering::SeqCst);
        words.tick.store(k + 1, Ordering::SeqCst);
        futex::wake_all(&words.tick);
        loop {
            let left = words.left.load(Ordering::SeqCst);
            if left == 0 {
                break;
            }
            futex::wait(&words.left, left, SLICE);
        }
        // SAFETY: every drone has written its slot before its decrement, and waits.
        (0..self.drones).fold(0, |sum, i| unsafe { self.slots().add(i).read_volatile() }.frames_total.wrapping_add(sum))
    }

    /// Ends it for all drones.
    pub fn close(&self) {
        self.words().tick.store(STOP, Ordering::SeqCst);
        futex::wake_all(&self.words().tick);
    }

    /// A drone's part until it is closed, or `alive` says that nobody is there: reads its share of what goes down, writes its slot.
    pub fn serve(&self, drone: usize, alive: impl Fn() -> bool) {
        let words = self.words();
        if drone >= self.drones {
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
            // SAFETY: the world writes it only while no drone is at work.
            let down = unsafe { std::slice::from_raw_parts(self.down().as_ptr(), self.down_len) };
            let first = drone * 8 % (self.down_len - self.read_len + 1);
            let words_of = down[first..first + self.read_len].chunks_exact(8);
            let word = |bytes: &[u8]| bytes.try_into().map_or(0, u64::from_le_bytes);
            let sum = words_of.fold(0u64, |sum, bytes| word(bytes).wrapping_add(sum));
            // SAFETY: this drone's own slot, and the world reads it only after the decrement.
            unsafe { self.slots().add(drone).write_volatile(Slot { frames_total: sum, ..Slot::default() }) };
            if words.left.fetch_sub(1, Ordering::SeqCst) == 1 {
                futex::wake_all(&words.left);
            }
        }
    }
}

impl Drop for Baseline {
    fn drop(&mut self) {
        unmap(self.base, self.len);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_drone_reads_what_went_down() {
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
