//! `skein reproduce`: flies the paper's missions by the inline runtime and puts what came of them beside what was
//! published.
//!
//! Its folder holds `report.md` and `report.html`, `reproduction.json` (a row a published quantity), `results.csv` (a
//! line a flight), `gain.csv` (the gain over shift and safe distance), `figures/*.svg`, and in `forest` the recorded forest
//! mission that figures are drawn from.

mod args;
mod command;
mod content;
mod figures;
mod flight;
mod flights;
mod forest;
mod gain;
mod jitter;
mod page;
mod results;
mod rows;
mod says;
mod studies;
mod table;

pub use args::ReproduceArgs;
pub use command::reproduce;
