//! The data of the page: lines of JSON, which are the same for a recording and for a live run.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use crate::geometry::outline;
use crate::group_order::GroupOrder;
use crate::interruption::Interrupted;
use crate::mcap;
use crate::scene::{Sample, event_text};
use crate::tuning::PAGE_POSITIONS_MAX;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;
use serde_json::json;
use skein_protocol::record::{EventKind, RunEvent};
use std::io::{self, Write};

/// The first line of a run: its facts, and the outlines of the obstacles.
#[must_use]
pub fn facts_line(facts: &RunFacts) -> String {
    facts_and_groups(facts, &GroupOrder::default())
}

/// The same with the groups of a recorded run, from whose order their colours follow.
fn facts_and_groups(facts: &RunFacts, groups: &GroupOrder) -> String {
    let mut line = json!({ "facts": facts });
    line["facts"]["outlines"] = json!(facts.obstacles.iter().map(outline).collect::<Vec<_>>());
    line["facts"]["groups"] = json!(groups.names());
    line.to_string()
}

/// A line with a sample.
#[must_use]
pub fn sample_line(sample: &Sample) -> String {
    #[derive(Serialize)]
    struct Line<'a> {
        sample: &'a Sample,
    }
    // Serialization cannot fail: all keys are strings.
    serde_json::to_string(&Line { sample }).unwrap_or_default()
}

/// A line with an event, its text and its severity. `None` for the assignment of a single drone: there are too many of
/// them to read.
#[must_use]
pub fn event_line(event: &RunEvent) -> Option<String> {
    if matches!(event.what, EventKind::Assigned { .. }) {
        return None;
    }
    let severity = match event_text::severity(event) {
        event_text::Severity::Info => "info",
        event_text::Severity::Warning => "warning",
        event_text::Severity::Error => "error",
    };
    Some(json!({ "event": event, "text": event_text::line(event), "severity": severity }).to_string())
}

/// A line with the status that the head of the page shows.
#[must_use]
pub fn status_line(status: &str) -> String {
    json!({ "status": status }).to_string()
}

/// The recording of a run: lines of JSON, deflated, in Base64. It is read twice, so that it never has to be in memory: the
/// first time for its length, its groups and its events.
pub(super) fn packed(
    folder: &RunFolder,
    facts: &RunFacts,
    interrupted: &Interrupted<'_>,
) -> Result<String, ReportError> {
    let mut out = LineWriter(ZlibEncoder::new(Vec::new(), Compression::default()));
    let io = |result: io::Result<()>| result.map_err(ReportError::io(folder.path()));
    let (mut samples, mut groups, mut events) = (0, GroupOrder::default(), Vec::new());
    let count = |sample: Sample| {
        samples += 1;
        groups.note(&sample.state.group);
        Ok(())
    };
    mcap::read(folder, interrupted, count, |event| events.extend(event_line(&event)))?;
    io(out.line(&facts_and_groups(facts, &groups)))?;
    io(events.iter().try_for_each(|line| out.line(line)))?;
    let (step, last) = (step(samples, facts.drones as usize), samples.saturating_sub(1));
    let mut place = 0;
    let keep = |sample| {
        let kept = place % step == 0 || place == last;
        place += 1;
        if kept { io(out.line(&sample_line(&sample))) } else { Ok(()) }
    };
    mcap::read(folder, interrupted, keep, |_| {})?;
    out.0.finish().map(|bytes| STANDARD.encode(bytes)).map_err(ReportError::io(folder.path()))
}

/// Samples from one that the page holds to the next.
fn step(samples: usize, drones: usize) -> usize {
    (samples * drones).div_ceil(PAGE_POSITIONS_MAX).max(1)
}

/// Deflates lines.
struct LineWriter(ZlibEncoder<Vec<u8>>);

impl LineWriter {
    fn line(&mut self, line: &str) -> io::Result<()> {
        self.0.write_all(line.as_bytes())?;
        self.0.write_all(b"\n")
    }
}
