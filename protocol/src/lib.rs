//! What drones say to each other, and in which form it crosses a process border.
//!
//! Pure: no clock, thread, socket or operating-system randomness. SI units, angles in radians, world frame ENU with
//! x along the flight direction and y to its left.
//!
//! | module | what |
//! |---|---|
//! | [`ids`], [`time`] | names of drones, groups, terms; simulated time |
//! | [`message`], [`payload`], [`frame`] | what is said; its layout; the checked frame that carries it |
//! | [`radio`] | whether and when a frame is heard: a pure, keyed function |
//! | [`sides`] | who is cut off from whom by script |
//! | [`downlink`], [`slot`] | what the world tells the drones in a tick; what a drone's actuators answer |
//! | [`histogram`] | mean and quantiles of what is counted in equal steps |
//! | [`nearby`] | the frames of a tick by where they were sent |
//! | [`record`] | what the world tells the recorder |
//! | [`formation`], [`shape`], [`energy`] | target shapes; obstacle shapes; power of flight |
//! | [`thin_plate`] | the spline between two point sets and its bending energy |

pub mod digest;
pub mod downlink;
pub mod energy;
pub mod formation;
pub mod frame;
pub mod histogram;
pub mod ids;
pub mod link_faults;
pub mod matching;
pub mod message;
pub mod nearby;
pub mod payload;
pub mod radio;
pub mod record;
pub mod shape;
pub mod slot;
pub mod thin_plate;
pub mod time;
pub mod wire;

pub use ids::{Ballot, DroneId, GroupId, ObstacleId, PlanStamp};
pub use message::{Message, MessageRef};
pub use time::{SimTime, Tick};
pub use wire::{ArrivalsKind, LeadershipKind, Phase, flag};

/// A planar vector or point, metres (or m/s, m/s²), world frame.
pub type Vec2 = nalgebra::Vector2<f64>;
