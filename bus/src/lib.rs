//! What joins the processes of a swarm; the only crate that names iceoryx2.
//!
//! | module | what |
//! |---|---|
//! | [`domain`] | where a run's shared things live, and how they are removed |
//! | [`control`], [`barrier`], [`mission`], [`orders`] | the control segment: a memfd of futex words and actuator slots |
//! | [`services`], [`ports`], [`payload`] | downlink, uplink shards and record, over iceoryx2 publish-subscribe |
//! | [`host`], [`stopwatch`] | pinning, limits; what a step takes |
//!
//! The launcher calls [`Domain::create`], [`Control::create`] and [`Services::create`]; its children get the domain's
//! path and the memfd's number and call [`Domain::join`], [`Control::attach`] and [`Services::open`].
#![deny(unsafe_code)]

pub mod barrier;
pub mod baseline;
pub mod control;
pub mod domain;
pub mod error;
mod futex;
pub mod host;
pub mod mission;
pub mod payload;
pub mod ports;
pub mod process_request;
pub mod services;
pub mod stopwatch;

pub use barrier::{DroneEndpoint, Patience, TickOutcome, TickSignal};
pub use baseline::Baseline;
pub use control::{Control, ControlSpec, WaitMode};
pub use domain::{Cleaned, Domain, clean, living};
pub use error::BusError;
pub use host::{PinMode, allowed_cores, pin_to_core, raise_file_limit};
pub use mission::WorldState;
pub use payload::UplinkHeader;
pub use ports::{
    DownlinkPublisher, DownlinkSubscriber, RecordPolicy, RecordPublisher, RecordSubscriber, UplinkPublisher,
    UplinkSubscriber, WatchPublisher,
};
pub use process_request::{ProcessRequest, RequestKind};
pub use services::{DeadNodes, SHARD_DRONES, Services, clean_dead_nodes, shards};
pub use stopwatch::Stopwatch;
