//! The command line of `reproduce`.

use crate::sweep::args::jobs;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `reproduce`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein reproduce
  skein reproduce --quick --out /tmp/paper --jobs 2")]
pub struct ReproduceArgs {
    /// Folder of the report; an existing one is refused
    #[arg(long, value_name = "DIR", default_value = "reproduction")]
    pub out: PathBuf,
    /// Replace the report in an existing --out folder
    #[arg(long)]
    pub force: bool,
    /// 8 instead of 30 seeds, and the time against the split in one geometry instead of three
    #[arg(long)]
    pub quick: bool,
    /// Flights side by side [default: as many as there are cores]
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub jobs: Option<usize>,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}
