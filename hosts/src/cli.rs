//! The command line.

use crate::network::NetworkArgs;
use clap::{Args, Parser, Subcommand};
use skein_runtime::Clock;
use std::path::PathBuf;
use std::time::Duration;

/// Flies one swarm over several machines; started by `skein host` and `skein run --hosts`
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Offer this machine to runs on other machines
    Host(HostArgs),
    /// Take the place of a host's drones on the launcher's machine; started by `skein run --hosts`
    #[command(hide = true)]
    Relay(RelayArgs),
    /// Let `skein view`, `top` and `topic` on other machines look at the swarms of this one
    Share(ShareArgs),
    /// Fetch what swarms of other machines publish; started by `skein view --connect`
    #[command(hide = true)]
    Look(LookArgs),
}

/// Arguments of `host`. Those of `skein host`, which starts it, are their documentation.
#[derive(Debug, Args)]
pub(crate) struct HostArgs {
    /// Name of this host, as runs use it [default: the machine's name]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Number of drones that this machine offers at a time
    #[arg(long, value_name = "COUNT", default_value_t = 64)]
    pub(crate) drones: u32,
    /// Where runs reach this host: Zenoh endpoints
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',', default_value = "tcp/127.0.0.1:7447")]
    pub(crate) listen: Vec<String>,
    /// How to reach the network.
    #[command(flatten)]
    pub(crate) network: NetworkArgs,
    /// Make an authority and the certificates of hosts and launchers in this folder, and end
    #[arg(long, value_name = "DIR")]
    pub(crate) init_keys: Option<PathBuf>,
    /// The words of the program that flies drones, as a JSON list; set by `skein host`
    #[arg(long, hide = true, value_parser = words)]
    pub(crate) program: Option<Words>,
}

/// Arguments of `share`. Those of `skein share`, which starts it, are their documentation.
#[derive(Debug, Args)]
pub(crate) struct ShareArgs {
    /// Only swarms whose name begins with RUN
    pub(crate) run: Option<String>,
    /// Where viewers reach this machine: Zenoh endpoints
    #[arg(long, value_name = "ENDPOINT", value_delimiter = ',', default_value = "tcp/127.0.0.1:7448")]
    pub(crate) listen: Vec<String>,
    /// How to reach the network.
    #[command(flatten)]
    pub(crate) network: NetworkArgs,
}

/// Arguments of `look`.
#[derive(Debug, Args)]
pub(crate) struct LookArgs {
    /// How to reach the network.
    #[command(flatten)]
    pub(crate) network: NetworkArgs,
    /// The version of Skein that the command is built with.
    #[arg(long)]
    pub(crate) version: String,
}

/// Arguments of `relay`.
#[derive(Debug, Args)]
pub(crate) struct RelayArgs {
    /// How to reach the network.
    #[command(flatten)]
    pub(crate) network: NetworkArgs,
    /// Hash of the launcher's program, if it flies pilots of its own.
    #[arg(long)]
    pub(crate) own_program: Option<String>,
    /// Drones per process.
    #[arg(long)]
    pub(crate) per_process: u32,
    /// Name of the host.
    #[arg(long)]
    pub(crate) host: String,
    /// What paces the ticks.
    #[arg(long)]
    pub(crate) clock: Clock,
    /// How long a drone may take to answer in lockstep, s.
    #[arg(long, value_parser = seconds)]
    pub(crate) patience: Duration,
    /// Number of the first drone.
    #[arg(long)]
    pub(crate) id: u32,
    /// Number of drones.
    #[arg(long)]
    pub(crate) count: u32,
    /// Number of this start of the drones, from 1.
    #[arg(long)]
    pub(crate) incarnation: u32,
    /// First tick that they answer.
    #[arg(long)]
    pub(crate) first_tick: u64,
    /// Folder of the run's domain.
    #[arg(long)]
    pub(crate) domain: PathBuf,
    /// Descriptor of the control segment.
    #[arg(long)]
    pub(crate) control: i32,
    /// Process id of the launcher.
    #[arg(long)]
    pub(crate) parent: u32,
    /// Whether drones are pinned to cores: `auto` or `off`.
    #[arg(long)]
    pub(crate) pin: String,
}

/// The words of a program.
#[derive(Clone, Debug)]
pub(crate) struct Words(pub(crate) Vec<String>);

fn words(text: &str) -> Result<Words, serde_json::Error> {
    serde_json::from_str(text).map(Words)
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|error| error.to_string())
}
