//! Takes a run's record, tick by tick, into a summary; and into the files of the run's folder, once it is over.

use crate::accumulate::Accumulator;
use crate::completion::RunCompletion;
use crate::error::{ReportError, TickError};
use crate::facts::RunFacts;
use crate::folder::RunFolder;
use crate::mcap::McapWriter;
use crate::spool::{self, Spool};
use crate::summary::Summary;
use crate::trace::{self, TraceWriter};
use skein_protocol::record::{RecordSink, RecordView, RunEvent, SinkError};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Accumulates the summary, and for a run's folder keeps the records; [`Recorder::finish`] makes trace.csv, events.jsonl
/// and run.mcap of them, and tells if something is missing in there. A full disk costs files, never the summary.
pub struct Recorder {
    accumulator: Accumulator,
    kept: Option<Kept>,
}

/// The records of a run with a folder, on their way into its files.
struct Kept {
    path: PathBuf,
    files: Files,
    spool: Spool,
    /// The disk has refused a record: those from there on are lost.
    refused: bool,
}

impl Recorder {
    /// For the summary alone.
    #[must_use]
    pub fn in_memory(facts: RunFacts) -> Self {
        Self { accumulator: Accumulator::new(facts), kept: None }
    }

    /// For the summary, with trace.csv, events.jsonl and run.mcap in the run's folder. `scenario` is the resolved one.
    ///
    /// # Errors
    /// [`ReportError::Io`], [`ReportError::Recording`].
    pub fn in_folder(facts: RunFacts, folder: &RunFolder, scenario: &serde_json::Value) -> Result<Self, ReportError> {
        let files = Files::create(folder.path(), &facts, scenario)?;
        let path = folder.path().join(spool::FILE);
        let spool = Spool::create(&path).map_err(ReportError::io(&path))?;
        Ok(Self { kept: Some(Kept { path, files, spool, refused: false }), ..Self::in_memory(facts) })
    }

    /// The summary, and whether the files hold all of the record. [`Summary::report_s`] is left to the caller.
    ///
    /// # Errors
    /// In the second part: [`ReportError::Io`] or [`ReportError::Recording`], the first trouble with the files.
    pub fn finish(self, completion: &RunCompletion) -> (Summary, Result<(), ReportError>) {
        (self.accumulator.finish(completion), self.kept.map_or(Ok(()), Kept::finish))
    }
}

impl RecordSink for Recorder {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let taken = events(record).and_then(|events| self.accumulator.take(record, &events));
        taken.map_err(|error| SinkError::from(error.to_string()))?;
        if let Some(kept) = self.kept.as_mut().filter(|kept| !kept.refused) {
            kept.refused = !kept.spool.take(record);
        }
        Ok(())
    }

    fn ready(&self) -> bool {
        self.kept.as_ref().is_none_or(|kept| kept.refused || kept.spool.ready())
    }
}

impl Kept {
    /// Makes the files of what was kept.
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
        // Also what is there before a trouble is to be read.
        let flushed = self.files.flush();
        let removed = std::fs::remove_file(&self.path).map_err(ReportError::io(&self.path));
        kept.and(made).and(flushed).and(removed)
    }
}

fn events(record: RecordView<'_>) -> Result<Vec<RunEvent>, TickError> {
    let events = record.parse_events(|line| serde_json::from_slice::<RunEvent>(line));
    events.map_err(|source| TickError::Event { tick: record.head.tick, source })
}

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
        let (trace_path, events_path) = (folder.join(trace::FILE), folder.join("events.jsonl"));
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
        // The last record of a run repeats its rows.
        if self.last_tick.is_none_or(|last| record.head.tick > last) {
            self.last_tick = Some(record.head.tick);
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
