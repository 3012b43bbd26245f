//! Runs a mission: it steps the world and the pilots, tick by tick, and hands the record of each tick to a sink.
//!
//! There are two runtimes. Both step the same [`PilotHost`]s and the same `World`, so that a scenario and a seed give the
//! same digest in both:
//!
//! - [`inline::run`] calls everything in one thread. It is the reference for determinism, and the fastest way to fly many
//!   missions.
//! - [`supervisor::run`] starts one process for the world and one for each drone (or for several). They exchange frames
//!   and states through shared memory, and faults of the scenario kill, stop and restart real processes. The processes
//!   call [`world_process::run`] and [`drone_process::run`].
//!
//! A [`Clock`] paces the ticks. In lockstep, each tick waits for every living drone. By the wall clock, a drone that is
//! late keeps its last command.
//!
//! A [`PilotRegistry`] knows the pilots by name, and the [`Program`] from which processes are started. The scenario says which
//! drones they fly.
//!
//! [`mission`] turns a `Scenario` into the world and into the parameters of the pilots. [`DroneFactory`] makes one
//! [`PilotHost`] per drone: a pilot, its radio receiver and what it counts in a tick. A program that steps the world
//! itself, such as a test, needs only these two modules.
//!
//! The crate deliberately does not know how a drone decides (`skein-agent`), what the truth is (`skein-world`), how shared
//! memory works (`skein-bus`), or what the files of a run look like (`skein-report`).
//!
//! # Example
//!
//! Three drones fly past a tree. The sink reads the end of the mission from the record.
//!
//! ```
//! use skein_protocol::record::{EventKind, Outcome, RecordSink, RecordView, SinkError};
//! use skein_runtime::{PilotRegistry, inline};
//! use skein_scenario::{Scenario, ScenarioSource};
//!
//! #[derive(Default)]
//! struct LastOutcome(Option<Outcome>);
//!
//! impl RecordSink for LastOutcome {
//!     fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
//!         let events = record.parse_events(|line| serde_json::from_slice(line).map_err(|error| error.to_string()))?;
//!         for event in events {
//!             if let EventKind::End { outcome, .. } = event.what {
//!                 self.0 = Some(outcome);
//!             }
//!         }
//!         Ok(())
//!     }
//! }
//!
//! let text = r#"
//!     [formation]
//!     shape = "v"
//!     drones = 3
//!     spacing_m = 60
//!
//!     [[obstacle]]
//!     shape = "circle"
//!     centre_m = [150, 5]
//!     radius_m = 10
//! "#;
//! let scenario = Scenario::parse(text, ScenarioSource { name: "tree.toml", stem: "tree" }, &[])?;
//! let mut sink = LastOutcome::default();
//! inline::run(&scenario, &PilotRegistry::built_in()?, &mut sink, || None)?;
//! assert_eq!(sink.0, Some(Outcome::Reached));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod advice;
mod beacon;
mod child_args;
mod children;
mod clock;
mod cruise;
mod drone_factory;
pub mod drone_process;
mod drone_range;
mod error;
mod fault_plan;
mod forked;
mod hang_watch;
mod host_share;
mod in_pilots;
pub mod inline;
mod launch;
mod local_tap;
mod look_line;
pub mod mission;
mod pacer;
mod pilot_host;
mod pilot_problem;
mod pilot_registry;
mod process_state;
mod program;
mod programs;
mod radio_receiver;
mod record_wait;
mod relay_line;
mod reported_panic;
mod run_end;
pub mod run_facts;
mod said;
pub mod scenario_file;
mod split_swarm;
mod steered_swarm;
pub mod supervisor;
mod talker;
#[cfg(test)]
mod test_run;
mod tuning;
mod uplinks;
mod wing;
pub mod world_process;

pub use beacon::BeaconPilot;
pub use child_args::{ChildArgs, end_with_parent, lighten};
pub use clock::{Clock, ClockError};
pub use drone_factory::DroneFactory;
pub use drone_range::DroneRange;
pub use error::RuntimeError;
pub use hang_watch::HangWatch;
pub use host_share::{HostReport, HostShare};
pub use launch::{Launch, OnReady, PATIENCE, ProcessInfo, ProcessRole};
pub use local_tap::LocalTap;
pub use look_line::{LookRequest, LookRun, LookStream, LookWord, push_sample, samples};
pub use pilot_host::{HostParams, PilotHost, StepScratch};
pub use pilot_problem::PilotProblem;
pub use pilot_registry::PilotRegistry;
pub use program::{Program, resolve_commands};
pub use relay_line::{RelayRequest, RelayWord};
pub use run_end::RunEnd;
pub use said::Said;
pub use split_swarm::{PartTick, SplitSwarm};
pub use steered_swarm::SteeredSwarm;
pub use wing::{Wing, WingLaunch};
