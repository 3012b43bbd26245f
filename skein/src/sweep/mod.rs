//! `skein sweep`: flies a grid of missions, jobs side by side, and says what came of them. `skein scene`: one random scene.
//!
//! A sweep's folder holds `experiment.json` (whose sweep it is), `rows.jsonl` (a finished run a line, what a sweep is
//! resumed from), and once all runs are done `runs.csv`, `summary.json` and `plots/*.svg`;
//! with `shortest-path` among several strategies also `ratios.csv` and `plots/ratios.svg`.

pub(crate) mod args;
mod cells;
pub(crate) mod command;
mod draw;
mod experiment;
pub(crate) mod fly;
mod grid;
mod metrics;
mod plots;
pub(crate) mod pool;
mod random;
mod ratios;
mod row;
pub(crate) mod statistics;
mod store;
mod table;

pub use args::{SceneArgs, SweepArgs};
pub use command::{scene, sweep};
