//! The records of a flight, as they were kept while it flew, and the files that are made from them.

use crate::accumulate::Accumulator;
use crate::completion::RunCompletion;
use crate::error::{ReportError, TickError};
use crate::facts::RunFacts;
use crate::files::SPOOL;
use crate::folder::{Manifest, RunFolder};
use crate::interruption::Interrupted;
use crate::record_events::events;
use crate::record_files::RecordFiles;
use crate::spool;
use crate::summary::Summary;
use skein_protocol::record::{Outcome, RecordView};
use skein_protocol::telemetry::TelemetryRow;
use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::PathBuf;

/// The records of a flight: the file flight.spool of a run's folder. It stays until all files of the run are written.
#[derive(Debug)]
pub struct FlightRecord {
    folder: RunFolder,
    file: File,
    /// Whether there may be figures of pilots in it.
    has_metrics: bool,
    /// Why the last records are missing.
    cut_short: Option<io::Error>,
}

impl FlightRecord {
    pub(crate) fn new(folder: &RunFolder, file: File) -> Self {
        Self { folder: folder.clone(), file, has_metrics: true, cut_short: None }
    }

    /// The same, of a flight in which pilots reported figures or did not.
    pub(crate) fn with_metrics(self, has_metrics: bool) -> Self {
        Self { has_metrics, ..self }
    }

    /// The same, with the reason why the last records are missing.
    pub(crate) fn cut_short(self, error: io::Error) -> Self {
        Self { cut_short: Some(error), ..self }
    }

    /// The record that a run has left: it was killed, or its files could not be written. `None` if there is none.
    ///
    /// # Errors
    /// [`ReportError::InUse`] for a run that still flies, [`ReportError::Foreign`], [`ReportError::Io`].
    pub fn left_in(folder: &RunFolder) -> Result<Option<Self>, ReportError> {
        match folder.files().read(SPOOL) {
            Ok(file) => folder.files().claim().map(|()| Some(Self::new(folder, file))),
            Err(ReportError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Whether there is a record that [`FlightRecord::left_in`] opens.
    #[must_use]
    pub fn is_left_in(folder: &RunFolder) -> bool {
        folder.files().read(SPOOL).is_ok()
    }

    /// Makes trace.csv, events.jsonl and run.mcap. If that fails, the record is as it was.
    ///
    /// # Errors
    /// The first error with the record or with the files; [`ReportError::Interrupted`]. If only the record is at fault, the
    /// files hold everything before the fault.
    pub fn write_files(&self, manifest: &Manifest, interrupted: &Interrupted<'_>) -> Result<(), ReportError> {
        let mut metrics = BTreeSet::new();
        if self.has_metrics {
            spool::read(&self.file, &self.path(), |record| {
                metrics.extend(record.telemetry.iter().filter_map(TelemetryRow::metric).map(|(name, _)| name));
                interrupted.check()
            })
            .or_else(|error| if matches!(error, ReportError::Content { .. }) { Ok(()) } else { Err(error) })?;
        }
        let mut files = RecordFiles::begin(self.folder.files(), manifest, &metrics)?;
        let read = spool::read(&self.file, &self.path(), |record| {
            interrupted.check()?;
            files.write(record, &events(record).map_err(|error| self.invalid(&error))?)
        });
        match read {
            Ok(()) => files.keep(),
            Err(fault @ ReportError::Content { .. }) => files.keep().and(Err(fault)),
            Err(error) => Err(error),
        }
    }

    /// The summary of what the record holds, for a run that was killed before it wrote its own.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn summary(&self, facts: &RunFacts, interrupted: &Interrupted<'_>) -> Result<Summary, ReportError> {
        let mut accumulator = Accumulator::new(facts.clone());
        let read = spool::read(&self.file, &self.path(), |record: RecordView<'_>| {
            interrupted.check()?;
            let taken = events(record).and_then(|events| accumulator.take(record, &events));
            taken.map_err(|error| self.invalid(&error))
        });
        match read {
            // What comes after the fault is not in the files either.
            Ok(()) | Err(ReportError::Content { .. }) => {}
            Err(error) => return Err(error),
        }
        let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: None };
        let mut summary = accumulator.finish(&completion);
        summary.reason.get_or_insert_with(|| "the run ended before it wrote its summary".to_owned());
        Ok(summary)
    }

    /// Removes the record once everything that is made from it is complete.
    ///
    /// # Errors
    /// The error that cut the record short, or [`ReportError::Io`].
    pub fn remove(self) -> Result<(), ReportError> {
        self.folder.files().remove(SPOOL)?;
        match self.cut_short {
            None => Ok(()),
            Some(error) => Err(ReportError::io(&self.folder.path().join(SPOOL))(error)),
        }
    }

    fn invalid(&self, error: &TickError) -> ReportError {
        ReportError::Content { path: self.path(), expected: "the records of a run", found: error.to_string() }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join(SPOOL)
    }
}
