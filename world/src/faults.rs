//! Scheduled faults. [`FaultPlan`] says what goes wrong, when, and for which drones. The world carries the plan out tick
//! by tick. It decides by the true state and by what drones report of themselves, so every runtime does the same.

pub(crate) mod engine;
pub(crate) mod keyed_rng;
pub(crate) mod schedule;
pub(crate) mod targets;
pub(crate) mod triggers;
pub(crate) mod view;

pub use crate::fault_plan::{
    ClockDrift, Fault, FaultEffect, FaultPlan, FaultTargets, FaultTime, FaultTrigger, Noise, PositionDrift,
    ProcessCommand, Wind,
};
