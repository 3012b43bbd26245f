//! Sleeping on a word of shared memory, between processes.

use rustix::thread::futex::{self, Flags, Timespec};
use std::sync::atomic::AtomicU32;
use std::time::Duration;

/// How long a wait lasts before the waiting process asks whether the other side is still alive.
pub(crate) const SLICE: Duration = Duration::from_millis(100);

/// Sleeps while `word` holds `expected`, at most `limit`. May return early without a reason: the caller looks again.
pub(crate) fn wait(word: &AtomicU32, expected: u32, limit: Duration) {
    let limit = Timespec { tv_sec: limit.as_secs() as i64, tv_nsec: i64::from(limit.subsec_nanos()) };
    // No flags: a private futex would not work between processes. A timeout, an interruption and a changed word mean the
    // same to a caller that looks again.
    let _ = futex::wait(word, Flags::empty(), expected, Some(&limit));
}

/// As [`wait`], but without a limit, which saves the kernel a timer.
pub(crate) fn wait_on(word: &AtomicU32, expected: u32) {
    let _ = futex::wait(word, Flags::empty(), expected, None);
}

/// Wakes every thread that sleeps on `word`.
pub(crate) fn wake_all(word: &AtomicU32) {
    // The call fails only for an address that is not mapped, and `word` is a reference.
    let _ = futex::wake(word, Flags::empty(), i32::MAX as u32);
}
