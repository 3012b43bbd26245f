//! The files that are made from the records of a run: trace.csv, events.jsonl and run.mcap.

use crate::error::ReportError;
use crate::files::{EVENTS, RECORDING, TRACE};
use crate::folder::Manifest;
use crate::mcap::McapWriter;
use crate::trace::TraceWriter;
use crate::work_folder::WorkFolder;
use skein_protocol::MetricName;
use skein_protocol::record::{RecordView, RunEvent};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

/// Size of the buffer of a file, bytes.
const BUFFER_BYTES: usize = 1 << 18;

/// The files while they are written. They get their names once they are complete; otherwise they are removed.
pub(crate) struct RecordFiles {
    folder: WorkFolder,
    /// `None` once it is complete.
    trace: Option<TraceWriter<BufWriter<File>>>,
    events: BufWriter<File>,
    mcap: McapWriter<BufWriter<File>>,
    last_tick: Option<u64>,
}

impl RecordFiles {
    /// `metrics` are the figures that pilots report.
    pub(crate) fn begin(
        folder: &WorkFolder,
        manifest: &Manifest,
        metrics: &BTreeSet<MetricName>,
    ) -> Result<Self, ReportError> {
        let begin = |name: &str| Ok(BufWriter::with_capacity(BUFFER_BYTES, folder.begin(name)?));
        let path = |name: &str| folder.path().join(name);
        Ok(Self {
            trace: Some(TraceWriter::new(begin(TRACE)?, metrics).map_err(ReportError::io(&path(TRACE)))?),
            events: begin(EVENTS)?,
            mcap: McapWriter::new(begin(RECORDING)?, path(RECORDING), &manifest.facts, &manifest.scenario)?,
            last_tick: None,
            folder: folder.clone(),
        })
    }

    /// Writes a record and its events.
    pub(crate) fn write(&mut self, record: RecordView<'_>, events: &[RunEvent]) -> Result<(), ReportError> {
        self.mcap.take(record, events)?;
        // The last record of a run repeats the rows of the record before it.
        if self.last_tick.is_none_or(|last| record.head.tick > last) {
            self.last_tick = Some(record.head.tick);
            let written =
                self.trace.as_mut().map(|trace| trace.tick(record.head.now.secs(), record.rows, record.telemetry));
            written.transpose().map_err(ReportError::io(&self.path(TRACE)))?;
        }
        if record.events.is_empty() {
            return Ok(());
        }
        let end: &[u8] = if record.events.ends_with(b"\n") { b"" } else { b"\n" };
        let written = self.events.write_all(record.events).and_then(|()| self.events.write_all(end));
        written.map_err(ReportError::io(&self.path(EVENTS)))
    }

    /// Completes the files and gives them their names.
    pub(crate) fn keep(mut self) -> Result<(), ReportError> {
        let trace = self.trace.take().map(TraceWriter::finish);
        trace.transpose().map_err(ReportError::io(&self.path(TRACE)))?;
        self.events.flush().map_err(ReportError::io(&self.path(EVENTS)))?;
        self.mcap.finish()?;
        [TRACE, EVENTS, RECORDING].iter().try_for_each(|name| self.folder.keep(name))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

impl Drop for RecordFiles {
    /// Removes what has not got its name.
    fn drop(&mut self) {
        for name in [TRACE, EVENTS, RECORDING] {
            self.folder.give_up(name);
        }
    }
}
