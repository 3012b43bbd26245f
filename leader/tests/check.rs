//! Properties that must hold in every course of a short mission, checked on the machine that flies: see `model/mod.rs`.
#![allow(clippy::unwrap_used, clippy::disallowed_macros, reason = "helpers of tests, which print what they found")]

mod model;
mod swarm;

use model::{Faults, Mission};
use stateright::{Checker, Model};

/// Explores all courses. All properties must hold. The number of different states is asserted, so that no part of the state
/// space gets lost unnoticed.
fn explore(drones: u32, walls: u32, steps: u32, faults: Faults, states: usize) {
    let checker = Mission { drones, walls, steps, faults }.checker().threads(2).spawn_dfs().join();
    println!("{drones} drones, {walls} walls, {steps} steps, {faults:?}: {} states", checker.unique_state_count());
    checker.assert_properties();
    assert_eq!(checker.unique_state_count(), states);
}

#[test]
fn the_properties_hold_without_faults() {
    explore(3, 2, 16, Faults::default(), 17);
    explore(5, 2, 18, Faults::default(), 19);
}

#[test]
fn the_properties_hold_if_a_message_is_lost_late_or_doubled() {
    explore(3, 2, 16, Faults { messages: 1, ..Faults::default() }, 2591);
}

#[test]
fn the_properties_hold_if_a_drone_dies_and_is_restarted() {
    explore(3, 2, 16, Faults { crashes: 1, ..Faults::default() }, 3329);
    explore(4, 2, 17, Faults { crashes: 1, ..Faults::default() }, 5186);
    explore(5, 2, 18, Faults { crashes: 1, ..Faults::default() }, 7519);
}

#[test]
fn the_properties_hold_if_the_swarm_is_partitioned_and_healed() {
    explore(3, 2, 16, Faults { cuts: 1, ..Faults::default() }, 2437);
    explore(4, 2, 17, Faults { cuts: 1, ..Faults::default() }, 6707);
    explore(5, 2, 18, Faults { cuts: 1, ..Faults::default() }, 16_883);
}
