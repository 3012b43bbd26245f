//! `skein bench`.

use crate::exit::{Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{print, print_line};
use crate::scenario_args::ScenarioArgs;
use clap::{Args, Subcommand};
use serde::Serialize;
use skein_bench::clock::{self, ClockBench};
use skein_bench::election::ElectionBench;
use skein_bench::failover::FailoverBench;
use skein_bench::parts::{self, Part, PartBench};
use skein_bench::peers::{self, PeerBench};
use skein_bench::pilots::{self, PilotBench};
use skein_bench::runtime::{BaselinePeer, RuntimeBench};
use skein_bench::split::SplitBench;
use skein_bench::{BenchError, Context};
use skein_runtime::PilotRegistry;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// The benchmarks.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Benchmark a tick against function calls and against raw shared memory, by swarm size [default]
    Runtime(RuntimeArgs),
    /// Kill leaders again and again; measure the time until all drones follow another one
    Failover(FailoverArgs),
    /// Elect leaders over radios of one hop and of many; measure the time, the messages and those who led in vain
    Election(ElectionArgs),
    /// Benchmark real-time operation: late ticks and late answers
    Clock(ClockArgs),
    /// Benchmark pilots, built-in and own: fly one mission with each and compare the drone-steps per second
    Pilots(PilotsArgs),
    /// Divide the world by space: what each part would do, and how large a swarm can be
    Split(SplitArgs),
    /// Compare with RVO2 on one core; needs Python with the module pyrvo
    Peers(PeersArgs),
    /// Benchmark the radio model
    Radio(PartArgs),
    /// Benchmark the exact assignment of drones to routes
    Grouping(PartArgs),
    /// Benchmark the world's part of a tick
    Sense(PartArgs),
    /// Benchmark recording
    Record(PartArgs),
}

/// Arguments of `bench runtime`.
#[derive(Debug, Default, Args)]
#[command(after_help = "Examples:
  skein bench runtime
  skein bench runtime --drones 8,64 --rounds 7 --compare uds --out bench.json")]
pub(crate) struct RuntimeArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: RuntimeBench,
    /// Plot the CPU time per agent-step against the swarm size to this file (SVG)
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub(crate) json: bool,
    /// Also write the JSON object to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// Arguments of `bench failover`.
#[derive(Debug, Args)]
#[command(
    after_help = "Eight drones cruise with heartbeats at 50 Hz. Again and again the leader is killed, and restarted a \
little later. With the lockstep clock all drones fly in this process; with the realtime clock they are processes that get \
SIGKILL.

Examples:
  skein bench failover --quick
  skein bench failover --clock realtime --loss 0,0.5 --delay 0 --json --out failover.json"
)]
pub(crate) struct FailoverArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: FailoverBench,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub(crate) json: bool,
    /// Also write the JSON object to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
}

/// Arguments of `bench election`.
#[derive(Debug, Args)]
#[command(
    after_help = "All drones start at once. Only their state machines of leadership run, in this process, over a radio that \
is simulated: no bodies, no obstacles. A drone that dies may cut a swarm in parts: then each part has to have a leader.

Examples:
  skein bench election --drones 10 --seeds 3
  skein bench election --topology line,grid --drones 100 --loss 0,0.5 --failing 0 --json"
)]
pub(crate) struct ElectionArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: ElectionBench,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `bench clock`.
#[derive(Debug, Args)]
pub(crate) struct ClockArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: ClockBench,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `bench pilots`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein bench pilots cruise,paper
  skein bench pilots paper,talker --scenario scenarios/paper/s2-right.toml --processes")]
pub(crate) struct PilotsArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: PilotBench,
    /// Mission to fly, a scenario file; a table [[pilot]] in it that names the pilot gives it its parameters
    #[arg(long, value_name = "FILE", conflicts_with = "drones")]
    pub(crate) scenario: Option<PathBuf>,
    /// Print one JSON array
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `bench split`.
#[derive(Debug, Args)]
#[command(
    after_help = "All parts are simulated one after the other in this thread. Each knows only its own drones and what it is sent of \
others. docs/scale.md explains the columns.

Example:
  skein bench split --drones 64,256,1000 --parts 1,4,16"
)]
pub(crate) struct SplitArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: SplitBench,
    /// Print one JSON object instead of the tables
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `bench peers`.
#[derive(Debug, Args)]
#[command(
    after_help = "Both fly the same grid in formation, in rounds one after the other, on the same core. CPU time is measured.

Example:
  skein bench peers --drones 64,1000 --python venv/bin/python"
)]
pub(crate) struct PeersArgs {
    /// What is measured.
    #[command(flatten)]
    pub(crate) bench: PeerBench,
    /// Print one JSON array
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of the benchmarks of parts.
#[derive(Debug, Args)]
pub(crate) struct PartArgs {
    /// How it is measured.
    #[command(flatten)]
    pub(crate) bench: PartBench,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub(crate) json: bool,
}

/// Runs one benchmark.
pub(crate) fn bench(command: Option<&BenchCommand>, registry: &PilotRegistry) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    let interrupted = || interrupt.signal();
    let context = Context { pilots: registry, interrupted: &interrupted };
    let exit = match command {
        None => runtime(&RuntimeArgs::default(), &context),
        Some(BenchCommand::Runtime(args)) => runtime(args, &context),
        Some(BenchCommand::Failover(args)) => failover(args, &context),
        Some(BenchCommand::Election(args)) => election(args, &context),
        Some(BenchCommand::Clock(args)) => clock(args, &context),
        Some(BenchCommand::Pilots(args)) => own_pilots(args, &context),
        Some(BenchCommand::Split(args)) => split(args, &context),
        Some(BenchCommand::Peers(args)) => with_peers(args, &context),
        Some(BenchCommand::Radio(args)) => part(Part::Radio, args, &context),
        Some(BenchCommand::Grouping(args)) => part(Part::Grouping, args, &context),
        Some(BenchCommand::Sense(args)) => part(Part::Sense, args, &context),
        Some(BenchCommand::Record(args)) => part(Part::Record, args, &context),
    };
    Ok(exit?.unwrap_or_else(|| Exit::Interrupted(interrupt.signal().unwrap_or_default())))
}

/// Runs a peer process of the baseline.
pub(crate) fn peer(peer: &BaselinePeer) -> Result<Exit, Failure> {
    peer.run().map_err(failure)?;
    Ok(Exit::Reached)
}

fn runtime(args: &RuntimeArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let is_terminal = std::io::stderr().is_terminal();
    let report = args.bench.run(context, |progress| {
        let skein_bench::runtime::Progress { drones, round, rounds, case } = progress;
        if is_terminal {
            // Without a reader, there is no progress to show.
            let _ = write!(std::io::stderr(), "\r{drones} drones, round {round} of {rounds}: {:<24}", case.name());
        }
    });
    if is_terminal {
        let _ = writeln!(std::io::stderr());
    }
    let Some(report) = report.map_err(failure)? else { return Ok(None) };
    let json = serde_json::to_string_pretty(&report).map_err(Failure::environment)?;
    if let Some(path) = &args.out {
        write(path, &json)?;
    }
    if let Some(path) = &args.plot {
        write(path, &report.plot().map_err(failure)?)?;
    }
    print(if args.json { json + "\n" } else { report.table() + "\n" })?;
    Ok(Some(Exit::Reached))
}

fn failover(args: &FailoverArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let Some(report) = args.bench.run(context).map_err(failure)? else { return Ok(None) };
    if let Some(path) = &args.out {
        write(path, &(serde_json::to_string_pretty(&report).map_err(Failure::environment)? + "\n"))?;
    }
    if args.json {
        print_line(serde_json::to_string(&report).map_err(Failure::environment)?)?;
    } else {
        print(report.table())?;
    }
    Ok(Some(if report.is_unsafe() { Exit::Unsafe } else { Exit::Reached }))
}

fn election(args: &ElectionArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let Some(report) = args.bench.run(context).map_err(failure)? else { return Ok(None) };
    print_report(args.json, &report, || report.table())
}

fn clock(args: &ClockArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let Some(rows) = args.bench.run(context).map_err(failure)? else { return Ok(None) };
    print_rows(args.json, &rows, clock::table)
}

fn own_pilots(args: &PilotsArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let inline = !args.bench.processes;
    let read = |path: &PathBuf| input::scenario(&ScenarioArgs::of_file(path), context.pilots, inline);
    let mission = args.scenario.as_ref().map(read).transpose()?;
    let Some(rows) = args.bench.run(mission.as_ref(), context).map_err(failure)? else { return Ok(None) };
    print_rows(args.json, &rows, pilots::table)
}

fn split(args: &SplitArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let Some(report) = args.bench.run(context).map_err(failure)? else { return Ok(None) };
    print_report(args.json, &report, || report.table())
}

fn with_peers(args: &PeersArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let Some(rows) = args.bench.run(context).map_err(failure)? else { return Ok(None) };
    print_rows(args.json, &rows, peers::table)
}

fn part(part: Part, args: &PartArgs, context: &Context<'_>) -> Result<Option<Exit>, Failure> {
    let Some(figures) = args.bench.run(part, context).map_err(failure)? else { return Ok(None) };
    print_rows(args.json, &figures, parts::table)
}

fn print_report<T: Serialize>(json: bool, report: &T, table: impl Fn() -> String) -> Result<Option<Exit>, Failure> {
    if json {
        print_line(serde_json::to_string(report).map_err(Failure::environment)?)?;
    } else {
        print(table())?;
    }
    Ok(Some(Exit::Reached))
}

fn print_rows<T: Serialize>(json: bool, rows: &[T], table: fn(&[T]) -> String) -> Result<Option<Exit>, Failure> {
    if json {
        print_line(serde_json::to_string_pretty(rows).map_err(Failure::environment)?)?;
    } else {
        print(table(rows))?;
    }
    Ok(Some(Exit::Reached))
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    std::fs::write(path, text).map_err(|error| Failure::environment(format!("writing {}: {error}", path.display())))
}

fn failure(error: BenchError) -> Failure {
    match error {
        BenchError::Scenario(errors) => Failure::diagnostic(errors),
        error if error.is_usage() => Failure::usage(error),
        error => Failure::environment(error),
    }
}
