//! Sweeps: fly a grid of missions side by side and summarise them with 95 % confidence intervals.
//!
//! An [`Experiment`] names scenarios, strategies, seeds and scenario keys that vary. A [`Grid`] numbers its runs: each
//! combination with each seed. A [`Sweep`] flies the runs with a pool of workers, inline or as swarms of processes, and
//! gives a [`SweepReport`]: a [`Row`] for each run and a [`Cell`] for each combination. [`statistics`] has the intervals:
//! Wilson's for rates, Student's for means. [`random_scene`] makes the missions of experiments with
//! `scenario = "random"`, [`wide_scene_toml`] those of experiments with `scenario = "wide"`.
//!
//! In a folder, a sweep can be interrupted at any time, even killed, and resumed. The folder holds `experiment.json` (which
//! experiment it belongs to) and `rows.jsonl` (one line for each finished run). Once all runs are done it also holds
//! `runs.csv`, `summary.json` and `plots/*.svg`; and `ratios.csv` and `plots/ratios.svg` if `shortest-path` is one of
//! several strategies. If a run fails, the sweep goes on, and the run's row says why.
//!
//! A [`hunt::Hunt`] searches the runs of a grid, and missions that differ a little from them, for failures, and makes what it finds
//! small.
//!
//! This crate does not print, and it does not know the command line: progress and interruption are callbacks. It does not
//! know what the missions are about.
//!
//! ```
//! use skein_sweep::{Experiment, Grid, Sweep};
//! use std::path::Path;
//!
//! // Two drones and no obstacle, two seeds, without and with loss: four runs.
//! let text = r#"
//!     scenario = "random"
//!     seeds = 2
//!     [random]
//!     drones = [2, 2]
//!     obstacles = [0, 0]
//!     [grid]
//!     radio.loss = [0, 0.3]
//! "#;
//! let experiment = Experiment::parse(text, "demo", Path::new(""))?;
//! let grid = Grid::new(&experiment, &[]);
//! let pilots = skein_runtime::PilotRegistry::built_in()?;
//! let report = Sweep::new(&grid, &pilots).workers(2).run_in_memory()?.complete().expect("nothing interrupts it");
//! assert_eq!(report.rows().len(), 4);
//! let success = report.cells()[0].estimate("success").expect("both runs were flown");
//! assert_eq!((success.mean, success.n), (1.0, 2));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis_values;
mod cells;
mod energy_ratios;
mod error;
mod experiment;
mod file_kind;
mod file_place;
mod flight;
mod grid;
pub mod hunt;
mod item_problem;
mod limits;
mod metrics;
mod missions;
mod own_statistic;
mod paired;
mod plots;
mod program_name;
mod random_scene;
mod report;
mod row;
mod run_count;
mod shard;
mod shards;
mod splitmix;
pub mod statistics;
mod store;
mod sweep;
mod sweep_progress;
mod table;
mod wide_scene;
mod worker_pool;

pub use cells::Cell;
pub use energy_ratios::{EnergyRatios, SeedRatio};
pub use error::{ExperimentError, FlightError, JobError, Problem, SceneError, SweepError};
pub use experiment::{Axis, Experiment, Mission};
pub use file_kind::FileKind;
pub use flight::{Interrupted, fly_inline};
pub use grid::{Combination, Grid};
pub use metrics::{METRICS, Metric, OWN_PREFIX, SUCCESS};
pub use paired::PairedDifference;
pub use plots::Plot;
pub use program_name::program_name;
pub use random_scene::{SceneBounds, random_scene, scene_toml};
pub use report::SweepReport;
pub use row::Row;
pub use shard::{Shard, ShardError};
pub use shards::Shards;
pub use sweep::{Progress, Sweep, SweepEnd};
pub use sweep_progress::{FolderProgress, SweepProgress};
pub use wide_scene::{wide_scene, wide_scene_toml};
pub use worker_pool::WorkerPool;
