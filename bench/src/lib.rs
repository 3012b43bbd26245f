//! Benchmarks of Skein: the runtime, its parts, real-time operation and leader failover.
//!
//! - [`runtime::RuntimeBench`] measures what a tick costs, for function calls, for processes, and for a baseline that
//!   exchanges the same bytes by raw shared memory. All cases are interleaved in rounds, and ratios are taken within a
//!   round, because absolute figures belong to the machine.
//! - [`failover::FailoverBench`] kills leaders again and again, and measures the time until all drones follow another one.
//! - [`election::ElectionBench`] measures how long swarms of any size and shape take to elect a leader over a bad radio.
//! - [`clock::ClockBench`] flies by the wall clock, and measures how late ticks open.
//! - [`pilots::PilotBench`] flies one mission with several pilots, and compares what they cost.
//! - [`peers::PeerBench`] compares Skein with another library for collision avoidance.
//! - [`split::SplitBench`] divides the world by space, and says from measured costs how many drones one swarm can have.
//! - [`parts::PartBench`] measures single parts of a tick: radio, grouping, sensing, recording.
//!
//! Each benchmark is a plain struct of settings with a method `run`, which gives rows that serialise to JSON. The structs
//! derive [`clap::Args`], so that a command line can take them over. Flights in processes need a program that plays
//! Skein's roles; [`Context`] names it. This crate does not print and does not watch signals.
//!
//! ```
//! use skein_bench::parts::{Part, PartBench};
//! use skein_bench::Context;
//! use skein_runtime::PilotRegistry;
//!
//! let pilots = PilotRegistry::built_in()?;
//! let context = Context { pilots: &pilots, interrupted: &|| None };
//! let bench = PartBench { drones: vec![8], rounds: 1 };
//! let figures = bench.run(Part::Grouping, &context)?.expect("nothing interrupts it");
//! assert_eq!(figures.len(), 4, "two and four routes, with and without the tie-break");
//! assert!(figures.iter().all(|figure| figure.value > 0.0 && figure.unit == "ms"));
//! # Ok::<(), skein_bench::BenchError>(())
//! ```

pub mod clock;
mod context;
pub mod election;
mod error;
pub mod failover;
mod flown_by;
mod median;
pub mod parts;
pub mod peers;
pub mod pilots;
pub mod runtime;
mod scratch;
pub mod split;

pub use context::{Context, Interrupted};
pub use error::BenchError;
pub use median::median;
