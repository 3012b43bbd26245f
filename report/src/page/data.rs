//! The data of the page: lines of JSON, which are the same for a recording and for a live run.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use crate::geometry::outline;
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
use std::io::Write;

/// The first line of a run: its facts, and the outlines of the obstacles.
#[must_use]
pub fn facts_line(facts: &RunFacts) -> String {
    let mut line = json!({ "facts": facts });
    line["facts"]["outlines"] = json!(facts.obstacles.iter().map(outline).collect::<Vec<_>>());
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

/// The recording of a run: lines of JSON, deflated, in Base64.
pub(super) fn packed(folder: &RunFolder, facts: &RunFacts) -> Result<String, ReportError> {
    let (mut samples, mut lines) = (Vec::new(), vec![facts_line(facts)]);
    mcap::read(folder.path(), |sample| samples.push(sample), |event| lines.extend(event_line(&event)))?;
    let step = (samples.len() * facts.drones as usize).div_ceil(PAGE_POSITIONS_MAX).max(1);
    let last = samples.len().saturating_sub(1);
    let kept = samples.iter().enumerate().filter(|(place, _)| place % step == 0 || *place == last);
    lines.extend(kept.map(|(_, sample)| sample_line(sample)));
    let mut out = ZlibEncoder::new(Vec::new(), Compression::default());
    let packed = out.write_all(lines.join("\n").as_bytes()).and_then(|()| out.finish());
    packed.map(|bytes| STANDARD.encode(bytes)).map_err(ReportError::io(folder.path()))
}
