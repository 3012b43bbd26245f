//! The control segment: a memfd that every process of a run maps. It carries the clock and the actuator slots; messages
//! do not pass through it.
//!
//! Layout: a header, the mission's and the world's words, the world's hint, the request words, one tick word per core,
//! then one block per drone with its words, a [`Slot`] and a [`LinkStats`]. Each part has cache lines of its own.
#![allow(unsafe_code)]

use crate::barrier::{Barrier, Patience, TickOutcome};
use crate::drone_block::{DroneBlock, DroneBlocks};
use crate::error::BusError;
use crate::mission::{MissionState, MissionWords, WorldState};
use crate::process_request::{ProcessRequest, RequestChannel, RequestWords};
use crate::segment::{Segment, SharedArray, open_inherited};
use crate::spec::{ControlSpec, WaitMode};
use crate::stopwatch::{CounterSpeed, Stopwatch};
use crate::tick_word::PaddedWord;
use crate::version::Version;
use skein_protocol::Tick;
use skein_protocol::slot::{LinkStats, Slot};
use std::mem::offset_of;
use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

const MAGIC: u32 = u32::from_le_bytes(*b"SKN1");
/// The first layout whose header has versions.
const LAYOUT_WITH_VERSIONS: u32 = 7;
/// Looks at a word before sleeping, if every process has a core of its own.
const SPIN: u32 = 300;

/// The first 16 bytes stay what they are in all versions, and so does the word at [`REFUSED`]: programs of different versions tell
/// each other by these.
#[repr(C, align(64))]
struct Header {
    magic: u32,
    layout: u32,
    /// Version of the launcher, see [`Version::word`].
    version: u64,
    drones: u32,
    cores: u32,
    wait: u32,
    spin: u32,
    per_process: u32,
}

/// Words that the launcher and the world write.
#[repr(C, align(128))]
struct SharedWords {
    mission: MissionWords,
    /// System calls that the world has made for the barrier.
    calls: AtomicU64,
    /// Nanoseconds per count of the processor's counter: the bits of an `f64`.
    ns_per_count: AtomicU64,
}

/// Where a program of another version says which it is: the word of its [`Version`].
const REFUSED: usize = size_of::<Header>();
const SHARED: usize = 128;
const HINT: usize = SHARED + size_of::<SharedWords>();
const REQUESTS: usize = HINT + size_of::<PaddedWord>();
const ARRAYS: usize = REQUESTS + size_of::<RequestWords>();

/// Size of the segment, bytes.
fn segment_len(spec: &ControlSpec) -> usize {
    blocks_at(spec) + spec.drones * size_of::<DroneBlock>()
}

/// Where the drones' blocks begin, bytes.
fn blocks_at(spec: &ControlSpec) -> usize {
    ARRAYS + spec.cores * size_of::<PaddedWord>()
}

/// The mapped control segment: one object for every role in a run. Each method says which process calls it.
#[derive(Debug)]
pub struct Control {
    spec: ControlSpec,
    barrier: Barrier,
    mission: MissionState,
    requests: RequestChannel,
    counter: CounterSpeed,
    refused: SharedArray<AtomicU64>,
    /// The memfd, in the process that made it.
    memfd: Option<OwnedFd>,
}

impl Control {
    /// Makes the segment. For the launcher; children inherit the descriptor, see [`Control::fd`].
    ///
    /// # Errors
    /// [`BusError::Control`] if a number of drones or cores is out of range, [`BusError::System`].
    pub fn create(spec: ControlSpec) -> Result<Self, BusError> {
        spec.check()?;
        let (segment, memfd) = Segment::create("skein-control", segment_len(&spec))?;
        let header = Header {
            magic: MAGIC,
            layout: Version::OWN.layout.into(),
            version: Version::OWN.word(),
            drones: spec.drones as u32,
            cores: spec.cores as u32,
            wait: spec.wait as u32,
            spin: spin_for(spec.drones.div_ceil(spec.per_process)),
            per_process: spec.per_process as u32,
        };
        let spin = header.spin;
        let segment = Arc::new(segment);
        // SAFETY: the pointer is aligned and into a new mapping, which no other process has yet.
        unsafe { segment.array::<Header>(0, 1).pointer(0).write(header) };
        Ok(Self { memfd: Some(memfd), counter: counter(&segment).started(), ..Self::over(&segment, spec, spin) })
    }

    /// Maps the segment whose descriptor was inherited under this number. For every process but the launcher.
    ///
    /// # Errors
    /// [`BusError::Io`] if there is no such descriptor, [`BusError::Control`] if it is not a control segment,
    /// [`BusError::Version`] if its launcher is of another version, which is then told so: see [`Control::refused`].
    pub fn attach(fd: RawFd) -> Result<Self, BusError> {
        let (file, size) = open_inherited(fd)?;
        let wrong = |why: String| Err(BusError::Control(format!("descriptor {fd} {why}")));
        if size < ARRAYS {
            return wrong(format!("holds {size} bytes, expected at least {ARRAYS}"));
        }
        let head = Arc::new(Segment::map(file.as_fd(), ARRAYS)?);
        // SAFETY: the pointer is aligned and into the mapping, which `head` keeps. The fields are integers, for which every
        // bit pattern is valid, and no process changes them after `create`.
        let header = unsafe { head.array::<Header>(0, 1).pointer(0).read() };
        if header.magic != MAGIC {
            return wrong("is not a control segment".to_owned());
        }
        if header.layout < LAYOUT_WITH_VERSIONS {
            let layout = header.layout;
            return wrong(format!(
                "has the layout {layout} of an early Skein, expected {}: use one version",
                Version::OWN.layout
            ));
        }
        let launcher = Version::of_word(header.version);
        if launcher != Version::OWN {
            refused(&head).get(0).store(Version::OWN.word(), Ordering::Release);
            return Err(BusError::Version { own: Version::OWN, launcher });
        }
        let spec = ControlSpec {
            drones: header.drones as usize,
            cores: header.cores as usize,
            per_process: header.per_process as usize,
            wait: if header.wait == WaitMode::Yield as u32 { WaitMode::Yield } else { WaitMode::Block },
        };
        spec.check()?;
        let expected = segment_len(&spec);
        if size != expected {
            return wrong(format!("holds {size} bytes, expected {expected} for {} drones", spec.drones));
        }
        Ok(Self::over(&Arc::new(Segment::map(file.as_fd(), expected)?), spec, header.spin))
    }

    fn over(segment: &Arc<Segment>, spec: ControlSpec, spin: u32) -> Self {
        let barrier = Barrier::new(
            segment.array(ARRAYS, spec.cores),
            segment.array(HINT, 1),
            DroneBlocks::new(segment.array(blocks_at(&spec), spec.drones)),
            segment.array(SHARED + offset_of!(SharedWords, calls), 1),
            (spec.wait, spin),
        );
        Self {
            spec,
            barrier,
            mission: MissionState::new(segment.array(SHARED + offset_of!(SharedWords, mission), 1)),
            requests: RequestChannel::new(segment.array(REQUESTS, 1)),
            counter: counter(segment),
            refused: refused(segment),
            memfd: None,
        }
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

    /// The version of a program that tried to attach and could not because of it. For the launcher.
    #[must_use]
    pub fn refused(&self) -> Option<Version> {
        Some(self.refused.get(0).load(Ordering::Acquire)).filter(|&word| word != 0).map(Version::of_word)
    }

    /// Number of the tick word that a drone waits on. The drone should be pinned to the core of this number.
    #[must_use]
    pub fn core_of(&self, drone: usize) -> usize {
        self.spec.core_of(drone)
    }

    /// Opens tick `k` for all drones. For the world, which runs on core 0 and has already sent the downlink.
    ///
    /// # Errors
    /// [`BusError::Control`] for a tick past 2³¹ − 2.
    pub fn open_tick(&self, k: Tick) -> Result<(), BusError> {
        self.barrier.open_tick(k)
    }

    /// Ends the mission for all drones. For the world, and for the launcher after the world's death.
    pub fn close(&self) {
        self.barrier.close();
    }

    /// Waits until every drone has answered tick `k`, is dead, or has used up the patience, and writes the result of each
    /// to `answers`, one entry per drone. Entries that are [`TickOutcome::Absent`] stay as they are. Allocates nothing. For
    /// the world.
    ///
    /// # Errors
    /// [`BusError::Control`] for a tick past 2³¹ − 2, or if `answers` has not one entry per drone.
    pub fn wait_done(&self, k: Tick, patience: Patience, answers: &mut [TickOutcome]) -> Result<(), BusError> {
        self.barrier.wait_done(k, patience, answers)
    }

    /// A copy of a drone's slot. It belongs to tick k if [`Control::wait_done`] returned `Done` for k and k + 1 is not yet
    /// open.
    #[must_use]
    pub fn slot(&self, drone: usize) -> Slot {
        self.barrier.slot(drone)
    }

    /// A copy of the counts of a drone's radio; exact while the drone waits for a tick or is dead.
    #[must_use]
    pub fn stats(&self, drone: usize) -> LinkStats {
        self.barrier.stats(drone)
    }

    /// System calls that the barrier has cost so far: those of the world, and those of all drones.
    #[must_use]
    pub fn calls(&self) -> [u64; 2] {
        self.barrier.calls()
    }

    /// Incarnation of the drone's process that is ready to fly; `None` while there is none.
    #[must_use]
    pub fn ready(&self, drone: usize) -> Option<u32> {
        self.barrier.words(drone).ready()
    }

    /// Reports that a drone's process of this incarnation, from 1, is ready to fly. For a relay, in whose place that process is on another
    /// machine.
    pub fn announce(&self, drone: usize, incarnation: u32) {
        self.barrier.words(drone).set_ready(incarnation);
    }

    /// Notes how a drone's process ended by itself, before the drone is marked as dead. For the supervisor.
    pub fn set_end(&self, drone: usize, status: ExitStatus) {
        self.barrier.words(drone).set_end(status.into_raw());
    }

    /// How the last process of a dead drone ended, if it ended by itself.
    #[must_use]
    pub fn end(&self, drone: usize) -> Option<ExitStatus> {
        self.barrier.words(drone).end().map(ExitStatus::from_raw)
    }

    /// Marks a drone whose process is gone (reaped) as dead, and wakes the world if it waits for the drone. For the
    /// supervisor.
    pub fn mark_dead(&self, drone: usize) {
        self.barrier.words(drone).mark_dead();
    }

    /// Whether a drone's process is marked as dead.
    #[must_use]
    pub fn is_dead(&self, drone: usize) -> bool {
        self.barrier.words(drone).is_dead()
    }

    /// Removes the mark before a new process is started, which answers from tick `from` on. Until then the world counts
    /// the drone as [`TickOutcome::Absent`]. For the supervisor.
    pub fn revive(&self, drone: usize, from: Tick) {
        self.barrier.words(drone).revive(from);
    }

    /// Keeps a drone from reading or answering any tick; to be called before SIGSTOP. From then on the world counts the
    /// drone as [`TickOutcome::Absent`].
    pub fn freeze(&self, drone: usize) {
        self.barrier.words(drone).freeze();
    }

    /// Sets the first tick that a drone may read and answer; to be called before SIGCONT.
    pub fn set_resume_from(&self, drone: usize, from: Tick) {
        self.barrier.words(drone).set_resume_from(from);
    }

    /// Lets the world begin. For the launcher.
    pub fn give_go(&self) {
        self.counter.measure();
        self.mission.give_go();
    }

    /// Waits for the launcher's go. False if `alive`, asked every 100 ms, returned false, or if a stop was requested. For
    /// the world.
    pub fn wait_go(&self, alive: impl FnMut() -> bool) -> bool {
        self.mission.wait_go(alive)
    }

    /// Asks the world to end the mission after the current tick. The launcher chooses `reason`, not 0: for example, a
    /// signal's number.
    pub fn request_stop(&self, reason: u32) {
        self.mission.request_stop(reason);
    }

    /// The reason, if a stop was requested.
    #[must_use]
    pub fn stop_requested(&self) -> Option<u32> {
        self.mission.stop_requested()
    }

    /// Tells the launcher what the world is doing. For the world.
    pub fn set_world_state(&self, state: WorldState) {
        self.mission.set_world_state(state);
    }

    /// What the world is doing.
    #[must_use]
    pub fn world_state(&self) -> WorldState {
        self.mission.world_state()
    }

    /// Makes a request and waits, at most `limit`, until the supervisor has carried it out; the supervisor's reply. One
    /// request at a time. For the world.
    ///
    /// # Errors
    /// [`BusError::NoAnswer`].
    pub fn request(&self, request: ProcessRequest, limit: Duration) -> Result<u32, BusError> {
        self.requests.request(request, limit)
    }

    /// Waits at most `limit` for a request that is not yet answered. For the supervisor.
    #[must_use]
    pub fn next_request(&self, limit: Duration) -> Option<ProcessRequest> {
        self.requests.next(limit)
    }

    /// Reports that the request is carried out; the world gets `reply`. For the supervisor.
    pub fn answer_request(&self, reply: u32) {
        self.requests.answer(reply);
    }

    pub(crate) fn barrier(&self) -> &Barrier {
        &self.barrier
    }

    /// The stopwatch for spans within a tick, once the launcher gave the go.
    pub(crate) fn stopwatch(&self) -> Stopwatch {
        self.counter.stopwatch()
    }
}

fn refused(segment: &Arc<Segment>) -> SharedArray<AtomicU64> {
    segment.array(REFUSED, 1)
}

fn counter(segment: &Arc<Segment>) -> CounterSpeed {
    CounterSpeed::new(segment.array(SHARED + offset_of!(SharedWords, ns_per_count), 1))
}

/// Spinning pays only while the world and all drones have a core of their own. To be called in the launcher before any
/// process is pinned: a pinned one sees only one core.
fn spin_for(drones: usize) -> u32 {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if drones < cores { SPIN } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process_request::RequestKind;
    use skein_protocol::DroneId;
    use std::os::unix::fs::FileExt;

    fn control() -> Control {
        Control::create(ControlSpec { drones: 2, cores: 1, per_process: 1, wait: WaitMode::Block }).unwrap()
    }

    #[test]
    fn a_request_is_carried_out_once_and_answered() {
        let launcher = control();
        let world = Control::attach(launcher.fd().unwrap()).unwrap();
        let restart = ProcessRequest { kind: RequestKind::Restart, drone: DroneId(1), tick: 70 };
        let supervisor = std::thread::spawn(move || {
            let mut seen = Vec::new();
            while seen.len() < 2 {
                if let Some(request) = launcher.next_request(Duration::from_millis(50)) {
                    seen.push(request);
                    launcher.answer_request(seen.len() as u32 + 6);
                }
            }
            assert_eq!(launcher.next_request(Duration::ZERO), None);
            seen
        });
        assert_eq!(world.request(restart, Duration::from_secs(5)).unwrap(), 7);
        let kill = ProcessRequest { kind: RequestKind::Kill, ..restart };
        assert_eq!(world.request(kill, Duration::from_secs(5)).unwrap(), 8);
        assert_eq!(supervisor.join().unwrap(), [restart, kill]);
    }

    #[test]
    fn without_a_supervisor_the_world_gives_up_after_the_limit() {
        let kill = ProcessRequest { kind: RequestKind::Kill, drone: DroneId(0), tick: 3 };
        let error = control().request(kill, Duration::from_millis(20)).unwrap_err();
        assert!(matches!(error, BusError::NoAnswer { .. }), "{error}");
    }

    #[test]
    fn a_launcher_of_another_version_is_refused_and_told() {
        let launcher = control();
        let fd = launcher.fd().unwrap();
        assert!(Control::attach(fd).is_ok() && launcher.refused().is_none());
        let (file, _) = open_inherited(fd).unwrap();
        let other = Version { minor: Version::OWN.minor + 1, ..Version::OWN };
        file.write_all_at(&other.word().to_ne_bytes(), offset_of!(Header, version) as u64).unwrap();
        let error = Control::attach(fd).unwrap_err();
        assert!(matches!(error, BusError::Version { own: Version::OWN, launcher } if launcher == other), "{error}");
        assert_eq!(launcher.refused(), Some(Version::OWN));
        file.write_all_at(&6_u32.to_ne_bytes(), offset_of!(Header, layout) as u64).unwrap();
        assert!(Control::attach(fd).unwrap_err().to_string().contains("has the layout 6 of an early Skein"));
    }

    #[test]
    fn the_layout_is_that_of_its_number() {
        // Programs of all versions find these here.
        let head = [offset_of!(Header, magic), offset_of!(Header, layout), offset_of!(Header, version)];
        assert_eq!((head, REFUSED), ([0, 4, 8], 64));
        assert_eq!((SHARED, HINT, REQUESTS, ARRAYS), (128, 256, 384, 512));
        assert_eq!(offset_of!(SharedWords, calls), 16);
        assert_eq!(offset_of!(SharedWords, ns_per_count), 24);
    }
}
