//! `skein report`: writes report.html and the plots of a recorded run, and prints its summary. A run that was killed first
//! gets its other files from its record.

use crate::cli::{ReportArgs, TableArgs};
use crate::colour;
use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::output;
use crate::run_folder;
use skein_report::ReportError::{self, Content, NoSummary};
use skein_report::{DataFiles, FlightRecord, Interrupted, Manifest, RunFolder, Summary, page, text};
use std::path::PathBuf;

/// Writes the files of the run again, and prints the summary.
pub(crate) fn report(args: &ReportArgs) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    let folder = run_folder::open_recorded(&args.run_dir)?;
    let manifest = folder.read_manifest().map_err(Failure::report)?;
    let stop = || interrupt.signal().is_some();
    let TableArgs { every, parquet } = args.tables;
    let data = DataFiles { every, parquet, messages: args.messages };
    data.check(&manifest.facts).map_err(Failure::report)?;
    match write(&folder, &manifest, &data, &Interrupted::when(&stop)) {
        Ok((summary, written)) => print(&summary, &written).map(|_| Exit::Reached),
        Err(ReportError::Interrupted) => Ok(Exit::Interrupted(interrupt.signal().unwrap_or_default())),
        Err(error) => Err(Failure::report(error)),
    }
}

/// Writes the files. The record goes last.
fn write(
    folder: &RunFolder,
    manifest: &Manifest,
    data: &DataFiles,
    interrupted: &Interrupted<'_>,
) -> Result<(Summary, Vec<PathBuf>), ReportError> {
    let record = FlightRecord::left_in(folder)?;
    let summary = match (folder.read_summary(), &record) {
        (Err(NoSummary(_) | Content { .. }), Some(record)) => {
            let summary = record.summary(&manifest.facts, interrupted)?;
            folder.write_summary(&summary)?;
            summary
        }
        (read, _) => read?,
    };
    if let Some(record) = &record {
        record.write_files(manifest, interrupted)?;
    }
    let mut written = page::write(folder, manifest, &summary, interrupted)?;
    written.extend(data.write(folder, &manifest.facts, interrupted)?);
    record.map_or(Ok(()), FlightRecord::remove)?;
    Ok((summary, written))
}

fn print(summary: &Summary, written: &[PathBuf]) -> Result<bool, Failure> {
    let files: String = written.iter().map(|file| format!("{}\n", file.display())).collect();
    output::print(format!("{}\n{files}", text::summary(summary, colour::wanted(output::is_terminal()))))
}
