//! Finds out that a pilot ends this process.
#![allow(unsafe_code)]

use crate::error::BusError;
use crate::fork_guard::ForkGuard;
use crate::process_end::end_process;
use rustix::io::Errno;
use std::sync::OnceLock;

/// Exit code of a process that was ended by what must not end it.
const ENDED: i32 = 3;

/// Says why the process must not end; `None` if it may.
type WhyNot = fn() -> Option<String>;

/// The process that is guarded, and what decides whether it may end.
static GUARDED: OnceLock<(ForkGuard, WhyNot)> = OnceLock::new();

/// From now on, the exit of this process (as by [`std::process::exit`]) first calls `why_not`, on the thread that ends the process. If that
/// says why the process must not end there, the process ends with these words on stderr and exit code 3. `why_not` must not use values of
/// the thread that are dropped. Copies of the process that `fork` made may end. Later calls change nothing.
///
/// # Errors
/// [`BusError::System`] if the system takes no more handlers, or is too old, see [`ForkGuard::new`].
pub fn guard_exit(why_not: fn() -> Option<String>) -> Result<(), BusError> {
    let own = ForkGuard::new()?;
    if GUARDED.set((own, why_not)).is_err() {
        return Ok(());
    }
    // SAFETY: the function stays in the program for as long as it runs.
    match unsafe { libc::atexit(look) } {
        0 => Ok(()),
        // The only reason that there is.
        _ => Err(BusError::system("register a function for the end of this process")(Errno::NOMEM)),
    }
}

extern "C" fn look() {
    let Some((own, why_not)) = GUARDED.get() else { return };
    if !own.is_copy()
        && let Some(words) = why_not()
    {
        end_process(&words, ENDED);
    }
}
