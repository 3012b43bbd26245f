//! The truth of a mission: bodies, obstacles, what drones sense, energy, invariants and the end, one step at a time.
//!
//! Pure: no clock, thread, process or operating-system randomness. The same calls give the same bits.
//! World frame: x along the flight, y to its left, metres.
//!
//! | module | what |
//! |---|---|
//! | [`params`] | what a mission is made of |
//! | [`world`] | one tick: senses down, answers up, advance, record |
//! | `body`, `geometry`, `grid`, `senses` | kinematics; distances; who is near whom and what |
//! | `process` | a drone's process, as far as the world sees it |
//! | `invariants`, `stages`, `finish` | what must hold; obstacle sets on the way; when the mission is over |
//! | [`faults`] | what a scenario makes go wrong: the plan, and what of it is due and in force |
//! | `decisions`, `totals`, `log` | what leaders said, what was counted, both told as events |

mod body;
mod decisions;
pub mod faults;
mod finish;
mod geometry;
mod grid;
mod invariants;
mod log;
pub mod params;
mod process;
mod senses;
mod stages;
#[cfg(test)]
mod testing;
mod totals;
pub mod world;

pub use params::{End, Failsafe, WorldError, WorldParams};
pub use world::World;
