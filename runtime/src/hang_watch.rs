//! Ends an interrupted run whose pilot does not return: no signal is looked at before the tick ends.

use crate::error::RuntimeError;
use crate::in_pilots::{Stay, stays};
use signal_hook::iterator::{Handle, Signals};
use skein_bus::end_process;
use std::time::{Duration, Instant};

/// How often pilots are looked at once a signal came in. Signals that come within this time after the first one count as one.
const LOOK: Duration = Duration::from_millis(100);
/// How long a pilot may take for one step after a signal. Chosen by hand: longer than any leader plans.
const PATIENCE: Duration = Duration::from_secs(2);
/// Stack of the thread, bytes.
const STACK: usize = 256 << 10;

/// A thread that waits for signals, for as long as this lives. A pilot of this process that is in one and the same step for two seconds after
/// a signal, or when a second signal comes in, hangs. The process then names its drone on stderr and ends, with 128 plus the signal's
/// number as exit code.
#[derive(Debug)]
pub struct HangWatch(Handle);

impl HangWatch {
    /// Waits for these signals. What else they do in this process, they still do; their default action is none any more.
    ///
    /// # Errors
    /// [`RuntimeError::System`] if the system refuses.
    pub fn start(signals: &[i32]) -> Result<Self, RuntimeError> {
        let failed = RuntimeError::system("watching for signals");
        let mut signals = Signals::new(signals).map_err(failed)?;
        let handle = signals.handle();
        let thread = std::thread::Builder::new().name("hang-watch".to_owned()).stack_size(STACK);
        thread.spawn(move || watch(&mut signals)).map_err(RuntimeError::system("starting a thread"))?;
        Ok(Self(handle))
    }
}

impl Drop for HangWatch {
    fn drop(&mut self) {
        self.0.close();
    }
}

fn watch(signals: &mut Signals) {
    let Some(mut signal) = signals.forever().next() else { return };
    std::thread::sleep(LOOK);
    signal = signals.pending().last().unwrap_or(signal);
    let (mut patience, mut before, mut since) = (PATIENCE, stays(), Instant::now());
    while !signals.is_closed() {
        std::thread::sleep(LOOK);
        if let Some(again) = signals.pending().last() {
            (signal, patience) = (again, Duration::ZERO);
        }
        let now = stays();
        if now != before {
            (before, since) = (now, Instant::now());
        } else if !before.is_empty() && since.elapsed() >= patience {
            end_process(&words(&before, signal), 128 + signal);
        }
    }
}

fn words(hang: &[Stay], signal: i32) -> String {
    let drones: Vec<String> = hang.iter().map(|stay| stay.drone().to_string()).collect();
    format!(
        "interrupted by signal {signal}, but the pilot of drone {} does not return: the run ends without a summary; `skein report` writes \
         up what was recorded; with --runtime processes, a pilot that hangs is killed, and the others fly on",
        drones.join(", ")
    )
}
