//! `skein report`: the plots of a recorded run, and its summary.

use crate::cli::ReportArgs;
use crate::exit::{Exit, Failure};
use skein_report::{RunFolder, plot, text};
use std::io::{IsTerminal, Write};

/// Draws the plots anew and prints the summary.
pub fn report(args: &ReportArgs) -> Result<Exit, Failure> {
    let folder = RunFolder::open(&args.run_dir).map_err(Failure::usage)?;
    let manifest = folder.read_manifest().map_err(Failure::usage)?;
    let summary = folder.read_summary().map_err(Failure::usage)?;
    let plots = plot::write(&folder, &manifest.facts).map_err(Failure::usage)?;
    let mut out = std::io::stdout().lock();
    let colour = out.is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let _ = writeln!(out, "{}", text::summary(&summary, colour));
    for plot in plots {
        let _ = writeln!(out, "{}", plot.display());
    }
    Ok(Exit::Reached)
}
