//! `skein reproduce`.

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::output::print_line;
use crate::progress::RunsBar;
use crate::sweep::jobs;
use clap::Args;
use skein_reproduce::{Reproduction, headline};
use std::path::PathBuf;

/// Arguments of `reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein reproduce
  skein reproduce --quick --out /tmp/paper --jobs 2")]
pub(crate) struct ReproduceArgs {
    /// Folder of the report; an existing one is refused
    #[arg(long, value_name = "DIR", default_value = "reproduction")]
    pub(crate) out: PathBuf,
    /// Replace the report in an existing --out folder
    #[arg(long)]
    pub(crate) force: bool,
    /// Fly 8 instead of 30 seeds, and the time against the split in one geometry instead of three
    #[arg(long)]
    pub(crate) quick: bool,
    /// Flights to fly side by side [default: number of cores]
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub(crate) jobs: Option<usize>,
    /// Print nothing but errors
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Flies the paper's missions, writes the report and prints the rows of the result.
pub(crate) fn reproduce(args: &ReproduceArgs) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let reproduction = Reproduction {
        folder: args.out.clone(),
        force: args.force,
        quick: args.quick,
        workers: args.jobs.unwrap_or(cores),
    };
    let mut bar = RunsBar::new(args.quiet);
    let rows = reproduction.run(|progress| bar.show(progress), &|| interrupt.signal());
    bar.finish();
    let rows = rows.map_err(|error| if error.is_usage() { Failure::usage(error) } else { Failure::environment(error) });
    let Some(rows) = rows? else { return Ok(Exit::Interrupted(interrupt.signal().unwrap_or_default())) };
    if !args.quiet {
        let report = args.out.join("report.html");
        print_line(format!("{}report  {}", headline(&rows), report.display()))?;
    }
    Ok(Exit::Reached)
}
