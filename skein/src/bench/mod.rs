//! `skein bench`: what Skein does by itself, measured over and over, in one table and one JSON object.

mod failover;

use crate::exit::{Exit, Failure};
use clap::Subcommand;
pub use failover::FailoverArgs;

/// The benches.
#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// Kill leaders over and over: how soon everybody follows another one
    Failover(FailoverArgs),
}

/// Runs one of them.
pub fn bench(command: &BenchCommand) -> Result<Exit, Failure> {
    match command {
        BenchCommand::Failover(args) => failover::failover(args),
    }
}
