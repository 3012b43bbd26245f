//! Takes the records of a run, tick by tick, for its summary and for the files in its folder.

use crate::accumulate::Accumulator;
use crate::completion::RunCompletion;
use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::files::SPOOL;
use crate::flight_record::FlightRecord;
use crate::folder::RunFolder;
use crate::record_events::events;
use crate::spool::Spool;
use crate::summary::Summary;
use skein_protocol::record::{RecordSink, RecordView, SinkError};

/// Accumulates the summary of a run. For a run with a folder it also keeps the records in a file, from which
/// [`FlightRecord::write_files`] makes the other files of the run. If the disk is full, the file is incomplete, but the
/// summary is not.
pub struct Recorder {
    accumulator: Accumulator,
    kept: Option<Kept>,
}

/// The records of a run with a folder.
struct Kept {
    record: FlightRecord,
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

    /// For the summary, and for the files in `folder`.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn in_folder(facts: RunFacts, folder: &RunFolder) -> Result<Self, ReportError> {
        let path = folder.path().join(SPOOL);
        let file = folder.files().create(SPOOL)?;
        // Both descriptors are of the same open file: what the spool wrote is read back, whatever has its name by then.
        let spool = file.try_clone().and_then(Spool::new).map_err(ReportError::io(&path))?;
        let record = FlightRecord::new(folder, file);
        Ok(Self { kept: Some(Kept { record, spool, failed: false }), ..Self::in_memory(facts) })
    }

    /// Returns the summary, and the record of a run with a folder. [`Summary::report_s`] is left to the caller.
    pub fn finish(self, completion: &RunCompletion) -> (Summary, Option<FlightRecord>) {
        let summary = self.accumulator.finish(completion);
        let has_metrics = !summary.metrics_own.is_empty();
        let record = self.kept.map(|kept| kept.finish().with_metrics(has_metrics));
        (summary, record)
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
    fn finish(self) -> FlightRecord {
        match self.spool.finish() {
            Ok(()) => self.record,
            Err(error) => self.record.cut_short(error),
        }
    }
}
