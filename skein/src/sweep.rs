//! `skein sweep` and `skein scene`.

use crate::complaint::complain;
use crate::exit::{Exit, Failure};
use crate::experiment_file::check_experiment;
use crate::interrupt::Interrupt;
use crate::options::{ArgumentError, key_value};
use crate::output;
use crate::progress::RunsBar;
use clap::Args;
use skein_report::table::check_parquet;
use skein_runtime::PilotRegistry;
use skein_sweep::{Experiment, Grid, SceneBounds, Sweep, SweepEnd, SweepError, scene_toml, wide_scene_toml};
use std::path::{Path, PathBuf};

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(after_help = "If a sweep is interrupted or killed, the same command resumes it: no finished run is lost or \
flown twice.

Examples:
  skein sweep experiments/delay-loss.toml
  skein sweep experiments/random-scenes.toml --jobs 2 --out /tmp/scenes --json
  skein sweep experiments/reaction.toml --set sensors.ranging=false")]
pub(crate) struct SweepArgs {
    /// Experiment file (TOML)
    pub(crate) experiment: PathBuf,
    /// Folder of the sweep; a sweep of the same experiment is resumed, any other folder is refused [default: sweeps/<name>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Runs to fly side by side [default: number of cores]
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub(crate) jobs: Option<usize>,
    /// Override a scenario key in every run, such as radio.range_m=200; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub(crate) overrides: Vec<(String, String)>,
    /// Write the table of runs as Parquet as well: runs.parquet
    #[arg(long)]
    pub(crate) parquet: bool,
    /// Print summary.json as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Arguments of `scene`.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  skein scene 17 > random-17.toml && skein run random-17.toml")]
pub(crate) struct SceneArgs {
    /// Seed of the scene
    #[arg(value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub(crate) seed: u64,
    /// Draw a wide scene: as hostile as a scene with a way can be
    #[arg(long, conflicts_with_all = ["drones", "obstacles"])]
    pub(crate) wide: bool,
    /// Least and greatest number of drones [default: 5..16]
    #[arg(long, value_name = "LEAST..MOST", value_parser = range)]
    pub(crate) drones: Option<[u32; 2]>,
    /// Least and greatest number of obstacles [default: 1..4]
    #[arg(long, value_name = "LEAST..MOST", value_parser = range)]
    pub(crate) obstacles: Option<[u32; 2]>,
}

/// Parses a number of workers.
pub(crate) fn jobs(text: &str) -> Result<usize, ArgumentError> {
    text.parse().ok().filter(|count| (1..=1024).contains(count)).ok_or(ArgumentError("expected 1 to 1024"))
}

fn range(text: &str) -> Result<[u32; 2], ArgumentError> {
    let ends = text.split_once("..").and_then(|(least, most)| Some([least.parse().ok()?, most.parse().ok()?]));
    ends.ok_or(ArgumentError("expected LEAST..MOST, both included"))
}

/// Prints the TOML of one random scene.
pub(crate) fn scene(args: &SceneArgs) -> Result<Exit, Failure> {
    let default = SceneBounds::default();
    let bounds = SceneBounds {
        drones: args.drones.unwrap_or(default.drones),
        obstacles: args.obstacles.unwrap_or(default.obstacles),
    };
    let drawn = if args.wide {
        wide_scene_toml(args.seed)
    } else {
        bounds.checked().and_then(|bounds| scene_toml(args.seed, bounds))
    };
    let text = drawn.map_err(Failure::usage)?;
    output::print(text)?;
    Ok(Exit::Reached)
}

/// An error of a run, with the experiment's file in front unless it begins with that.
pub(crate) fn in_experiment(file: &Path, error: &str) -> String {
    let file = format!("{}:", file.display());
    if error.starts_with(&file) { error.to_owned() } else { format!("{file} {error}") }
}

/// Flies the runs of an experiment that are not done yet, and prints the results once all are done.
pub(crate) fn sweep(args: &SweepArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    check_experiment(&args.experiment)?;
    if args.parquet {
        check_parquet().map_err(Failure::usage)?;
    }
    let experiment = Experiment::read(&args.experiment).map_err(Failure::usage)?;
    let grid = Grid::new(&experiment, &args.overrides);
    let interrupt = Interrupt::watch()?;
    let interrupted = || interrupt.signal();
    let folder = args.out.clone().unwrap_or_else(|| Path::new("sweeps").join(&experiment.name));
    let mut bar = RunsBar::new(args.quiet || args.json);
    let mut sweep = Sweep::new(&grid, pilots).interrupted(&interrupted).progress(|progress| bar.show(progress));
    sweep = sweep.parquet(args.parquet);
    if let Some(jobs) = args.jobs {
        sweep = sweep.workers(jobs);
    }
    let end = sweep.run_in_folder(&folder).map_err(|error| match error {
        SweepError::Scenario(error) => Failure::usage(in_experiment(&args.experiment, &error.to_string())),
        error if error.is_usage() => Failure::usage(error),
        error => Failure::environment(error),
    });
    bar.finish();
    match end? {
        SweepEnd::Interrupted(progress) => {
            let (done, runs) = (progress.done, progress.runs);
            complain(format!("{done} of {runs} runs are done; the same command resumes the sweep"));
            Ok(Exit::Interrupted(interrupt.signal().unwrap_or_default()))
        }
        SweepEnd::Complete(report) => {
            if args.json {
                output::print_line(report.summary())?;
            } else if !args.quiet {
                output::print_line(format!("{}folder  {}", report.table(), folder.join("").display()))?;
            }
            Ok(Exit::Reached)
        }
    }
}
