//! Progress bars on stderr, if it is a terminal.

use indicatif::{ProgressBar, ProgressStyle};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_sweep::Progress;
use std::io::IsTerminal;
use std::time::Duration;

/// Ticks between two updates of the bar.
const STRIDE: u64 = 64;

/// Forwards records and shows how far the mission is.
pub(crate) struct MissionBar<S> {
    inner: S,
    bar: ProgressBar,
}

impl<S: RecordSink> MissionBar<S> {
    /// A bar up to the mission's time-out. It is hidden if `quiet` or if stderr is not a terminal.
    pub(crate) fn new(inner: S, quiet: bool, ticks: u64) -> Self {
        Self { inner, bar: bar(quiet, ticks, "{spinner} {msg} {wide_bar} {per_sec}, at most {eta} left") }
    }

    /// Removes the bar from the screen and returns the recorder.
    pub(crate) fn finish(self) -> S {
        self.bar.finish_and_clear();
        self.inner
    }
}

impl<S: RecordSink> RecordSink for MissionBar<S> {
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

/// Shows how many of several runs are done.
pub(crate) struct RunsBar {
    quiet: bool,
    bar: Option<ProgressBar>,
}

impl RunsBar {
    /// A bar that appears with the first progress. It is hidden if `quiet` or if stderr is not a terminal.
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet, bar: None }
    }

    /// Shows the progress. Runs that are done at the first call do not count for the speed.
    pub(crate) fn show(&mut self, progress: Progress) {
        let (done, runs) = (progress.done as u64, progress.runs as u64);
        let quiet = self.quiet;
        let new = || {
            let bar = bar(quiet, runs, "{spinner} {pos} of {len} runs {wide_bar} {per_sec}, {eta} left");
            bar.with_position(done).with_elapsed(Duration::ZERO)
        };
        let bar = self.bar.get_or_insert_with(new);
        bar.set_position(done);
        bar.tick();
    }

    /// Removes the bar from the screen.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

fn bar(quiet: bool, length: u64, template: &str) -> ProgressBar {
    let hidden = quiet || !std::io::stderr().is_terminal();
    let bar = if hidden { ProgressBar::hidden() } else { ProgressBar::new(length) };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}
