//! Opens the folder of a recorded run that the command line names.

use crate::exit::Failure;
use crate::missing::missing;
use skein_report::RunFolder;
use std::path::Path;

/// Opens the folder of a recorded run.
pub(crate) fn open(path: &Path) -> Result<RunFolder, Failure> {
    match missing(path, "expected the folder of a run, such as runs/s2-right-1") {
        Some(text) => Err(Failure::usage(text)),
        None => RunFolder::open(path).map_err(Failure::report),
    }
}
