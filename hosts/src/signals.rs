//! The signals that end a program which offers something until then.

use crate::error::HostsError;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

/// The number of a signal that came in; 0 while none did.
pub(crate) fn watch_signals() -> Result<Arc<AtomicUsize>, HostsError> {
    let noted = Arc::new(AtomicUsize::new(0));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register_usize(signal, Arc::clone(&noted), signal.unsigned_abs() as usize)
            .map_err(HostsError::system(format!("watching for signal {signal}")))?;
    }
    Ok(noted)
}
