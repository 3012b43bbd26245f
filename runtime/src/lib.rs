//! How pilots and world are run: each a process of its own, or inline in one thread; in lockstep or by the wall clock.
//!
//! | module | what |
//! |---|---|
//! | [`mission`] | from a scenario to world, pilots and radios |
//! | [`pilot_host`] | what both runtimes put around a pilot: radio, queue, tally |
//! | [`beacon`] | the trivial pilot, to measure the runtime with |
//! | [`inline`] | all in one thread |
//! | [`supervisor`] | starts a process for the world and one for each drone, and looks after them |
//! | [`world_process`], [`drone_process`] | what those processes do |
//! | [`clock`] | lockstep and wall clock |

pub mod beacon;
mod children;
pub mod clock;
pub mod drone_process;
mod error;
pub mod inline;
pub mod mission;
pub mod pilot_host;
mod plan;
mod radio_receiver;
pub mod run_facts;
pub mod supervisor;
pub mod world_process;

pub use children::lighten;
pub use clock::Clock;
pub use error::RuntimeError;
pub use mission::PilotKind;

/// How a run ended, beside what its record tells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunEnd {
    /// From the call to the first tick opened, s of wall time.
    pub startup_s: f64,
    /// System calls of the barrier: the world's, and those of all drones.
    pub calls: [u64; 2],
    /// The signal that interrupted it.
    pub signal: Option<i32>,
    /// Why the recording stopped early.
    pub sink_error: Option<String>,
    /// What of the environment failed while it flew: the world's death, a service that broke.
    pub failure: Option<String>,
}
