//! The command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use skein_bus::{PinMode, WaitMode};
use skein_runtime::Clock;
use std::path::PathBuf;

/// Skein: a swarm runtime in which every drone is a process of its own.
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
4 invariant broken, 130/143 interrupted."
)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Fly one mission: one world process, one process a drone
    Run(RunArgs),
    /// Check a scenario and print what would be started; starts nothing
    Check(CheckArgs),
    /// Fly a grid of missions side by side, resumable: CSV, JSON and plots with 95 % intervals
    Sweep(crate::sweep::SweepArgs),
    /// Fly the paper: every table and figure, ours beside the published, in one report
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
    /// Tap what a running swarm says: list, echo, hz
    Topic(crate::topic::TopicArgs),
    /// Measure what the swarm does by itself: failover
    Bench {
        /// What is measured.
        #[command(subcommand)]
        of: crate::bench::BenchCommand,
    },
    /// Say what of this machine limits a swarm
    Doctor(crate::doctor::DoctorArgs),
    /// Remove what dead runs left behind
    Clean,
    /// Print a JSON schema
    Schema {
        /// Of what.
        of: SchemaOf,
    },
    /// Print shell completions
    Completions {
        /// For which shell.
        shell: clap_complete::Shell,
    },
    /// Print the manual page
    Man,
    /// The world's process; started by `run`
    #[command(hide = true)]
    World(WorldArgs),
    /// A drone's process; started by `run`
    #[command(hide = true)]
    Drone(DroneArgs),
}

/// What schemas there are.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SchemaOf {
    /// summary.json.
    Summary,
    /// Scenario files.
    Scenario,
}

/// A scenario and what is changed of it.
#[derive(Debug, Args)]
pub struct ScenarioArgs {
    /// Scenario file (TOML)
    pub scenario: PathBuf,
    /// How drones are grouped: congestion-aware, congestion-aware-paper, shortest-path or
    /// fixed:L/R
    #[arg(long, value_name = "STRATEGY")]
    pub strategy: Option<String>,
    /// Seed of everything random
    #[arg(long, value_name = "N")]
    pub seed: Option<String>,
    /// Override a scenario key, such as radio.delay_s=0.1; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  skein check scenarios/paper/s1-left.toml --set drone.safe_distance_m=30")]
pub struct CheckArgs {
    /// The scenario.
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// Print the plan as one JSON object
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `report`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  skein report runs/s2-right-1")]
pub struct ReportArgs {
    /// Folder of a recorded run
    pub run_dir: PathBuf,
}

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein run scenarios/paper/s2-right.toml
  skein run scenarios/paper/s2-right.toml --strategy fixed:4/4 --seed 7 --out /tmp/four-four
  skein run scenarios/paper/s1-left.toml --set radio.delay_s=0.1 --set radio.loss=0.2 --json
  skein run scenarios/paper/s1-left.toml --clock realtime:2")]
pub struct RunArgs {
    /// The scenario.
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// Processes (the product) or all in this one
    #[arg(long, value_enum, default_value_t)]
    pub runtime: RuntimeChoice,
    /// lockstep, realtime or realtime:SPEED
    #[arg(long, default_value = "lockstep", value_name = "CLOCK")]
    pub clock: Clock,
    /// Folder for the run; an existing one is refused [default: runs/<scenario>-<number>]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace the run in an existing --out folder
    #[arg(long, requires = "out")]
    pub force: bool,
    /// Print the summary as one JSON object
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
    /// Write no trace, events, recording, plots and report
    #[arg(long)]
    pub no_record: bool,
    /// Keep each process to one core
    #[arg(long, value_enum, default_value_t)]
    pub pin: PinChoice,
    /// How processes wait for each other: block sleeps; yield is faster on a quiet machine, ruinous on a busy one
    #[arg(long, value_enum, default_value_t)]
    pub wait: WaitChoice,
}

/// Which runtime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum RuntimeChoice {
    /// A process for the world and one for each drone.
    #[default]
    Processes,
    /// Function calls in one thread.
    Inline,
}

/// Whether to pin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PinChoice {
    /// Drone i to core i modulo the number of cores.
    #[default]
    Auto,
    /// Wherever the system puts them.
    Off,
}

impl From<PinChoice> for PinMode {
    fn from(choice: PinChoice) -> Self {
        match choice {
            PinChoice::Auto => Self::Auto,
            PinChoice::Off => Self::Off,
        }
    }
}

/// How to wait.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum WaitChoice {
    /// Sleep.
    #[default]
    Block,
    /// Yield.
    Yield,
}

impl From<WaitChoice> for WaitMode {
    fn from(choice: WaitChoice) -> Self {
        match choice {
            WaitChoice::Block => Self::Block,
            WaitChoice::Yield => Self::Yield,
        }
    }
}

/// What every child process is told.
#[derive(Debug, Args)]
pub struct ChildArgs {
    /// Folder of the run's domain.
    #[arg(long)]
    pub domain: PathBuf,
    /// Descriptor of the control segment.
    #[arg(long)]
    pub control: i32,
    /// Process id of the launcher.
    #[arg(long)]
    pub parent: u32,
    /// Whether to keep to one core.
    #[arg(long, value_enum)]
    pub pin: PinChoice,
}

/// Arguments of `world`.
#[derive(Debug, Args)]
pub struct WorldArgs {
    /// As for every child.
    #[command(flatten)]
    pub child: ChildArgs,
    /// What paces the ticks.
    #[arg(long)]
    pub clock: Clock,
}

/// Arguments of `drone`.
#[derive(Debug, Args)]
pub struct DroneArgs {
    /// As for every child.
    #[command(flatten)]
    pub child: ChildArgs,
    /// Its number.
    #[arg(long)]
    pub id: u32,
    /// Which start of this drone it is, from 1.
    #[arg(long)]
    pub incarnation: u32,
    /// The first tick it answers.
    #[arg(long)]
    pub first_tick: u64,
}

/// `KEY.PATH=VALUE`, of `--set`.
pub fn key_value(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((key, value)) if !key.trim().is_empty() => Ok((key.trim().to_owned(), value.trim().to_owned())),
        _ => Err("expected key.path=value".to_owned()),
    }
}
