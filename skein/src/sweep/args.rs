//! The command lines of `sweep` and `scene`.

use crate::cli::key_value;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(
    after_help = "Interrupted, by Ctrl-C or for good, the same command goes on where it was: no finished run is \
lost or flown twice.

Examples:
  skein sweep experiments/delay-loss.toml
  skein sweep experiments/random-scenes.toml --jobs 2 --out /tmp/scenes --json
  skein sweep experiments/reaction.toml --set sensors.ranging=false"
)]
pub struct SweepArgs {
    /// Experiment file (TOML)
    pub experiment: PathBuf,
    /// Folder of the sweep; one of the same experiment is resumed, any other refused [default: sweeps/<name>]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Runs side by side [default: as many as there are cores]
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub jobs: Option<usize>,
    /// Override a scenario key in every run, such as radio.range_m=200; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub overrides: Vec<(String, String)>,
    /// Print summary.json as one JSON object
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub quiet: bool,
}

/// Arguments of `scene`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  skein scene 17 > random-17.toml && skein run random-17.toml")]
pub struct SceneArgs {
    /// Seed of the scene
    #[arg(value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: u64,
    /// How many drones it may have [default: 5..16]
    #[arg(long, value_name = "LEAST..MOST", value_parser = range)]
    pub drones: Option<[u32; 2]>,
    /// How many obstacles it may have [default: 1..4]
    #[arg(long, value_name = "LEAST..MOST", value_parser = range)]
    pub obstacles: Option<[u32; 2]>,
}

/// A number of workers.
pub fn jobs(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|count| (1..=1024).contains(count)).ok_or_else(|| "expected 1 to 1024".to_owned())
}

fn range(text: &str) -> Result<[u32; 2], String> {
    let ends = text.split_once("..").and_then(|(least, most)| Some([least.parse().ok()?, most.parse().ok()?]));
    ends.ok_or_else(|| "expected LEAST..MOST, both included".to_owned())
}
