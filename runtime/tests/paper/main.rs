//! Tests that follow the paper, one module per section, in flights by the inline runtime. The name of a test begins with the
//! part of the paper that it shows: A1 to A5 are its algorithms, E1 to E7 its equations, C1 the cost, Q1 the queue, G1 the
//! subgroups, P1 the power model, K1 the kinematics. `tests/reproduce.rs` shows its results, R1 to R6.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod avoidance;
mod detection;
mod energy;
mod flown;
mod grouping;
mod queue;
mod reformation;
