//! What the world asks of the supervisor at an exact tick: to kill, freeze, resume or restart a drone's process.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::futex::{self, SLICE};
use crate::segment::{Atomics, SharedArray};
use skein_protocol::{DroneId, Tick};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// What the supervisor is to do to a drone's process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum RequestKind {
    /// Send SIGKILL, and reap the process. If other drones fly in it, it goes on without this drone.
    Kill = 1,
    /// Send SIGSTOP.
    Freeze = 2,
    /// Send SIGCONT.
    Resume = 3,
    /// Start a new process for a dead one.
    Restart = 4,
    /// Send SIGKILL, and reap the process with all drones in it.
    KillProcess = 5,
}

/// One request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProcessRequest {
    /// What to do.
    pub kind: RequestKind,
    /// The drone.
    pub drone: DroneId,
    /// The tick of the request. For [`RequestKind::Resume`] and [`RequestKind::Restart`]: the first tick that the drone is
    /// to answer.
    pub tick: Tick,
}

/// The shared words.
#[repr(C, align(128))]
#[derive(Debug)]
pub(crate) struct RequestWords {
    /// Number of the last request.
    asked: AtomicU32,
    kind: AtomicU32,
    drone: AtomicU32,
    tick: AtomicU32,
    /// Number of the last request that was carried out.
    answered: AtomicU32,
    reply: AtomicU32,
}

// SAFETY: atomics and padding.
unsafe impl Atomics for RequestWords {}

/// The channel between the world and the supervisor. It holds one request at a time.
#[derive(Debug)]
pub(crate) struct RequestChannel(SharedArray<RequestWords>);

impl RequestChannel {
    pub(crate) fn new(words: SharedArray<RequestWords>) -> Self {
        Self(words)
    }

    /// See [`crate::Control::request`].
    pub(crate) fn request(&self, request: ProcessRequest, limit: Duration) -> Result<u32, BusError> {
        let words = self.0.get(0);
        words.kind.store(request.kind as u32, Ordering::Relaxed);
        words.drone.store(request.drone.0, Ordering::Relaxed);
        words.tick.store(u32::try_from(request.tick).unwrap_or(u32::MAX), Ordering::Relaxed);
        let number = words.asked.load(Ordering::Relaxed).wrapping_add(1);
        words.asked.store(number, Ordering::Release);
        futex::wake_all(&words.asked);
        let end = Instant::now() + limit;
        loop {
            let answered = words.answered.load(Ordering::Acquire);
            if answered == number {
                return Ok(words.reply.load(Ordering::Relaxed));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(BusError::NoAnswer { what: format!("{request:?}"), limit_s: limit.as_secs_f64() });
            }
            futex::wait(&words.answered, answered, left.min(SLICE));
        }
    }

    /// See [`crate::Control::next_request`].
    pub(crate) fn next(&self, limit: Duration) -> Option<ProcessRequest> {
        let words = self.0.get(0);
        let answered = words.answered.load(Ordering::Relaxed);
        let mut asked = words.asked.load(Ordering::Acquire);
        if asked == answered {
            futex::wait(&words.asked, asked, limit);
            asked = words.asked.load(Ordering::Acquire);
        }
        if asked == answered {
            return None;
        }
        let kind = match words.kind.load(Ordering::Relaxed) {
            1 => RequestKind::Kill,
            2 => RequestKind::Freeze,
            3 => RequestKind::Resume,
            5 => RequestKind::KillProcess,
            _ => RequestKind::Restart,
        };
        let tick = Tick::from(words.tick.load(Ordering::Relaxed));
        Some(ProcessRequest { kind, drone: DroneId(words.drone.load(Ordering::Relaxed)), tick })
    }

    /// See [`crate::Control::answer_request`].
    pub(crate) fn answer(&self, reply: u32) {
        let words = self.0.get(0);
        words.reply.store(reply, Ordering::Relaxed);
        words.answered.store(words.asked.load(Ordering::Relaxed), Ordering::Release);
        futex::wake_all(&words.answered);
    }
}
