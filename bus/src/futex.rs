//! Sleeping on a word of shared memory, between processes.

use rustix::thread::futex::{self, Flags, Timespec};
use std::sync::atomic::AtomicU32;
use std::time::Duration;

/// Sleeps while `word` holds `expected`, at most `limit`. May return early for no reason: the caller looks again.
pub(crate) fn wait(word: &AtomicU32, expected: u32, limit: Duration) {
    let limit = Timespec { tv_sec: limit.as_secs() as i64, tv_nsec: i64::from(limit.subsec_nanos()) };
    // Empty flags: private futexes do not cross process borders. Timed out, interrupted and changed all mean the same
    // to a caller that looks again.
    let _ = futex::wait(word, Flags::empty(), expected, Some(&limit));
}

/// The same without a limit, which spares the kernel a timer.
pub(crate) fn wait_on(word: &AtomicU32, expected: u32) {
    let _ = futex::wait(word, Flags::empty(), expected, None);
}

/// Wakes everybody who sleeps on `word`.
pub(crate) fn wake_all(word: &AtomicU32) {
    // It fails only for an address that is not mapped, and this is a reference.
    let _ = futex::wake(word, Flags::empty(), i32::MAX as u32);
}
