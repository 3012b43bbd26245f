//! One drone's mind, the pilot. Pure: senses and messages in, a command and messages out.
//!
//! | module | what |
//! |---|---|
//! | [`pilot`] | the trait every pilot implements |
//! | [`swarm_pilot`] | the paper's drone: detect, obey, avoid, queue, re-form |
//! | [`danger`] | detection distances (equations 1–4) |
//! | [`way`], [`queue`], [`guidance`] | past obstacles, in a queue, in formation |
//! | [`escape`] | out of a corner |
//! | `stray` | into the others' formation, though none of them hears this drone |
//! | [`rollout`], [`stage`] | a leader flies its alternatives ahead |
//! | [`safety`], [`program`] | the filter that keeps distances, whoever leads |
//! | [`talk`] | what is said, and when |

pub mod danger;
pub mod escape;
mod foresight;
pub mod guidance;
mod neighbours;
pub mod params;
pub mod pilot;
pub mod program;
pub mod queue;
mod reaction;
pub mod rollout;
pub mod safety;
pub mod stage;
mod stray;
pub mod swarm_pilot;
pub mod way;

pub use params::PilotParams;
pub use pilot::{Command, Heard, Pilot};
pub use swarm_pilot::SwarmPilot;
