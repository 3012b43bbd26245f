//! TOML → a checked [`Scenario`]. Pure: text in, scenario out; reading files is the caller's.
//!
//! The types in `keys`, `faults`, `obstacle`, `radio` and `strategy` are the one source of truth: schemars makes the JSON
//! [`schema`] of their doc comments, ranges and defaults; the checks walk the text against that schema, and [`markdown`]
//! prints it as the key reference `docs/scenario.md`.

mod check;
mod error;
mod fault_rules;
mod faults;
mod guidance;
mod keys;
mod near;
mod node;
mod objective;
mod obstacle;
mod parse;
mod radio;
mod reference;
mod resolved;
mod rules;
mod strategy;

pub use error::{Issue, ScenarioErrors};
pub use faults::{
    Failsafe, Fault, FaultEvent, FaultKind, FaultTarget, Faults, MAX_FAULTS, PartitionSides, Sensor, SidesWord,
};
pub use guidance::Guidance;
pub use keys::{
    Avoidance, Drone, End, Formation, FormationShape, MAX_DRONES, MAX_OBSTACLES, Mission, Protocol, Reformation,
    Scenario, Sensors, Time,
};
pub use objective::Objective;
pub use obstacle::Obstacle;
pub use parse::ScenarioSource;
pub use radio::{BurstKeys, BurstScope, DelayModel, Preset, RadioKeys, RuleKeys, TopicKey};
pub use reference::{KeyDoc, keys, markdown, schema};
pub use strategy::{Strategy, StrategyError};
