//! `skein report`: writes report.html and the plots of a recorded run, and prints its summary.

use crate::cli::ReportArgs;
use crate::exit::{Exit, Failure};
use skein_report::{RunFolder, page, text};
use std::io::{IsTerminal, Write};

/// Writes report.html and the plots again, and prints the summary.
pub(crate) fn report(args: &ReportArgs) -> Result<Exit, Failure> {
    let folder = RunFolder::open(&args.run_dir).map_err(Failure::usage)?;
    let manifest = folder.read_manifest().map_err(Failure::usage)?;
    let summary = folder.read_summary().map_err(Failure::usage)?;
    let written = page::write(&folder, &manifest, &summary).map_err(Failure::usage)?;
    let mut out = std::io::stdout().lock();
    let colour = out.is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let _ = writeln!(out, "{}", text::summary(&summary, colour));
    for file in written {
        let _ = writeln!(out, "{}", file.display());
    }
    Ok(Exit::Reached)
}
