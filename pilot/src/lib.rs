//! The interface of a pilot: senses and messages in, a command and messages out.
//!
//! A [`Pilot`] is the software that flies one drone. The runtime makes it from a [`Birth`], and calls [`Pilot::step`] once per
//! tick with the [`Senses`] and the [`Inbox`]. The pilot says what it has to say through [`Out`], and returns a [`Command`].
//!
//! The crate is pure. A pilot that is to fly deterministically has no clock, thread or random generator of the operating
//! system either: time is [`Senses::now`], and randomness comes from [`Birth::seed`].
//!
//! # Example
//!
//! A pilot that brakes until it is at rest:
//!
//! ```
//! use skein_pilot::{Command, Inbox, Out, Pilot, Senses};
//! use skein_protocol::SimTime;
//!
//! struct Brake;
//!
//! impl Pilot for Brake {
//!     fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, _: &mut Out) -> Command {
//!         Command::acceleration(senses.velocity_mps.map(|v| -v))
//!     }
//! }
//!
//! let (position_m, velocity_mps) = ([0.0, 0.0, 50.0], [2.0, 0.0, 0.0]);
//! let senses = Senses::new((0, SimTime(0)), (position_m, velocity_mps), &[], &[], &[]);
//! let command = Brake.step(&senses, &Inbox::default(), &mut Out::default());
//! assert_eq!(command, Command::acceleration([-2.0, -0.0, -0.0]));
//! ```

mod birth;
mod command;
mod heard;
mod inbox;
mod note;
mod out;
mod params;
mod pilot;
mod pilot_error;
mod status;

pub use birth::Birth;
pub use command::{Command, Motion};
pub use heard::Heard;
pub use inbox::Inbox;
pub use note::Note;
pub use out::Out;
pub use params::Params;
pub use pilot::Pilot;
pub use pilot_error::PilotError;
pub use skein_protocol::downlink::{SensedNeighbour, SensedObstacle, Senses};
pub use status::Status;
