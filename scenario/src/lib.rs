//! Reads a mission from TOML: text in, a checked [`Scenario`] or all errors with their places out.
//!
//! - [`Scenario::parse`] reads TOML with overrides (`--set KEY=VALUE`). [`Scenario::parse_bytes`] and
//!   [`Scenario::from_json`] read bytes and JSON. [`ScenarioSource`] names the text.
//! - [`Scenario`] holds every key, with a table per part of the mission: [`Formation`], [`Mission`], [`Drone`],
//!   [`RadioKeys`], [`Obstacle`], [`Fault`], [`PilotKeys`] and others. Methods give what follows from the keys, such as
//!   [`Scenario::starts`], [`Scenario::shapes`] and [`Scenario::radio`].
//! - [`ScenarioErrors`] holds all errors. Each [`Issue`] names its place, its key, what was found and what was expected.
//! - [`keys`], [`markdown`] and [`schema`] describe every key: unit, range, default, meaning. They are generated from the
//!   types: doc comments are the meanings. `docs/scenario.md` is [`markdown`]'s output.
//!
//! The crate is pure: it reads no files and runs nothing. It does not know how a mission flies.
//!
//! # Example
//!
//! ```
//! use skein_scenario::{Scenario, ScenarioSource};
//!
//! let source = ScenarioSource { name: "mission.toml", stem: "mission" };
//! let text = "
//!     [formation]
//!     drones = 5
//!     [[obstacle]]
//!     shape = \"circle\"
//!     centre_m = [200, 0]
//!     radius_m = 20
//! ";
//! let scenario = Scenario::parse(text, source, &[("seed".to_owned(), "7".to_owned())])?;
//! assert_eq!((scenario.name.as_str(), scenario.seed), ("mission", 7));
//! assert_eq!(scenario.starts().len(), 5);
//! assert_eq!(scenario.stopping_distance_m().round(), 10.0);
//!
//! let errors = Scenario::parse("[formation]\ndrones = 0", source, &[]).unwrap_err();
//! assert_eq!(
//!     errors.to_string(),
//!     "mission.toml:2:10: formation.drones: found 0, expected a whole number from 1 to 10000"
//! );
//! # Ok::<(), skein_scenario::ScenarioErrors>(())
//! ```
#![warn(unreachable_pub)]

mod broken_rule;
mod check;
mod energy_keys;
mod error;
mod fault_bounds;
mod fault_rules;
mod faults;
mod guidance;
mod host_rules;
mod hosts;
mod keys;
mod limits;
mod name;
mod near;
mod node;
mod objective;
mod obstacle;
mod parse;
mod passage;
mod pilot_rules;
mod pilots;
mod radio;
mod radio_keys;
mod reference;
mod resolved;
mod rules;
mod schema_tree;
mod sensors;
mod strategy;
mod suggestion;

pub use energy_keys::{EnergyKeys, Thrust};
pub use error::{Issue, ScenarioErrors};
pub use faults::{
    Failsafe, Fault, FaultEvent, FaultKind, FaultTarget, Faults, PartitionSides, Sensor, SidesWord, TargetError,
};
pub use guidance::Guidance;
pub use hosts::HostKeys;
pub use keys::{
    Avoidance, Between, Drone, End, Formation, FormationShape, Mission, Parts, Protocol, Reformation, Scenario, Time,
};
pub use limits::{MAX_DRONES, MAX_FAULTS, MAX_HOSTS, MAX_OBSTACLES, MAX_PILOTS};
pub use objective::Objective;
pub use obstacle::Obstacle;
pub use parse::ScenarioSource;
pub use pilots::{DEFAULT_PILOT, FreeTable, PilotKeys};
pub use radio_keys::{BurstKeys, BurstScope, DelayModel, Preset, RadioKeys, RuleKeys};
pub use reference::{KeyDoc, keys, markdown, schema};
pub use sensors::{OutlineSensing, Sensors};
pub use strategy::{Strategy, StrategyError};
pub use suggestion::{did_you_mean, nearest};
