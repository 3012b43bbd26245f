//! Signals. SIGINT, SIGTERM and SIGHUP set a flag that commands look at; SIGXFSZ ends no command.

use crate::exit::Failure;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use skein_bus::outlive_file_limit;
use skein_runtime::HangWatch;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The last of these signals that came in.
pub(crate) struct Interrupt {
    noted: Arc<AtomicUsize>,
    /// Ends this process if a pilot keeps it from looking at the flag.
    _hangs: HangWatch,
}

impl Interrupt {
    /// Replaces the default handling of SIGINT, SIGTERM and SIGHUP, which ends the process. A SIGHUP that is ignored, as
    /// under `nohup`, stays ignored. From now on, a file that reaches the limit of file sizes is an error as any other.
    pub(crate) fn watch() -> Result<Self, Failure> {
        outlive_file_limit();
        let noted = Arc::new(AtomicUsize::new(0));
        let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
        let signals: Vec<i32> = [SIGINT, SIGTERM].into_iter().chain(hang_up).collect();
        for &signal in &signals {
            signal_hook::flag::register_usize(signal, Arc::clone(&noted), signal.unsigned_abs() as usize)
                .map_err(|error| Failure::environment(format!("watching for signal {signal}: {error}")))?;
        }
        let hangs = HangWatch::start(&signals).map_err(Failure::environment)?;
        Ok(Self { noted, _hangs: hangs })
    }

    /// The signal's number; `None` if none came in.
    pub(crate) fn signal(&self) -> Option<i32> {
        number(self.noted.load(Ordering::Relaxed))
    }

    /// As [`Interrupt::signal`], and forgets the signal: the next one is noted anew.
    pub(crate) fn take(&self) -> Option<i32> {
        number(self.noted.swap(0, Ordering::Relaxed))
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
