//! The paper's pilot of a drone: senses and messages in, a command and messages out.
//!
//! [`SwarmPilot`] is the paper's [`skein_pilot::Pilot`]. It flies along +x; a [`CoursePilot`] flies it in any of the four directions. It is composed of machines that can be used on their own:
//!
//! - [`detection`] computes stopping distances and the danger zone (paper, equations 1 to 4);
//! - [`route_follower`] follows the routes past obstacles, and [`emergency_route`] finds one that no leader has planned;
//! - [`queue`] keeps a headway on a shared route;
//! - [`guidance`] brings a drone to its slot in the formation;
//! - [`braking_filter`] is the safety rule with a proof (docs/safety.md): a crowd that follows it keeps its distances;
//! - [`navigator`] finds the shortest path round all obstacles that a drone knows;
//! - [`safety`] is the filter that keeps the distances to obstacles and neighbours, whatever the others do;
//! - [`escape`] frees a drone that is stuck;
//! - [`rollout`] simulates alternative plans with any pilot that implements [`rollout::RolloutPilot`].
//!
//! Elections, grouping and planning are not here: they are in `skein-leader`, whose machine `Leading` a [`SwarmPilot`] owns.
//! The crate is pure. It has no clock, thread, file or random generator, and it does not know whether it runs in a process of
//! its own. A pilot knows nothing of other drones but what it senses and hears.
//

mod altitude;
pub mod braking_filter;
mod braking_motion;
pub mod braking_path;
pub mod command_delay;
mod course_pilot;
pub mod detection;
mod detour;
mod distant_peers;
pub mod emergency_route;
pub mod escape;
mod few;
pub mod guidance;
mod lone_flight;
pub mod navigator;
mod neighbour_table;
mod params;
mod peer_clocks;
pub mod program;
pub mod queue;
mod reaction;
mod reunion;
pub mod rollout;
pub mod route_follower;
pub mod safety;
pub mod sensing_errors;
pub mod separation;
mod sights;
mod silent_drones;
mod stale_formation;
mod state_predictor;
mod straggler;
mod swarm_pilot;
#[cfg(test)]
mod test_params;
mod tuning;

pub use course_pilot::CoursePilot;
pub use params::PilotParams;
pub use swarm_pilot::SwarmPilot;
