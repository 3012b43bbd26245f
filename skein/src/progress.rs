//! A progress bar on a terminal, in front of the recorder.

use indicatif::{ProgressBar, ProgressStyle};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use std::io::IsTerminal;

/// Ticks between two looks at the bar.
const STRIDE: u64 = 64;

/// Hands records on and shows how far the mission is.
pub struct Progress<S> {
    inner: S,
    bar: ProgressBar,
}

impl<S: RecordSink> Progress<S> {
    /// A bar up to the mission's time-out, unless `quiet` or stderr is no terminal.
    pub fn new(inner: S, quiet: bool, ticks: u64) -> Self {
        let bar =
            if quiet || !std::io::stderr().is_terminal() { ProgressBar::hidden() } else { ProgressBar::new(ticks) };
        let template = "{spinner} {msg} {wide_bar} {per_sec}, at most {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { inner, bar }
    }

    /// Takes the bar off the screen and gives the recorder back.
    pub fn finish(self) -> S {
        self.bar.finish_and_clear();
        self.inner
    }
}

impl<S: RecordSink> RecordSink for Progress<S> {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        if record.head.tick.is_multiple_of(STRIDE) {
            self.bar.set_position(record.head.tick);
            self.bar.set_message(format!("t = {:.1} s", record.head.now.secs()));
        }
        self.inner.take(record)
    }

    fn ready(&self) -> bool {
        self.inner.ready()
    }
}
