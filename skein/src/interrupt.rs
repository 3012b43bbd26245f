//! SIGINT, SIGTERM and SIGHUP: they set a flag that commands look at.

use crate::exit::Failure;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The last of these signals that came in.
pub(crate) struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// Replaces the default handling of SIGINT, SIGTERM and SIGHUP, which ends the process. A SIGHUP that is ignored, as
    /// under `nohup`, stays ignored.
    pub(crate) fn watch() -> Result<Self, Failure> {
        let noted = Arc::new(AtomicUsize::new(0));
        let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
        for signal in [SIGINT, SIGTERM].into_iter().chain(hang_up) {
            signal_hook::flag::register_usize(signal, Arc::clone(&noted), signal.unsigned_abs() as usize)
                .map_err(|error| Failure::environment(format!("watching for signal {signal}: {error}")))?;
        }
        Ok(Self(noted))
    }

    /// The signal's number; `None` if none came in.
    pub(crate) fn signal(&self) -> Option<i32> {
        number(self.0.load(Ordering::Relaxed))
    }

    /// As [`Interrupt::signal`], and forgets the signal: the next one is noted anew.
    pub(crate) fn take(&self) -> Option<i32> {
        number(self.0.swap(0, Ordering::Relaxed))
    }
}

fn number(signal: usize) -> Option<i32> {
    i32::try_from(signal).ok().filter(|&signal| signal != 0)
}

/// Whether this process ignores the signal.
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    ignored.is_some_and(|ignored| ignored >> (signal - 1) & 1 == 1)
}
