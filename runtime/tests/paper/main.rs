//! The paper section by section, a module each, in flights by the inline runtime. Each test names the rows of the paper
//! that it shows: A1 to A5 are its algorithms, E1 to E7 its equations, C1 the cost, Q1 the queue, G1 the subgroups, P1
//! the power model, K1 the kinematics. Its results, R1 to R6, are shown by `tests/reproduce.rs`.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod avoidance;
mod detection;
mod energy;
mod flown;
mod grouping;
mod queue;
mod reformation;
