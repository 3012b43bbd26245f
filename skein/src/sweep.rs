//! `skein sweep` and `skein scene`.

use crate::complaint::complain;
use crate::exit::{Exit, Failure};
use crate::experiment_file::check_experiment;
use crate::interrupt::Interrupt;
use crate::options::{ArgumentError, key_value};
use crate::output;
use crate::progress::RunsBar;
use clap::{Args, Subcommand};
use serde_json::json;
use skein_report::table::check_parquet;
use skein_runtime::PilotRegistry;
use skein_sweep::{
    Experiment, FolderProgress, Grid, SceneBounds, Shard, Shards, Sweep, SweepEnd, SweepError, SweepProgress,
    SweepReport, program_name, scene_toml, wide_scene_toml,
};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "If a sweep is interrupted or killed, the same command resumes it: no finished run is lost or \
flown twice. With --shard, several machines or jobs of a scheduler share the runs; each has a folder of its own.

Examples:
  skein sweep experiments/delay-loss.toml
  skein sweep experiments/random-scenes.toml --jobs 2 --out /tmp/scenes --json
  skein sweep experiments/reaction.toml --set sensors.ranging=false
  skein sweep experiments/faults.toml --shard 2/7 --out /shared/faults/2
  skein sweep progress /shared/faults/*
  skein sweep merge /shared/faults/* --out sweeps/faults"
)]
pub(crate) struct SweepArgs {
    #[command(subcommand)]
    pub(crate) action: Option<SweepAction>,
    /// Experiment file (TOML)
    #[arg(required = true)]
    pub(crate) experiment: Option<PathBuf>,
    /// Folder of the sweep; a sweep of the same experiment is resumed, any other folder is refused [default: sweeps/<name>,
    /// or sweeps/<name>-I-of-N for a shard]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Runs to fly side by side [default: number of cores]
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub(crate) jobs: Option<usize>,
    /// Fly one of N parts of the runs, such as 2/7; `skein sweep merge` puts the parts together
    #[arg(long, value_name = "I/N", conflicts_with = "parquet")]
    pub(crate) shard: Option<Shard>,
    /// Override a scenario key in every run, such as radio.range_m=200; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub(crate) overrides: Vec<(String, String)>,
    #[command(flatten)]
    pub(crate) results: ResultArgs,
}

/// How the results of a sweep are written and printed.
#[derive(Debug, Args)]
pub(crate) struct ResultArgs {
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

/// What can be done with sweeps besides flying them.
#[derive(Debug, Subcommand)]
pub(crate) enum SweepAction {
    /// Merge the shards of a sweep: the result is what one machine would have written
    Merge(MergeArgs),
    /// Print how many runs are done, in all shards and in each; exit code 0 if all are, 1 if not
    Progress(ProgressArgs),
}

/// Arguments of `sweep progress`.
#[derive(Debug, Args)]
pub(crate) struct ProgressArgs {
    /// Folders of the shards, or of the sweep; those who fly may go on meanwhile
    #[arg(required = true)]
    pub(crate) folders: Vec<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `sweep merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArgs {
    /// Folders of all shards
    #[arg(required = true)]
    pub(crate) folders: Vec<PathBuf>,
    /// Folder of the whole sweep [default: sweeps/<name>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) results: ResultArgs,
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
    #[arg(long, conflicts_with_all = ["drones", "obstacles", "room"])]
    pub(crate) wide: bool,
    /// Least and greatest number of drones [default: 5..16]
    #[arg(long, value_name = "LEAST..MOST", value_parser = range)]
    pub(crate) drones: Option<[u32; 2]>,
    /// Least and greatest number of obstacles [default: 1..4]
    #[arg(long, value_name = "LEAST..MOST", value_parser = range)]
    pub(crate) obstacles: Option<[u32; 2]>,
    /// Distance of the last slot at the destination behind the last obstacle, m [default: drawn without the obstacles]
    #[arg(long, value_name = "M")]
    pub(crate) room: Option<u32>,
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
        room_m: args.room,
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

/// Flies the runs of an experiment that are not done yet, and prints the results once all are done. Or merges shards.
pub(crate) fn sweep(args: &SweepArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    match (&args.action, &args.experiment) {
        (Some(SweepAction::Merge(args)), _) => merge(args),
        (Some(SweepAction::Progress(args)), _) => progress(args),
        (None, Some(experiment)) => fly(args, experiment, pilots),
        (None, None) => Err(Failure::usage("expected an experiment file")),
    }
}

fn fly(args: &SweepArgs, file: &Path, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    check_experiment(file)?;
    if args.results.parquet {
        check_parquet().map_err(Failure::usage)?;
    }
    let experiment = Experiment::read(file).map_err(Failure::usage)?;
    let grid = Grid::new(&experiment, &args.overrides).program(program_name(pilots.program()));
    let interrupt = Interrupt::watch()?;
    let interrupted = || interrupt.signal();
    let folder = args.out.clone().unwrap_or_else(|| default_folder(&experiment.name, args.shard));
    let mut bar = RunsBar::new(args.results.quiet || args.results.json);
    let mut sweep = Sweep::new(&grid, pilots).interrupted(&interrupted).progress(|progress| bar.show(progress));
    sweep = sweep.parquet(args.results.parquet);
    if let Some(jobs) = args.jobs {
        sweep = sweep.workers(jobs);
    }
    if let Some(shard) = args.shard {
        sweep = sweep.shard(shard);
    }
    let end = sweep.run_in_folder(&folder).map_err(|error| match error {
        SweepError::Scenario(error) => Failure::usage(in_experiment(file, &error.to_string())),
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
        SweepEnd::Shard(progress) => {
            let (done, shard) = (progress.done, args.shard.map(|shard| shard.to_string()).unwrap_or_default());
            let path = folder.join("");
            if args.results.json {
                output::print_line(json!({ "shard": shard, "runs": done, "folder": path }))?;
            } else if !args.results.quiet {
                let next = "merge all shards with `skein sweep merge`";
                output::print_line(format!("shard {shard}: {done} runs are done; {next}\nfolder  {}", path.display()))?;
            }
            Ok(Exit::Reached)
        }
        SweepEnd::Complete(report) => {
            let cut_short = report.rows().iter().filter(|row| row.is_cut_short()).count();
            if cut_short > 0 {
                complain(format!("{cut_short} runs were aborted or failed; the same command flies them again"));
            }
            show(&report, &folder, &args.results)
        }
    }
}

/// Merges the shards of a sweep, and prints its results.
fn merge(args: &MergeArgs) -> Result<Exit, Failure> {
    if args.results.parquet {
        check_parquet().map_err(Failure::usage)?;
    }
    let failure =
        |error: SweepError| if error.is_usage() { Failure::usage(error) } else { Failure::environment(error) };
    let shards = Shards::read(&args.folders).map_err(failure)?;
    let folder = args.out.clone().unwrap_or_else(|| default_folder(shards.name(), None));
    let grid = shards.grid();
    let report = shards.write(&grid, &folder, args.results.parquet).map_err(failure)?;
    show(&report, &folder, &args.results)
}

/// Prints how far the shards of a sweep are.
fn progress(args: &ProgressArgs) -> Result<Exit, Failure> {
    let read = SweepProgress::read(&args.folders, SystemTime::now());
    let found =
        read.map_err(|error| if error.is_usage() { Failure::usage(error) } else { Failure::environment(error) })?;
    if args.json {
        output::print_line(serde_json::to_value(&found).map_err(Failure::environment)?)?;
    } else {
        output::print(progress_text(&found))?;
    }
    Ok(if found.is_complete() { Exit::Reached } else { Exit::NotReached })
}

fn progress_text(found: &SweepProgress) -> String {
    let SweepProgress { experiment, done, runs, outcomes, folders, absent } = found;
    let outcomes: Vec<String> = outcomes.iter().map(|(outcome, count)| format!("{count} {outcome}")).collect();
    let outcomes = if outcomes.is_empty() { String::new() } else { format!(": {}", outcomes.join(", ")) };
    let mut lines = vec![format!("{experiment}: {done} of {runs} runs are done{outcomes}")];
    for FolderProgress { folder, shard, done, runs, idle_s } in folders {
        let shard = shard.map_or("all runs".to_owned(), |shard| format!("shard {shard}"));
        let last = idle_s.map_or(String::new(), |idle_s| format!(", the last one {idle_s:.0} s ago"));
        lines.push(format!("{shard:<14} {done:>7} of {runs}{last}  {}", folder.display()));
    }
    if !absent.is_empty() {
        let shards: Vec<String> = absent.iter().map(ToString::to_string).collect();
        lines.push(format!("no folder of shard {}", shards.join(", ")));
    }
    lines.join("\n") + "\n"
}

fn default_folder(name: &str, shard: Option<Shard>) -> PathBuf {
    let part = shard.map(|shard| format!("-{}", shard.folder_name())).unwrap_or_default();
    Path::new("sweeps").join(format!("{name}{part}"))
}

/// Prints the results of a complete sweep.
fn show(report: &SweepReport<'_>, folder: &Path, args: &ResultArgs) -> Result<Exit, Failure> {
    if args.json {
        output::print_line(report.summary())?;
    } else if !args.quiet {
        output::print_line(format!("{}folder  {}", report.table(), folder.join("").display()))?;
    }
    Ok(Exit::Reached)
}
