//! Opens the folder of a run that the command line names.

use crate::exit::Failure;
use crate::missing::missing;
use skein_report::{FlightRecord, RunFolder};
use std::path::Path;

/// Opens the folder of a run.
pub(crate) fn open(path: &Path) -> Result<RunFolder, Failure> {
    match missing(path, "expected the folder of a run, such as runs/s2-right-1") {
        Some(text) => Err(Failure::usage(text)),
        None => RunFolder::open(path).map_err(Failure::report),
    }
}

/// Opens the folder of a run with its record.
pub(crate) fn open_recorded(path: &Path) -> Result<RunFolder, Failure> {
    let folder = open(path)?;
    if folder.path().join("trace.csv").exists() || FlightRecord::is_left_in(&folder) {
        return Ok(folder);
    }
    Err(Failure::usage(format!(
        "{}: has no trace.csv; expected a run that was flown without --no-record",
        path.display()
    )))
}
