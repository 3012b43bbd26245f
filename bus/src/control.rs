//! The control segment: a memfd that every process of a run maps. Wire and clock, not a message path.
//!
//! Laid out as a header, the launcher's and the world's words, the world's hint, the order words, a tick word a core,
//! then a block a drone: its words, a [`Slot`] and a [`LinkStats`]; each on cache lines of its own. What one process
//! touches in a tick lies together: after a switch of processes every page of it costs a walk through cold tables.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::stopwatch::{Mark, Stopwatch};
use rustix::fs::{MemfdFlags, fstat, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use skein_protocol::slot::{LinkStats, Slot};
use std::fs::OpenOptions;
use std::mem::offset_of;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd, RawFd};
use std::path::PathBuf;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

const MAGIC: u32 = u32::from_le_bytes(*b"SKN1");
/// Raised with every change of the layout, and of `Slot` or `LinkStats`.
const LAYOUT: u32 = 5;
/// Bound on drones and cores that an attached segment may announce.
const MAX_COUNT: usize = 1 << 16;
/// Looks before sleeping, if every process has a core of its own.
const SPIN: u32 = 300;
/// How long a wait lasts before it asks whether the other side still lives.
pub(crate) const SLICE: Duration = Duration::from_millis(100);

/// In a done word: the drone's process is dead. The other bits stay: they tell the last tick it answered.
pub(crate) const DEAD: u32 = 1 << 31;
/// In a tick word: the mission is over.
pub(crate) const STOP: u32 = u32::MAX;

/// How processes wait for each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaitMode {
    /// They sleep on a futex.
    #[default]
    Block,
    /// They give up the core and look again: faster for few drones on a quiet machine, ruinous on a busy one.
    Yield,
}

/// What a control segment is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ControlSpec {
    /// Number of drones, from 1.
    pub drones: usize,
    /// Number of tick words, from 1: the cores that drones are pinned to, 1 if they are not pinned.
    pub cores: usize,
    /// Drones in a process, from 1: those with ids from a multiple of it on. They share a tick word.
    pub per_process: usize,
    /// How processes wait.
    pub wait: WaitMode,
}

#[repr(C, align(128))]
struct Header {
    magic: u32,
    layout: u32,
    drones: u32,
    cores: u32,
    wait: u32,
    spin: u32,
    per_process: u32,
}

#[repr(C, align(128))]
pub(crate) struct SharedWords {
    pub(crate) go: AtomicU32,
    pub(crate) stop: AtomicU32,
    pub(crate) world_state: AtomicU32,
    /// System calls of the barrier that the world has made.
    pub(crate) calls: AtomicU64,
    /// Nanoseconds a count of the processor's counter, the bits of an `f64`.
    pub(crate) ns_per_count: AtomicU64,
}

#[repr(C, align(128))]
pub(crate) struct OrderWords {
    pub(crate) asked: AtomicU32,
    pub(crate) kind: AtomicU32,
    pub(crate) drone: AtomicU32,
    pub(crate) tick: AtomicU32,
    pub(crate) answered: AtomicU32,
    pub(crate) reply: AtomicU32,
}

/// A word on cache lines of its own.
#[repr(C, align(128))]
pub(crate) struct PaddedWord(pub(crate) AtomicU32);

#[repr(C, align(128))]
pub(crate) struct DroneWords {
    /// Last answered tick plus 1, and [`DEAD`].
    pub(crate) done: AtomicU32,
    /// First tick that it may answer.
    pub(crate) resume_from: AtomicU32,
    /// Incarnation of the process that is ready; 0 if none is.
    pub(crate) ready: AtomicU32,
    /// System calls of the barrier that it has made.
    pub(crate) calls: AtomicU64,
}

/// What is one drone's.
#[repr(C, align(128))]
struct DroneBlock {
    words: DroneWords,
    slot: Slot,
    stats: LinkStats,
}

/// Where the parts begin, bytes.
#[derive(Clone, Copy, Debug)]
struct Layout {
    ticks: usize,
    drones: usize,
    end: usize,
}

const SHARED: usize = size_of::<Header>();
const HINT: usize = SHARED + size_of::<SharedWords>();
const ORDERS: usize = HINT + size_of::<PaddedWord>();
const ARRAYS: usize = ORDERS + size_of::<OrderWords>();

impl Layout {
    fn new(drones: usize, cores: usize) -> Self {
        let blocks = ARRAYS + cores * size_of::<PaddedWord>();
        Self { ticks: ARRAYS, drones: blocks, end: blocks + drones * size_of::<DroneBlock>() }
    }
}

/// The mapped control segment.
#[derive(Debug)]
pub struct Control {
    base: NonNull<u8>,
    layout: Layout,
    spec: ControlSpec,
    spin: u32,
    /// The memfd, in the process that made it.
    memfd: Option<OwnedFd>,
    /// When it was made, there, if there is a counter that tells.
    made: Option<Mark>,
}

// SAFETY: the mapping stays until drop, and all shared access goes through atomics or through copies of slots and
// statistics, which the done words order (see `barrier`).
unsafe impl Send for Control {}
// SAFETY: as above.
unsafe impl Sync for Control {}

impl Control {
    /// Makes the segment: the launcher's part. Children inherit its descriptor, see [`Control::fd`].
    ///
    /// # Errors
    /// [`BusError::Control`] for a number of drones or cores out of range, [`BusError::System`].
    pub fn create(spec: ControlSpec) -> Result<Self, BusError> {
        check_counts(&spec)?;
        let system = BusError::system;
        let memfd = memfd_create("skein-control", MemfdFlags::empty()).map_err(system("make the control segment"))?;
        let layout = Layout::new(spec.drones, spec.cores);
        ftruncate(&memfd, layout.end as u64).map_err(system("size the control segment"))?;
        let base = map(memfd.as_fd(), layout.end)?;
        let header = Header {
            magic: MAGIC,
            layout: LAYOUT,
            drones: spec.drones as u32,
            cores: spec.cores as u32,
            wait: spec.wait as u32,
            spin: spin_for(spec.drones.div_ceil(spec.per_process)),
            per_process: spec.per_process as u32,
        };
        let control = Self { base, layout, spec, spin: header.spin, memfd: Some(memfd), made: Mark::now() };
        // SAFETY: `base` is the start of a fresh, page-aligned mapping that holds a header, and nobody else has it yet.
        unsafe { base.cast::<Header>().write(header) };
        Ok(control)
    }

    /// Maps the segment whose descriptor was inherited under this number: everybody else's part.
    ///
    /// # Errors
    /// [`BusError::Io`] if there is no such descriptor, [`BusError::Control`] if it is not a control segment of this
    /// layout.
    pub fn attach(fd: RawFd) -> Result<Self, BusError> {
        let path = PathBuf::from(format!("/proc/self/fd/{fd}"));
        let file = OpenOptions::new().read(true).write(true).open(&path).map_err(BusError::io("open", &path))?;
        let size = fstat(&file).map_err(BusError::system("look at the control segment"))?.st_size as usize;
        let wrong = |why: String| Err(BusError::Control(format!("descriptor {fd} {why}")));
        if size < ARRAYS {
            return wrong(format!("holds {size} bytes, expected at least {ARRAYS}"));
        }
        let base = map(file.as_fd(), ARRAYS)?;
        // SAFETY: `base` starts a mapping of at least a header; its fields are integers, any value is valid.
        let header = unsafe { base.cast::<Header>().read() };
        unmap(base, ARRAYS);
        if (header.magic, header.layout) != (MAGIC, LAYOUT) {
            return wrong(format!(
                "is not a control segment of layout {LAYOUT}; run launcher and children of one build"
            ));
        }
        let wait = if header.wait == WaitMode::Yield as u32 { WaitMode::Yield } else { WaitMode::Block };
        let spec = ControlSpec {
            drones: header.drones as usize,
            cores: header.cores as usize,
            per_process: header.per_process as usize,
            wait,
        };
        check_counts(&spec)?;
        let layout = Layout::new(spec.drones, spec.cores);
        if size != layout.end {
            return wrong(format!("holds {size} bytes, expected {} for {} drones", layout.end, spec.drones));
        }
        let base = map(file.as_fd(), layout.end)?;
        Ok(Self { base, layout, spec, spin: header.spin, memfd: None, made: None })
    }

    /// Number of the descriptor to hand to children; `None` in a process that attached.
    #[must_use]
    pub fn fd(&self) -> Option<RawFd> {
        self.memfd.as_ref().map(AsRawFd::as_raw_fd)
    }

    /// What the segment was made for.
    #[must_use]
    pub fn spec(&self) -> ControlSpec {
        self.spec
    }

    /// A copy of a drone's slot. It belongs to tick k if [`Control::wait_done`](crate::barrier) said `Done` for k and
    /// k + 1 is not yet open.
    #[must_use]
    pub fn slot(&self, drone: usize) -> Slot {
        // SAFETY: see `slot_at`; `Slot` is plain data, the copy is volatile since another process writes it.
        unsafe { self.slot_at(drone).read_volatile() }
    }

    /// A copy of what a drone's radio has counted; exact while the drone waits for a tick or is dead.
    #[must_use]
    pub fn stats(&self, drone: usize) -> LinkStats {
        // SAFETY: see `stats_at`; plain data, as above.
        unsafe { self.stats_at(drone).read_volatile() }
    }

    /// System calls that the barrier has cost so far: the world's, and those of all drones.
    #[must_use]
    pub fn calls(&self) -> [u64; 2] {
        let drones = (0..self.spec.drones).map(|drone| self.drone(drone).calls.load(Ordering::Relaxed)).sum();
        [self.shared().calls.load(Ordering::Relaxed), drones]
    }

    /// What spans of a tick are measured by, once the launcher gave the go.
    pub(crate) fn stopwatch(&self) -> Stopwatch {
        Stopwatch::new(f64::from_bits(self.shared().ns_per_count.load(Ordering::Relaxed)))
    }

    /// The launcher's part: how fast the counter runs it knows from how long the start took.
    pub(crate) fn gauge_counter(&self) {
        let speed = self.made.map_or(0.0, |mark| mark.ns_per_count());
        self.shared().ns_per_count.store(speed.to_bits(), Ordering::Relaxed);
    }

    /// The tick word's number that a drone waits on; it should be pinned to that core.
    #[must_use]
    pub fn core_of(&self, drone: usize) -> usize {
        drone / self.spec.per_process % self.spec.cores
    }

    pub(crate) fn slot_at(&self, drone: usize) -> NonNull<Slot> {
        // SAFETY: a part of the block, which lies in the mapping.
        unsafe { self.block(drone).byte_add(offset_of!(DroneBlock, slot)).cast() }
    }

    pub(crate) fn stats_at(&self, drone: usize) -> NonNull<LinkStats> {
        // SAFETY: as in `slot_at`.
        unsafe { self.block(drone).byte_add(offset_of!(DroneBlock, stats)).cast() }
    }

    fn block(&self, drone: usize) -> NonNull<DroneBlock> {
        self.element(self.layout.drones, drone, self.spec.drones)
    }

    pub(crate) fn spin(&self) -> u32 {
        self.spin
    }

    pub(crate) fn shared(&self) -> &SharedWords {
        // SAFETY: the words lie in the mapping, are aligned, live as long as `self`, and are only touched atomically.
        unsafe { self.element(SHARED, 0, 1).as_ref() }
    }

    /// Drone that the world sleeps on, plus 1; 0 if it does not sleep.
    pub(crate) fn waiting(&self) -> &AtomicU32 {
        // SAFETY: as in `shared`.
        let word: &PaddedWord = unsafe { self.element(HINT, 0, 1).as_ref() };
        &word.0
    }

    pub(crate) fn orders(&self) -> &OrderWords {
        // SAFETY: as in `shared`.
        unsafe { self.element(ORDERS, 0, 1).as_ref() }
    }

    pub(crate) fn tick_word(&self, core: usize) -> &AtomicU32 {
        // SAFETY: as in `shared`.
        let word: &PaddedWord = unsafe { self.element(self.layout.ticks, core, self.spec.cores).as_ref() };
        &word.0
    }

    pub(crate) fn drone(&self, drone: usize) -> &DroneWords {
        // SAFETY: as in `shared`; the words are the block's first part.
        unsafe { self.block(drone).cast::<DroneWords>().as_ref() }
    }

    /// Element `index` of the array of `count` at `start`: in the mapping, and aligned, since every part is a multiple
    /// of the alignment of those after it.
    fn element<T>(&self, start: usize, index: usize, count: usize) -> NonNull<T> {
        assert!(index < count, "number {index} is not below {count}");
        // SAFETY: `start + count * size_of::<T>()` is within the mapping by construction of `Layout`.
        unsafe { self.base.byte_add(start + index * size_of::<T>()).cast() }
    }
}

impl Drop for Control {
    fn drop(&mut self) {
        unmap(self.base, self.layout.end);
    }
}

fn check_counts(spec: &ControlSpec) -> Result<(), BusError> {
    let ControlSpec { drones, cores, per_process, .. } = *spec;
    if [drones, cores, per_process].iter().all(|count| (1..=MAX_COUNT).contains(count)) {
        return Ok(());
    }
    let counts = format!("{drones}, {cores} and {per_process}");
    Err(BusError::Control(format!("expected 1 to {MAX_COUNT} drones, cores and drones a process, not {counts}")))
}

/// Spinning pays only while the world and all drones have a core of their own. Asked by the launcher, before anybody is
/// pinned and sees but one core.
fn spin_for(drones: usize) -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if drones < cores { SPIN } else { 0 }
}

pub(crate) fn map(fd: BorrowedFd<'_>, len: usize) -> Result<NonNull<u8>, BusError> {
    // SAFETY: a fresh mapping at an address of the kernel's choice touches no other memory.
    let base = unsafe { mmap(std::ptr::null_mut(), len, ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED, fd, 0) };
    let base = base.map_err(BusError::system("map the control segment"))?;
    NonNull::new(base.cast()).ok_or_else(|| BusError::Control("was mapped at address 0".to_owned()))
}

pub(crate) fn unmap(base: NonNull<u8>, len: usize) {
    // SAFETY: the callers made this mapping with this length, and drop every pointer into it. It cannot fail for that.
    let _ = unsafe { munmap(base.as_ptr().cast(), len) };
}
