//! SIGINT and SIGTERM: they set a flag that commands look at.

use crate::exit::Failure;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The last of these signals that came in.
pub(crate) struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// Replaces the default handling of SIGINT and SIGTERM, which ends the process.
    pub(crate) fn watch() -> Result<Self, Failure> {
        let noted = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register_usize(signal, Arc::clone(&noted), signal.unsigned_abs() as usize)
                .map_err(|error| Failure::environment(format!("watching for signal {signal}: {error}")))?;
        }
        Ok(Self(noted))
    }

    /// The signal's number; `None` if none came in.
    pub(crate) fn signal(&self) -> Option<i32> {
        i32::try_from(self.0.load(Ordering::Relaxed)).ok().filter(|&signal| signal != 0)
    }
}
