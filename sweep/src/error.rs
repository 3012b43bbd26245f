//! What can go wrong in a sweep.

use crate::shard::Shard;
use skein_report::table::TableError;
use skein_report::{DrawError, ReportError};
use skein_runtime::{PilotProblem, RuntimeError};
use skein_scenario::{ScenarioErrors, StrategyError};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a sweep could not be started, carried through or written.
#[derive(Debug, Error)]
pub enum SweepError {
    /// A combination of the grid is not a valid scenario.
    #[error(transparent)]
    Scenario(#[from] JobError),
    /// The folder cannot be used, or a file in it not be written.
    #[error(transparent)]
    Folder(#[from] ReportError),
    /// The folder holds the same experiment, but something in it has changed since.
    #[error(
        "{}: holds experiment {name:?}, but the experiment file, a scenario, an override or the program has changed \
         since; name another --out", folder.display()
    )]
    Changed {
        /// The sweep's folder.
        folder: PathBuf,
        /// The experiment's name.
        name: String,
    },
    /// The folder holds another experiment.
    #[error("{}: holds another experiment, {name:?}; name another --out", folder.display())]
    OtherExperiment {
        /// The sweep's folder.
        folder: PathBuf,
        /// Name of the experiment in it.
        name: String,
    },
    /// The folder holds another shard of the experiment, or all of it.
    #[error(
        "{}: holds {}; expected {}; name another --out", folder.display(), shard_words(*found), shard_words(*expected)
    )]
    OtherShard {
        /// The sweep's folder.
        folder: PathBuf,
        /// The shard in it; `None`: all runs.
        found: Option<Shard>,
        /// The shard to be flown; `None`: all runs.
        expected: Option<Shard>,
    },
    /// There is nothing to merge.
    #[error("expected at least one folder of a shard")]
    NoShards,
    /// The folder to merge is not a shard's.
    #[error("{}: is not the folder of a shard, which `skein sweep --shard` makes", .0.display())]
    NotAShard(PathBuf),
    /// The folder to look at is not a sweep's.
    #[error("{}: is not the folder of a sweep or of a shard", .0.display())]
    NoSweep(PathBuf),
    /// Two folders hold shards of different sweeps.
    #[error(
        "{} and {}: hold shards of different sweeps: the experiments, the overrides or the programs differ",
        first.display(), second.display()
    )]
    OtherSweep {
        /// A folder.
        first: PathBuf,
        /// Another folder.
        second: PathBuf,
    },
    /// The shards were flown by another version of the program.
    #[error("{}: was flown by another version of this program; merge with the version that flew it", .0.display())]
    OtherProgram(PathBuf),
    /// A run is in two folders.
    #[error("run {run} is in {} and in {}; expected each run in one folder", first.display(), second.display())]
    Overlap {
        /// Number of the run, from 0.
        run: usize,
        /// A folder.
        first: PathBuf,
        /// Another folder.
        second: PathBuf,
    },
    /// The folders do not hold all runs.
    #[error(
        "{missing} of {runs} runs are missing, the first is run {first}; name the folders of all shards, and finish \
         shards that were interrupted"
    )]
    MissingRuns {
        /// Number of missing runs.
        missing: usize,
        /// Runs of the experiment.
        runs: usize,
        /// Number of the first missing run, from 0.
        first: usize,
    },
    /// The folder exists and is not a sweep's.
    #[error("{}: exists and is not the folder of a sweep; name another --out", .0.display())]
    NotASweep(PathBuf),
    /// A line of `rows.jsonl` cannot be used.
    #[error("{}: line {line}: {problem}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// What is wrong with the line.
        problem: String,
    },
    /// Workers ended before all runs were done.
    #[error("expected {runs} runs, but only {done} came back")]
    Incomplete {
        /// Runs that are done.
        done: usize,
        /// Runs of the experiment.
        runs: usize,
    },
    /// The table of runs cannot be converted.
    #[error("runs.parquet: {0}")]
    Table(#[from] TableError),
    /// A plot cannot be drawn.
    #[error("{name}: {source}")]
    Plot {
        /// The plot's file name.
        name: String,
        /// Why not.
        source: DrawError,
    },
    /// A summary cannot be written as JSON.
    #[error("the sweep's summary cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
}

impl SweepError {
    /// Whether the caller's input is at fault (exit code 2), not the environment (exit code 3).
    #[must_use]
    pub fn is_usage(&self) -> bool {
        use SweepError as E;
        match self {
            E::Folder(error) => error.is_usage(),
            E::Scenario(_) | E::Changed { .. } | E::OtherExperiment { .. } | E::OtherShard { .. } | E::NotASweep(_) => {
                true
            }
            E::NoShards | E::NotAShard(_) | E::NoSweep(_) | E::OtherSweep { .. } | E::OtherProgram(_) => true,
            E::Overlap { .. } | E::MissingRuns { .. } => true,
            _ => false,
        }
    }

    /// For `map_err`: an I/O error at `path`.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

/// What a folder holds.
fn shard_words(shard: Option<Shard>) -> String {
    shard.map_or_else(|| "all runs".to_owned(), |shard| format!("shard {shard}"))
}

/// Why a run of a grid has no valid scenario.
#[derive(Debug, Error)]
pub enum JobError {
    /// The scenario file does not parse with the run's overrides.
    #[error(transparent)]
    Scenario(#[from] ScenarioErrors),
    /// The random scene cannot be made.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The pilots cannot fly it.
    #[error(transparent)]
    Pilot(#[from] PilotProblem),
}

/// Why a random scene cannot be made.
#[derive(Debug, Error)]
pub enum SceneError {
    /// A bound is out of range, or its ends are swapped.
    #[error("{what}: found {least} to {most}, expected [least, most] from {lowest} to {highest}")]
    Bounds {
        /// `drones` or `obstacles`.
        what: &'static str,
        /// Lower end as given.
        least: u32,
        /// Upper end as given.
        most: u32,
        /// Least value allowed.
        lowest: u32,
        /// Greatest value allowed.
        highest: u32,
    },
    /// The distance of the destination behind the last obstacle is out of range.
    #[error("room_m: found {found}, expected {lowest} to {highest}")]
    Room {
        /// As given, m.
        found: u32,
        /// Least value allowed, m.
        lowest: u32,
        /// Greatest value allowed, m.
        highest: u32,
    },
    /// No attempt gave a valid scene, which takes bounds with many obstacles.
    #[error("random scene {seed}: no valid scene in {attempts} attempts{}", last.as_ref().map(|e| format!("; {e}")).unwrap_or_default())]
    NoScene {
        /// Seed of the scene.
        seed: u64,
        /// Number of attempts.
        attempts: u64,
        /// What was wrong with the last attempt; `None` if an obstacle found no place.
        last: Option<ScenarioErrors>,
    },
    /// The overrides do not fit the scene.
    #[error(transparent)]
    Overrides(ScenarioErrors),
}

/// Why a run gave no summary.
#[derive(Debug, Error)]
pub enum FlightError {
    /// The runtime could not fly the scenario.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// The summary could not be computed from the record.
    #[error("the record could not be evaluated: {0}")]
    Record(String),
    /// The process could not be started, or its files not be written.
    #[error("{what}: {source}")]
    Process {
        /// What was tried.
        what: &'static str,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The scenario cannot be written as TOML.
    #[error("the scenario cannot be written as TOML: {0}")]
    Toml(#[from] toml::ser::Error),
    /// The process ended without printing a summary.
    #[error("no summary: {0}")]
    NoSummary(String),
}

impl FlightError {
    /// For `map_err`: an I/O error while doing `what`.
    pub(crate) fn process(what: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |source| Self::Process { what, source }
    }
}

/// Why an experiment file cannot be used. The text names the file, the line and the column.
#[derive(Debug, Error)]
pub enum ExperimentError {
    /// The file cannot be read.
    #[error("{}: {source}; expected an experiment file (TOML)", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The text is not an experiment.
    #[error("{name}{}: {problem}", place.map(|(line, column)| format!(":{line}:{column}")).unwrap_or_default())]
    Invalid {
        /// Name of the text, usually its file.
        name: String,
        /// Line and column, from 1, where the problem has a place.
        place: Option<(usize, usize)>,
        /// What is wrong.
        problem: Box<Problem>,
    },
}

/// What is wrong with an experiment.
#[derive(Debug, Error)]
pub enum Problem {
    /// The TOML reader's message.
    #[error("{0}")]
    Toml(String),
    /// A key is not known.
    #[error("unknown key {found:?}, expected one of {expected}{suggestion}")]
    UnknownKey {
        /// The key.
        found: String,
        /// `; did you mean …?`, or empty.
        suggestion: String,
        /// All keys.
        expected: String,
    },
    /// The name cannot name a folder.
    #[error("name: found {0:?}, expected 1 to 64 letters, digits, `.`, `_` or `-`")]
    Name(String),
    /// A list has no items.
    #[error("{key}: found an empty list, expected {expected}")]
    EmptyList {
        /// The list's key.
        key: String,
        /// What belongs in it.
        expected: &'static str,
    },
    /// A scenario file cannot be read.
    #[error("scenario: {}: {source}", path.display())]
    ScenarioFile {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// A word names no strategy.
    #[error("strategies: {0}")]
    Strategy(#[from] StrategyError),
    /// A list names something twice.
    #[error("{key}: {item} is there twice")]
    Repeated {
        /// The list's key.
        key: String,
        /// What is there twice.
        item: String,
    },
    /// There are too few or too many seeds.
    #[error("seeds: found a count of {found}, expected 1 to {most}")]
    SeedCount {
        /// The count.
        found: u64,
        /// Greatest count.
        most: u64,
    },
    /// A seed is too great.
    #[error("seeds: found seeds up to {found}, expected at most {most}")]
    SeedTooGreat {
        /// The greatest seed.
        found: u64,
        /// Greatest seed of a scenario.
        most: u64,
    },
    /// There are too many runs.
    #[error("found {runs} runs, {cells} cells with {seeds} seeds each, expected at most {most} runs")]
    TooManyRuns {
        /// Number of runs, in words.
        runs: String,
        /// Number of combinations of scenario, strategy and values, in words.
        cells: String,
        /// Number of seeds.
        seeds: u128,
        /// Greatest number of runs.
        most: u128,
    },
    /// A key of the grid has a key of its own in the experiment.
    #[error("grid: {0} cannot be a key of the grid: the experiment has a key of its own for it")]
    ReservedKey(String),
    /// A range of values is incomplete.
    #[error("grid: {0}: expected {{ from = NUMBER, to = NUMBER, steps = 2 or more }}")]
    Range(String),
    /// A metric is not known.
    #[error("metrics: unknown {found:?}, expected some of {expected}{suggestion}")]
    UnknownMetric {
        /// The word.
        found: String,
        /// `; did you mean …?`, or empty.
        suggestion: String,
        /// All metrics.
        expected: String,
    },
    /// The bounds of random scenes are wrong.
    #[error("random: {0}")]
    Random(#[from] SceneError),
}
