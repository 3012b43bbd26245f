//! Skein, a swarm runtime, as an application that takes pilots of your own.
//!
//! A program makes an [`App`], gives it pilots by name, and hands over to it. It then answers to every command of `skein`: `run`,
//! `sweep`, `replay`, `hunt`, `view`, `bench` and the others. The processes of a run are started from the same program. Which drones a
//! pilot flies is said by the tables `[[pilot]]` of the scenario, or by `run --pilot NAME`.
//!
//! A pilot is anything that implements [`Pilot`]: [`Pilot::step`] gets what the drone senses and hears, and returns a [`Command`].
//! docs/pilots.md tells the whole story.
//!
//! # Example
//!
//! A pilot that flies towards the middle of its neighbours, in a program that answers to all commands:
//!
//! ```no_run
//! use skein::{Birth, Command, Inbox, Out, Pilot, Senses};
//!
//! struct Gather {
//!     gain: f64,
//! }
//!
//! impl Pilot for Gather {
//!     fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
//!         let count = senses.neighbours.len().max(1) as f64;
//!         let mut sum = [0.0; 3];
//!         for neighbour in senses.neighbours {
//!             sum.iter_mut().zip(neighbour.position_m).for_each(|(sum, m)| *sum += m);
//!         }
//!         Command::velocity(sum.map(|sum| self.gain * sum / count))
//!     }
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     skein::App::new()
//!         .try_pilot("gather", |birth: &Birth| {
//!             Ok(Box::new(Gather { gain: birth.params.get_f64("gain_per_s", 0.1)? }))
//!         })
//!         .main()
//! }
//! ```
#![allow(
    rustdoc::broken_intra_doc_links,
    rustdoc::invalid_html_tags,
    reason = "the doc comments of options are their help texts, not Markdown"
)]

mod app;
mod bench;
mod check;
mod clean;
mod cli;
mod colour;
mod complaint;
mod doctor;
mod exit;
mod experiment_file;
mod hosts;
mod hunt;
mod hunt_folder;
mod input;
mod interrupt;
mod missing;
mod options;
mod output;
mod progress;
mod replay;
mod report;
mod reproduce;
mod roles;
mod run;
mod run_folder;
mod run_options;
mod scenario_args;
mod schema;
mod sweep;
mod tap;
mod top;
mod topic;
mod view;

pub use app::App;
pub use skein_pilot::{
    Birth, Command, Heard, Inbox, Motion, Out, Params, Pilot, PilotError, SensedNeighbour, SensedObstacle, Senses,
    Status,
};
