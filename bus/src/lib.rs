//! Joins the processes of a swarm on one machine. This is the only crate that names iceoryx2.
//!
//! A run consists of a launcher, one world process and one process per drone (or per range of drones). They share three
//! things:
//!
//! - a [`Domain`]: the run's folder, its lock, and its prefix in shared memory. Runs with different domains do not see each
//!   other. [`clean`] removes what dead runs left behind.
//! - a [`Control`] segment: a memfd with the barrier of the tick, the actuator slots, and requests for process faults. The
//!   world opens a tick with [`Control::open_tick`] and waits with [`Control::wait_done`]; a drone waits and answers through
//!   its [`DroneEndpoint`].
//! - [`Services`]: the downlink from the world to all drones, the uplinks with the drones' frames, and the record. All are
//!   iceoryx2 publish-subscribe services whose samples are written and read in place.
//!
//! The launcher calls [`Domain::create`], [`Control::create`] and [`Services::create`]. Its children get the domain's path
//! and the memfd's number, and call [`Domain::join`], [`Control::attach`] and [`Services::open`].
//!
//! This crate does not know what a pilot, a world or a scenario is: it moves frames, slots and bytes whose layouts
//! `skein-protocol` defines. It starts no process and decides nothing about faults.
//!
//! One tick of one drone, with a thread in the place of the drone's process:
//!
//! ```
//! use skein_bus::{Control, ControlSpec, DroneEndpoint, Patience, TickOutcome, TickSignal, WaitMode};
//! use skein_protocol::slot::Slot;
//! use std::{sync::Arc, time::Duration};
//!
//! # fn main() -> Result<(), skein_bus::BusError> {
//! let world = Control::create(ControlSpec { drones: 1, cores: 1, per_process: 1, wait: WaitMode::Block })?;
//! let control = Control::attach(world.fd().expect("the maker of a segment has its descriptor"))?;
//! let mut drone = DroneEndpoint::new(Arc::new(control), 0)?;
//! let process = std::thread::spawn(move || {
//!     while let TickSignal::Tick(k) = drone.wait_tick(|| true) {
//!         drone.finish(k, &Slot { heard: 7, ..Slot::default() });
//!     }
//! });
//! let mut outcomes = [TickOutcome::Pending];
//! world.open_tick(0)?;
//! world.wait_done(0, Patience::For(Duration::from_secs(5)), &mut outcomes)?;
//! assert_eq!((outcomes, world.slot(0).heard), ([TickOutcome::Done], 7));
//! world.close();
//! process.join().expect("the drone returns once the barrier is closed");
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

mod barrier;
mod baseline;
mod control;
pub mod domain;
mod drone_block;
mod drone_endpoint;
mod error;
mod exit_guard;
mod file_limit;
mod fork_guard;
mod futex;
mod home_file;
mod host;
mod large_pages;
mod mission;
pub mod payload;
pub mod ports;
mod process_end;
mod process_request;
mod room;
mod run_tag;
mod segment;
pub mod services;
mod shared_memory;
mod spare_room;
mod spec;
mod stopwatch;
mod strays;
mod tick_watch;
mod tick_word;
mod version;

pub use barrier::{Patience, TickOutcome};
pub use baseline::Baseline;
pub use control::Control;
pub use domain::{Cleaned, Domain, clean, living};
pub use drone_endpoint::{DroneEndpoint, TickSignal};
pub use error::BusError;
pub use exit_guard::guard_exit;
pub use file_limit::outlive_file_limit;
pub use fork_guard::ForkGuard;
pub use host::{PinMode, allowed_cores, pin_to_core, raise_file_limit};
pub use large_pages::LargePages;
pub use mission::WorldState;
pub use payload::UplinkHeader;
pub use ports::{
    DownlinkPublisher, DownlinkSubscriber, RecordPolicy, RecordPublisher, RecordSubscriber, UplinkPublisher,
    UplinkSubscriber, WatchPublisher,
};
pub use process_end::end_process;
pub use process_request::{ProcessRequest, RequestKind};
pub use services::{DeadNodes, SHARD_DRONES, Services, clean_dead_nodes, shards};
pub use spare_room::SpareRoom;
pub use spec::{ControlSpec, WaitMode};
pub use stopwatch::{Lap, Stopwatch};
pub use tick_watch::TickWatch;
pub use version::Version;
