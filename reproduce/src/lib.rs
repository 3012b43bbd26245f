//! The reproduction of the paper "Swarm Formation Morphing for Congestion Aware Collision Avoidance": flies its missions
//! by the inline runtime, and puts the results beside the published numbers.
//!
//! A [`Flight`] is one mission: a scenario of the paper with a strategy, a seed and changed keys. The scenario files are
//! part of the library. [`Reproduction`] flies all of them and writes the report. A [`Row`] is one quantity: the published
//! value, ours, and the command that repeats it.
//!
//! The report's folder holds `report.md` and `report.html`, `reproduction.json` (the rows), `results.csv` (one line for
//! each flight), `gain.csv` (the gain over shift and safe distance), `figures/*.svg`, and in `forest` and `distribution` the
//! recorded missions from which figures are drawn.
//!
//! This crate does not print and does not watch signals: progress and interruption are callbacks. It knows no other
//! missions than the paper's and those that are compared with them.
//!
//! ```
//! use skein_reproduce::{Flight, PAPER};
//!
//! // Row R3: obstacle to the right, the paper's rule. Published: 32 s from detection to pass.
//! let flight = Flight::new("s2-right", PAPER);
//! assert_eq!(flight.command(), "skein run scenarios/paper/s2-right.toml --strategy congestion-aware-paper");
//! let summary = skein_sweep::fly_inline(&flight.resolve()?, &skein_runtime::PilotRegistry::built_in()?, &|| None)?;
//! let ours_s = summary.stages[0].pass_time_s.expect("all drones pass");
//! assert!((ours_s - 32.0).abs() < 2.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod block;
mod cases;
mod content;
mod distribution;
mod error;
mod figures;
mod findings;
mod flight;
mod flights;
mod forest;
mod gain;
mod headline;
mod jitter;
mod page;
mod recording;
mod reproduction;
mod results;
mod row;
mod rows;
mod studies;
mod study;
mod table;

pub use cases::{LOOK_AHEAD, PAPER, SHORTEST};
pub use error::{MissionError, ReproduceError};
pub use flight::Flight;
pub use headline::text as headline;
pub use reproduction::Reproduction;
pub use row::Row;
