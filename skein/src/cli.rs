//! The command line.

use crate::options::{PinChoice, RuntimeChoice, WaitChoice, seconds};
use crate::scenario_args::ScenarioArgs;
use clap::error::{ContextKind, ContextValue};
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use skein_runtime::Clock;
use skein_scenario::nearest;
use std::num::NonZero;
use std::path::PathBuf;
use std::time::Duration;

/// Skein: a swarm runtime in which every drone is a process
#[derive(Debug, Parser)]
#[command(
    name = "skein",
    version,
    max_term_width = 100,
    after_help = "Examples:
  skein run scenarios/paper/s2-right.toml
  skein run scenarios/paper/s2-right.toml --strategy shortest-path --json
  skein check my-scenario.toml --set formation.drones=12

Exit codes: 0 goal reached, 1 not reached, 2 bad usage or scenario, 3 environment failed,
4 invariant broken, 129/130/143 interrupted by SIGHUP/SIGINT/SIGTERM."
)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Fly one mission: one world process and one process per drone
    Run(RunArgs),
    /// Offer this machine to runs on other machines, which then fly drones here
    Host(crate::hosts::HostArgs),
    /// Let `view`, `top` and `topic` on other machines look at the swarms of this one
    Share(crate::hosts::ShareArgs),
    /// Check a scenario and print what would be started, without starting it
    Check(CheckArgs),
    /// Fly a grid of missions side by side; write CSV, JSON and plots with 95 % intervals; resumable
    Sweep(crate::sweep::SweepArgs),
    /// Search an experiment's runs and their neighbourhood for missions that fail, and make what is found small
    Hunt(crate::hunt::HuntArgs),
    /// Reproduce the paper's tables and figures, with the published numbers beside ours, in one report
    Reproduce(crate::reproduce::ReproduceArgs),
    /// Print the TOML of a random scene
    Scene(crate::sweep::SceneArgs),
    /// Write report.html and the plots of a recorded run, and print its summary
    Report(ReportArgs),
    /// Fly a recorded run again from its manifest and compare the digests
    Replay(crate::replay::ReplayArgs),
    /// Show a running swarm, or a recorded run, in the browser
    View(crate::view::ViewArgs),
    /// Watch the running swarms in the terminal
    Top(crate::top::TopArgs),
    /// Print the messages of a running swarm: list, echo, hz
    Topic(crate::topic::TopicArgs),
    /// Benchmark the runtime
    Bench {
        /// Which benchmark.
        #[command(subcommand)]
        of: Option<crate::bench::BenchCommand>,
    },
    /// Show which limits of this machine restrict the size of a swarm
    Doctor(crate::doctor::DoctorArgs),
    /// Remove the files that dead runs left behind
    Clean,
    /// Print a JSON schema
    Schema {
        /// What the schema describes
        of: SchemaOf,
    },
    /// Print shell completions
    Completions {
        /// Shell that uses them
        shell: clap_complete::Shell,
    },
    /// Print the manual page of Skein or of a command
    Man {
        /// The command, such as `run` or `bench runtime` [default: all of Skein]
        command: Vec<String>,
    },
    /// The world process; started by `run`
    #[command(hide = true)]
    World(WorldArgs),
    /// A drone process; started by `run`
    #[command(hide = true)]
    Drone(DroneArgs),
    /// A peer process of the benchmark's baseline; started by `bench`
    #[command(hide = true)]
    BaselinePeer(skein_bench::runtime::BaselinePeer),
}

/// Adds the most similar command to the error of an unknown one, where clap finds none: it misses swapped letters in short
/// words.
pub(crate) fn suggest(error: &mut clap::Error) {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return };
    let program = Cli::command();
    let known = program.get_subcommands().filter(|sub| !sub.is_hide_set()).map(clap::Command::get_name);
    if let (None, Some(near)) = (error.get(ContextKind::SuggestedSubcommand), nearest(word, known)) {
        let near = ContextValue::Strings(vec![near.to_owned()]);
        error.insert(ContextKind::SuggestedSubcommand, near);
    }
}

/// The schemas.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum SchemaOf {
    /// summary.json
    Summary,
    /// Scenario files
    Scenario,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  skein check scenarios/paper/s1-left.toml --set drone.safe_distance_m=30")]
pub(crate) struct CheckArgs {
    /// The scenario.
    #[command(flatten)]
    pub(crate) scenario: ScenarioArgs,
    /// Print the plan as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `report`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein report runs/s2-right-1
  skein report runs/s2-right-1 --messages --parquet")]
pub(crate) struct ReportArgs {
    /// Folder of a recorded run
    pub(crate) run_dir: PathBuf,
    /// Write messages.csv as well: a row for each frame and receiver
    #[arg(long)]
    pub(crate) messages: bool,
    /// The tables.
    #[command(flatten)]
    pub(crate) tables: TableArgs,
}

/// How the tables of a run are written.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct TableArgs {
    /// Leave only every N-th tick in trace.csv, and the last one; plots show all ticks that are there
    #[arg(long, value_name = "N")]
    pub(crate) every: Option<NonZero<u64>>,
    /// Write the tables as Parquet as well
    #[arg(long)]
    pub(crate) parquet: bool,
}

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein run scenarios/paper/s2-right.toml
  skein run scenarios/paper/s2-right.toml --strategy fixed:4/4 --seed 7 --out /tmp/four-four
  skein run scenarios/paper/s1-left.toml --set radio.delay_s=0.1 --set radio.loss=0.2 --json
  skein run scenarios/paper/s1-left.toml --clock realtime:2")]
pub(crate) struct RunArgs {
    /// The scenario.
    #[command(flatten)]
    pub(crate) scenario: ScenarioArgs,
    /// Fly in processes, or inline in this one
    #[arg(long, value_enum, default_value_t)]
    pub(crate) runtime: RuntimeChoice,
    /// What paces the ticks: lockstep, realtime or realtime:SPEED
    #[arg(long, default_value = "lockstep", value_name = "CLOCK")]
    pub(crate) clock: Clock,
    /// Folder of the run; an existing one is refused [default: runs/<scenario>-<number>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace the run in an existing --out folder
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
    /// Print the summary as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub(crate) quiet: bool,
    /// Write no trace, events, recording, plots or report
    #[arg(long, conflicts_with_all = ["every", "parquet"])]
    pub(crate) no_record: bool,
    /// The tables.
    #[command(flatten)]
    pub(crate) tables: TableArgs,
    /// Pin each process to one core [default: auto]
    #[arg(long, value_enum)]
    pub(crate) pin: Option<PinChoice>,
    /// How processes wait for each other: yield is faster on an idle machine and much slower on a busy one [default: block]
    #[arg(long, value_enum)]
    pub(crate) wait: Option<WaitChoice>,
    /// In lockstep, how long a drone may take to answer a tick before it is given up, s [default: 5]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) patience: Option<Duration>,
    /// Drones per process; the digest does not depend on it [default: 1]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) drones_per_process: Option<u32>,
    /// With `--runtime inline`: number of threads that step the drones; the digest does not depend on it
    #[arg(long, value_name = "COUNT", default_value = "1")]
    pub(crate) threads: NonZero<usize>,
    /// End when this parent process ends; set by `sweep`
    #[arg(long, hide = true, value_name = "PID")]
    pub(crate) parent: Option<u32>,
    /// How to reach other machines.
    #[command(flatten)]
    pub(crate) network: crate::hosts::NetworkArgs,
}

/// Arguments of every child process.
#[derive(Debug, Args)]
pub(crate) struct ChildArgs {
    /// Folder of the run's domain.
    #[arg(long)]
    pub(crate) domain: PathBuf,
    /// Descriptor of the control segment.
    #[arg(long)]
    pub(crate) control: i32,
    /// Process id of the launcher.
    #[arg(long)]
    pub(crate) parent: u32,
    /// Whether the process is pinned to a core.
    #[arg(long, value_enum)]
    pub(crate) pin: PinChoice,
}

/// Arguments of `world`.
#[derive(Debug, Args)]
pub(crate) struct WorldArgs {
    /// The arguments of every child process.
    #[command(flatten)]
    pub(crate) child: ChildArgs,
    /// What paces the ticks.
    #[arg(long)]
    pub(crate) clock: Clock,
    /// How long a drone may take to answer, s.
    #[arg(long, value_parser = seconds)]
    pub(crate) patience: Duration,
}

/// Arguments of `drone`.
#[derive(Debug, Args)]
pub(crate) struct DroneArgs {
    /// The arguments of every child process.
    #[command(flatten)]
    pub(crate) child: ChildArgs,
    /// Number of the drone, or of the first drone in this process.
    #[arg(long)]
    pub(crate) id: u32,
    /// Number of drones in this process.
    #[arg(long)]
    pub(crate) count: u32,
    /// Number of this start of the drone, from 1.
    #[arg(long)]
    pub(crate) incarnation: u32,
    /// First tick that it answers.
    #[arg(long)]
    pub(crate) first_tick: u64,
}
