//! Takes a run's record, tick by tick, into a summary and the files of the run's folder.

use crate::accumulate::Accumulator;
use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use crate::mcap::McapWriter;
use crate::summary::Summary;
use crate::trace::{self, TraceWriter};
use skein_protocol::record::{Outcome, RecordSink, RecordView, RunEvent};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// What is known of a run once it is over, and the record did not tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ending {
    /// How it ended if the record has no end: the world died, or could not tell.
    pub fallback: Outcome,
    /// Wall time from the first tick opened to the last tick done, s; used if the record has no end.
    pub wall_s: Option<f64>,
    /// Wall time from the command to the first tick, s.
    pub startup_s: Option<f64>,
}

/// Accumulates the summary and, in a run's folder, writes trace.csv, events.jsonl and run.mcap. A full disk stops the files,
/// never the summary: [`Recorder::finish`] tells.
pub struct Recorder {
    accumulator: Accumulator,
    files: Option<Files>,
    trouble: Option<ReportError>,
}

impl Recorder {
    /// For the summary alone.
    #[must_use]
    pub fn in_memory(facts: RunFacts) -> Self {
        Self { accumulator: Accumulator::new(facts), files: None, trouble: None }
    }

    /// For the summary, with trace.csv, events.jsonl and run.mcap in the run's folder. `scenario` is the resolved one.
    ///
    /// # Errors
    /// [`ReportError::Io`], [`ReportError::Recording`].
    pub fn in_folder(facts: RunFacts, folder: &RunFolder, scenario: &serde_json::Value) -> Result<Self, ReportError> {
        Ok(Self { files: Some(Files::create(folder.path(), &facts, scenario)?), ..Self::in_memory(facts) })
    }

    /// The summary, and whether the files hold all of the record. [`Summary::report_s`] is left to the caller.
    ///
    /// # Errors
    /// In the second part: [`ReportError::Io`] or [`ReportError::Recording`], the first trouble with the files.
    pub fn finish(mut self, ending: &Ending) -> (Summary, Result<(), ReportError>) {
        if let Some(Err(error)) = self.files.as_mut().map(Files::flush) {
            self.trouble.get_or_insert(error);
        }
        (self.accumulator.finish(ending), self.trouble.map_or(Ok(()), Err))
    }
}

impl RecordSink for Recorder {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), String> {
        let parse = |line: &[u8]| serde_json::from_slice::<RunEvent>(line);
        let events = record.parse_events(parse);
        let events = events.map_err(|error| format!("tick {}: not an event: {error}", record.head.tick))?;
        let fresh = self.accumulator.take(record, &events)?;
        if let Some(Err(error)) = self.files.as_mut().map(|files| files.write(record, &events, fresh)) {
            self.files = None;
            self.trouble = Some(error);
        }
        Ok(())
    }
}

struct Files {
    trace_path: PathBuf,
    trace: TraceWriter<BufWriter<File>>,
    events_path: PathBuf,
    events: BufWriter<File>,
    mcap: McapWriter,
}

impl Files {
    fn create(folder: &Path, facts: &RunFacts, scenario: &serde_json::Value) -> Result<Self, ReportError> {
        let (trace_path, events_path) = (folder.join(trace::FILE), folder.join("events.jsonl"));
        Ok(Self {
            trace: TraceWriter::create(&trace_path).map_err(ReportError::io(&trace_path))?,
            events: BufWriter::new(File::create(&events_path).map_err(ReportError::io(&events_path))?),
            mcap: McapWriter::create(folder, facts, scenario)?,
            trace_path,
            events_path,
        })
    }

    fn write(&mut self, record: RecordView<'_>, events: &[RunEvent], fresh: bool) -> Result<(), ReportError> {
        self.mcap.take(record, events)?;
        if fresh {
            let t_s = crate::accumulate::seconds(record.head.now);
            self.trace.tick(t_s, record.rows).map_err(ReportError::io(&self.trace_path))?;
        }
        if record.events.is_empty() {
            return Ok(());
        }
        let end: &[u8] = if record.events.ends_with(b"\n") { b"" } else { b"\n" };
        self.events
            .write_all(record.events)
            .and_then(|()| self.events.write_all(end))
            .map_err(ReportError::io(&self.events_path))
    }

    fn flush(&mut self) -> Result<(), ReportError> {
        self.trace.flush().map_err(ReportError::io(&self.trace_path))?;
        self.events.flush().map_err(ReportError::io(&self.events_path))?;
        self.mcap.finish()
    }
}
