//! `skein bench`: what Skein does by itself, measured over and over, in one table and one JSON object.

mod clock;
mod failover;
mod parts;
mod runtime;

use crate::exit::{Exit, Failure};
use clap::Subcommand;
pub use clock::ClockArgs;
pub use failover::FailoverArgs;
use parts::{Part, PartArgs};
pub use runtime::{FloorArgs, RuntimeArgs, peer};
use std::path::PathBuf;

/// The benches.
#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// A tick against function calls and a naive floor, by the size of the swarm [default]
    Runtime(RuntimeArgs),
    /// Kill leaders over and over: how soon everybody follows another one
    Failover(FailoverArgs),
    /// Ticks by the wall clock: how late they open, and answers that come too late
    Clock(ClockArgs),
    /// What the radio costs
    Radio(PartArgs),
    /// What the exact split costs
    Grouping(PartArgs),
    /// What the world's survey costs
    Sense(PartArgs),
    /// What recording costs
    Record(PartArgs),
}

/// A folder of one bench's own, gone with it.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Self, Failure> {
        let folder = std::env::temp_dir().join(format!("skein-bench-{}", std::process::id()));
        std::fs::create_dir_all(&folder).map_err(Failure::environment)?;
        Ok(Self(folder))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What is left lies where temporary files are cleaned anyway.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Runs one of them.
pub fn bench(command: Option<&BenchCommand>) -> Result<Exit, Failure> {
    match command {
        None => runtime::runtime(&RuntimeArgs::default()),
        Some(BenchCommand::Runtime(args)) => runtime::runtime(args),
        Some(BenchCommand::Failover(args)) => failover::failover(args),
        Some(BenchCommand::Clock(args)) => clock::clock(args),
        Some(BenchCommand::Radio(args)) => parts::part(Part::Radio, args),
        Some(BenchCommand::Grouping(args)) => parts::part(Part::Grouping, args),
        Some(BenchCommand::Sense(args)) => parts::part(Part::Sense, args),
        Some(BenchCommand::Record(args)) => parts::part(Part::Record, args),
    }
}
