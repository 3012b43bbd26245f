//! The true state of a mission, advanced one tick at a time: bodies, obstacles, senses, energy, faults, invariants.
//!
//! [`World`] holds what is true. A runtime asks it for the senses of all drones ([`World::downlink`]), gives it what the
//! drones answer ([`World::take_slot`], [`World::take_frames`]), and lets it advance by one tick ([`World::advance`]).
//! Each tick ends with a record ([`World::record`]) for the recorder and a digest ([`World::digest`]) that is equal
//! whenever every bit of the mission is equal.
//!
//! - [`WorldParams`] describes the mission: limits, distances, end condition, scheduled faults. [`WorldError`] says which
//!   parameter is invalid.
//! - [`faults`] describes what goes wrong, when, and for which drones. The world tells the runtime by
//!   [`faults::ProcessCommand`] which processes to kill, stop, continue or start.
//! - [`World`] composes machines with private state, one file each: the drone table, the sensor sweep, the fault engine,
//!   the obstacle sets, the invariant monitor, the judge of the mission's end, the uplink, the counters, the digest.
//!
//! [`split`] divides a world by space into parts that know only their own drones and what is near them.
//!
//! The crate is pure: no clock, thread, process or randomness of the operating system. The same calls give the same
//! bits. It does not know what drones think, whether a radio delivers a frame, or what a process is.
//!
//! World frame: x along the flight, y to its left, z up from the ground. SI units.
//!
//! # Example
//!
//! One drone accelerates along the flight for one tick.
//!
//! ```
//! use skein_protocol::formation::Shape;
//! use skein_protocol::nearby::Locality;
//! use skein_protocol::slot::Slot;
//! use skein_protocol::{Course, DroneId, Vec3};
//! use skein_world::faults::FaultPlan;
//! use skein_world::{End, EnergyModel, Failsafe, PartsRule, SensorErrors, World, WorldParams};
//!
//! let params = WorldParams {
//!     dt_ns: 20_000_000,
//!     timeout_s: 60.0,
//!     without_way: Vec::new(),
//!     speed_max_mps: 20.0,
//!     acceleration_max_mps2: 5.0,
//!     braking_mps2: 5.0,
//!     safe_distance_m: 25.0,
//!     clearance_m: 15.0,
//!     planning_distance_m: 20.0,
//!     reaction_time_s: 0.0,
//!     detection_range_m: 90.0,
//!     ranging_m: Some(50.0),
//!     sensors: SensorErrors::default(),
//!     channel: None,
//!     locality: Locality::default(),
//!     failsafe: Failsafe::Hover,
//!     end: End::Hold { stop_x_m: 1000.0 },
//!     parts: PartsRule::One,
//!     arrival_error_m: 0.8,
//!     hold_speed_mps: 1.0,
//!     course: Course::East,
//!     shape: Shape::NestedV,
//!     spacing_m: 35.0,
//!     energy: EnergyModel::default(),
//!     faults: FaultPlan::default(),
//!     pilots: Vec::new(),
//! };
//! let start = (Vec3::new(0.0, 0.0, 50.0), Vec3::new(10.0, 0.0, 0.0));
//! let mut world = World::new(params, &[start], &[])?;
//!
//! assert!(world.process_commands().is_empty());
//! assert_eq!(world.downlink().drones.len(), 1);
//! world.take_slot(DroneId(0), &Slot { acceleration_mps2: [1.0, 0.0, 0.0], ..Slot::default() });
//! world.advance();
//!
//! let row = world.record().rows[0];
//! assert_eq!(row.velocity_mps, [10.02, 0.0, 0.0]);
//! assert_eq!(world.tick(), 1);
//! assert_eq!(world.ended(), None);
//! # Ok::<(), skein_world::WorldError>(())
//! ```
#![warn(unreachable_pub)]

mod body;
mod burst;
mod counters;
mod decision_log;
mod drones;
mod end_condition;
mod energy_model;
mod event_log;
mod fault_plan;
pub mod faults;
mod geometry;
mod goal_slots;
mod grid;
mod invariants;
mod judge;
mod neighbours;
mod params;
mod parts;
mod process;
mod sense_writer;
mod sensor_errors;
mod sensor_fault;
mod sensor_model;
mod slot_gaps;
pub mod split;
mod stages;
mod stillness;
mod sweep;
mod telemetry_log;
#[cfg(test)]
mod testing;
mod tick_digest;
mod tick_record;
mod tuning;
mod unfinished;
mod unfinished_text;
mod uplink;
mod view;
mod world;

pub use energy_model::EnergyModel;
pub use params::{End, Failsafe, PartsRule, WorldError, WorldParams};
pub use sensor_errors::{ClockErrors, PositionError, RangingErrors, SensorErrors};
pub use world::World;
