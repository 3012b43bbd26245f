//! Progress bars on stderr, if it is a terminal.

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_protocol::{Course, horizontal};
use skein_sweep::Progress;
use std::io::IsTerminal;
use std::time::Duration;

/// Ticks between two updates of the bar.
const STRIDE: u64 = 64;
/// Steps of the bar per metre of the way.
const STEPS_PER_M: f64 = 10.0;

/// Forwards records and shows how far the mission is. The bar is the way of the last living drone to the last obstacle set. The
/// time left is that of this way, not that of the mission's time-out.
pub(crate) struct MissionBar<S> {
    inner: S,
    bar: ProgressBar,
    timeout_s: f64,
    course: Course,
    /// How far along the course the way ends, m; `None` without obstacles.
    end_x_m: Option<f64>,
    /// How far along the course it starts, m, once it is known.
    start_x_m: Option<f64>,
    /// Its length in steps of the bar.
    length: u64,
}

impl<S: RecordSink> MissionBar<S> {
    /// A bar for a mission that ends at the latest after `timeout_s`. `end_x_m`: how far along the course the last obstacle set is, m. The
    /// bar is hidden if `quiet` or if stderr is not a terminal.
    pub(crate) fn new(inner: S, quiet: bool, timeout_s: f64, course: Course, end_x_m: Option<f64>) -> Self {
        let template = if end_x_m.is_some() { "{spinner} {msg} {wide_bar}" } else { "{spinner} {msg}" };
        let bar = bar(quiet, 1, template);
        Self { inner, bar, timeout_s, course, end_x_m, start_x_m: None, length: 1 }
    }

    /// Removes the bar from the screen and returns the recorder.
    pub(crate) fn finish(self) -> S {
        self.bar.finish_and_clear();
        self.inner
    }

    fn show(&mut self, record: RecordView<'_>) {
        let living = record.rows.iter().filter(|row| row.alive());
        let last_x_m = living.map(|row| self.course.along(horizontal(row.position_m))).fold(f64::INFINITY, f64::min);
        if let Some(end) = self.end_x_m.filter(|_| last_x_m.is_finite()) {
            let start = *self.start_x_m.get_or_insert(last_x_m);
            self.length = steps(end - start).max(1);
            self.bar.set_length(self.length);
            self.bar.set_position(steps(last_x_m - start).min(self.length));
        }
        let head = record.head;
        let rate = head.tick as f64 / self.bar.elapsed().as_secs_f64().max(1e-3);
        let way = self.end_x_m.map(|_| (self.bar.position() < self.length).then(|| self.bar.eta()));
        self.bar.set_message(message(head.now.secs(), self.timeout_s, rate, way));
    }
}

impl<S: RecordSink> RecordSink for MissionBar<S> {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        if record.head.tick.is_multiple_of(STRIDE) && !self.bar.is_hidden() {
            self.show(record);
        }
        self.inner.take(record)
    }

    fn ready(&self) -> bool {
        self.inner.ready()
    }
}

/// A distance, m, in steps of the bar.
fn steps(distance_m: f64) -> u64 {
    (distance_m * STEPS_PER_M).max(0.0) as u64
}

/// The text before the bar. `way`: the time left for the way, or an inner `None` at its end.
fn message(t_s: f64, timeout_s: f64, ticks_per_s: f64, way: Option<Option<Duration>>) -> String {
    let way = match way {
        None => String::new(),
        Some(None) => ", last obstacle passed".to_owned(),
        Some(Some(left)) => format!(", last obstacle in about {}", HumanDuration(left)),
    };
    format!("t = {t_s:.1} of at most {timeout_s:.0} s, {ticks_per_s:.0} ticks/s{way}")
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
            let bar = bar(quiet, runs, "{spinner} {pos} of {len} runs {wide_bar} {eta} left");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_has_whole_ticks_and_the_time_left_for_the_way() {
        let left = Some(Some(Duration::from_secs(4)));
        let wanted = "t = 12.3 of at most 300 s, 2814 ticks/s, last obstacle in about 4 seconds";
        assert_eq!(message(12.34, 300.0, 2813.61, left), wanted);
        assert!(message(12.34, 300.0, 2813.61, Some(None)).ends_with("ticks/s, last obstacle passed"));
        assert!(message(12.34, 300.0, 2813.61, None).ends_with("2814 ticks/s"));
    }
}
