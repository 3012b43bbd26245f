//! SIGINT and SIGTERM, noted and asked for.

use crate::exit::Failure;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The first signal that came in.
pub struct Interrupt(Arc<AtomicUsize>);

impl Interrupt {
    /// Takes SIGINT and SIGTERM over from the system.
    pub fn watch() -> Result<Self, Failure> {
        let noted = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register_usize(signal, Arc::clone(&noted), signal.unsigned_abs() as usize)
                .map_err(|error| Failure::environment(format!("watching for signal {signal}: {error}")))?;
        }
        Ok(Self(noted))
    }

    /// Its number.
    pub fn signal(&self) -> Option<i32> {
        i32::try_from(self.0.load(Ordering::Relaxed)).ok().filter(|&signal| signal != 0)
    }
}
