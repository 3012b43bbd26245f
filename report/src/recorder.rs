//! Takes the records of a run, tick by tick, for its summary and for the files in its folder.

use crate::accumulate::Accumulator;
use crate::completion::RunCompletion;
use crate::error::{ReportError, TickError};
use crate::facts::RunFacts;
use crate::files::{EVENTS, SPOOL, TRACE};
use crate::folder::RunFolder;
use crate::mcap::McapWriter;
use crate::spool::{self, Spool};
use crate::summary::Summary;
use crate::trace::TraceWriter;
use skein_protocol::record::{RecordSink, RecordView, RunEvent, SinkError};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Accumulates the summary of a run. For a run with a folder it also keeps the records, from which [`Recorder::finish`]
/// makes trace.csv, events.jsonl and run.mcap. If the disk is full, files are incomplete, but the summary is not.
pub struct Recorder {
    accumulator: Accumulator,
    kept: Option<Kept>,
}

/// The records of a run with a folder, and the files to be made from them.
struct Kept {
    /// Path of the spool.
    path: PathBuf,
    files: Files,
    spool: Spool,
    /// Whether a write to the spool failed: later records are not kept.
    failed: bool,
}

impl Recorder {
    /// For the summary only.
    #[must_use]
    pub fn in_memory(facts: RunFacts) -> Self {
        Self { accumulator: Accumulator::new(facts), kept: None }
    }

    /// For the summary, and for trace.csv, events.jsonl and run.mcap in `folder`. `scenario` is the resolved scenario.
    ///
    /// # Errors
    /// [`ReportError::Io`], [`ReportError::Recording`].
    pub fn in_folder(facts: RunFacts, folder: &RunFolder, scenario: &serde_json::Value) -> Result<Self, ReportError> {
        let files = Files::create(folder.path(), &facts, scenario)?;
        let path = folder.path().join(SPOOL);
        let spool = Spool::create(&path).map_err(ReportError::io(&path))?;
        Ok(Self { kept: Some(Kept { path, files, spool, failed: false }), ..Self::in_memory(facts) })
    }

    /// Returns the summary, and whether the files are complete. [`Summary::report_s`] is left to the caller.
    ///
    /// # Errors
    /// In the second part, the first error with the files: [`ReportError::Io`], [`ReportError::Content`] or
    /// [`ReportError::Recording`].
    pub fn finish(self, completion: &RunCompletion) -> (Summary, Result<(), ReportError>) {
        (self.accumulator.finish(completion), self.kept.map_or(Ok(()), Kept::finish))
    }
}

impl RecordSink for Recorder {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let taken = events(record).and_then(|events| self.accumulator.take(record, &events));
        taken.map_err(|error| SinkError::from(error.to_string()))?;
        if let Some(kept) = self.kept.as_mut().filter(|kept| !kept.failed) {
            kept.failed = !kept.spool.take(record);
        }
        Ok(())
    }

    fn ready(&self) -> bool {
        self.kept.as_ref().is_none_or(|kept| kept.failed || kept.spool.ready())
    }
}

impl Kept {
    /// Makes the files from the records.
    fn finish(mut self) -> Result<(), ReportError> {
        let kept = self.spool.finish().map_err(ReportError::io(&self.path));
        let content = |error: TickError| {
            let (path, found) = (self.path.clone(), error.to_string());
            ReportError::Content { path, expected: "the run's records", found }
        };
        let made = spool::consume(&self.path, |record| {
            let events = events(record).map_err(content)?;
            self.files.write(record, &events)
        });
        // After an error, what was written before it should still be readable.
        let flushed = self.files.flush();
        let removed = std::fs::remove_file(&self.path).map_err(ReportError::io(&self.path));
        kept.and(made).and(flushed).and(removed)
    }
}

/// The events of a record.
fn events(record: RecordView<'_>) -> Result<Vec<RunEvent>, TickError> {
    let events = record.parse_events(|line| serde_json::from_slice::<RunEvent>(line));
    events.map_err(|source| TickError::Event { tick: record.head.tick, source })
}

/// The files that are made from the records.
struct Files {
    trace_path: PathBuf,
    trace: TraceWriter<BufWriter<File>>,
    events_path: PathBuf,
    events: BufWriter<File>,
    mcap: McapWriter,
    last_tick: Option<u64>,
}

impl Files {
    fn create(folder: &Path, facts: &RunFacts, scenario: &serde_json::Value) -> Result<Self, ReportError> {
        let (trace_path, events_path) = (folder.join(TRACE), folder.join(EVENTS));
        Ok(Self {
            trace: TraceWriter::create(&trace_path).map_err(ReportError::io(&trace_path))?,
            events: BufWriter::new(File::create(&events_path).map_err(ReportError::io(&events_path))?),
            mcap: McapWriter::create(folder, facts, scenario)?,
            last_tick: None,
            trace_path,
            events_path,
        })
    }

    fn write(&mut self, record: RecordView<'_>, events: &[RunEvent]) -> Result<(), ReportError> {
        self.mcap.take(record, events)?;
        // The last record of a run repeats the rows of the record before it.
        if self.last_tick.is_none_or(|last| record.head.tick > last) {
            self.last_tick = Some(record.head.tick);
            self.trace.tick(record.head.now.secs(), record.rows).map_err(ReportError::io(&self.trace_path))?;
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
