//! What drones say to each other, and in which form it crosses the border of a process.
//!
//! The main types:
//!
//! - [`Message`] is one message; [`message::Topic`] names its kind. [`Message::encode`] makes a [`frame::Frame`] of fixed
//!   size, and [`Message::decode`] checks every field of a frame that another process wrote.
//! - [`UserMessage`] is a message of a pilot's own under a [`TopicName`]; [`telemetry`] is what a pilot reports about itself.
//! - [`payload`] has the layouts of the messages, and [`wire`] the enums behind their integers ([`LeadershipKind`],
//!   [`Phase`], [`ArrivalsKind`]).
//! - [`ids`] and [`time`] name drones, groups, terms, plans and instants of simulated time.
//! - [`radio::Radio`] decides whether and when a receiver hears a frame. It is a pure function of the frame, the link and a
//!   seed; it has no generator that processes would have to share.
//! - [`downlink`] is what the world sends to all drones in a tick, [`slot`] is what each drone answers, and [`record`] is
//!   what the world sends to the recorder.
//! - [`formation`], [`shape`], [`energy`], [`thin_plate`] and [`digest`] are mathematics that several crates share.
//!
//! This crate is pure: it has no clock, thread, socket, file, or randomness of the operating system. It does not know how
//! frames move between processes, how a leader is elected, or how a drone flies. Units are SI, angles are in radians, and
//! the world frame is ENU. [`Course`] is the direction in which a mission flies.
//!
//! ```
//! use skein_protocol::message::DecodeError;
//! use skein_protocol::payload::Leadership;
//! use skein_protocol::radio::{Delivery, Link, Radio};
//! use skein_protocol::{Ballot, DroneId, GroupId, LeadershipKind, Message, SimTime, Vec3};
//!
//! let ballot = Ballot { round: 1, incarnation: 1, claimant: DroneId(3) };
//! let kind = LeadershipKind::Claim.to_wire() as u16;
//! let claim =
//!     Leadership { stamp: SimTime::ZERO, ballot, kind, hops: 0, group: GroupId::ALL, epoch: 0, heir: DroneId::NONE };
//! let frame = Message::Leadership(claim).encode();
//! let Ok(Message::Leadership(heard)) = Message::decode(&frame) else { panic!("a valid frame is decoded") };
//! assert_eq!(heard.kind(), LeadershipKind::Claim);
//!
//! // A number that stands for no kind is refused at the border.
//! let strange = Message::Leadership(Leadership { kind: 9, ..claim }).encode();
//! assert_eq!(Message::decode(&strange), Err(DecodeError::Field("kind of leadership")));
//!
//! // The default radio is ideal: each frame is heard once and without delay.
//! let link = Link { source: DroneId(3), destination: DroneId(4), topic: frame.kind, sequence: 0 };
//! let delivery = Radio::default().outcome(link, Vec3::new(1000.0, 0.0, 0.0), SimTime::ZERO);
//! assert_eq!(delivery, Delivery::Deliver { due: SimTime::ZERO, again: None });
//! ```

mod course;
mod decode_error;
pub mod digest;
pub mod downlink;
mod drop_reason;
pub mod energy;
pub mod formation;
pub mod frame;
pub mod histogram;
pub mod ids;
pub mod link_faults;
pub mod matching;
pub mod message;
mod metric_name;
pub mod nearby;
pub mod payload;
mod prefetch;
pub mod radio;
pub mod record;
pub mod scale;
pub mod shape;
mod short_text;
pub mod slot;
mod space;
pub mod telemetry;
pub mod thin_plate;
pub mod time;
mod topic;
mod topic_name;
pub mod turned;
mod unfinished;
mod user_message;
pub mod wire;

pub use course::Course;
pub use ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
pub use message::{Message, MessageRef};
pub use metric_name::{MetricName, MetricNameError};
pub use prefetch::prefetch;
pub use short_text::{ShortText, TEXT_FIELD};
pub use space::{horizontal, raised};
pub use time::{SimTime, Tick};
pub use topic_name::{OWN_TOPIC, TopicName, TopicNameError};
pub use unfinished::{Lack, UnfinishedDrone};
pub use user_message::{TooLong, USER_BYTES, UserMessage};
pub use wire::{ArrivalsKind, LeadershipKind, Phase, flag};

/// A horizontal vector or point, metres (or m/s, m/s²), world frame.
pub type Vec2 = nalgebra::Vector2<f64>;

/// A vector or point in space, metres (or m/s, m/s²), world frame: x and y as in [`Vec2`], z up.
pub type Vec3 = nalgebra::Vector3<f64>;
