//! Explores every course of a short mission, with more faults than a test has time for:
//! `cargo run --release -p skein-leader --example check -- DRONES WALLS STEPS MESSAGES CRASHES CUTS`. Without numbers it
//! explores a built-in list. Prints the number of different states. Fails at the first broken property and prints the
//! course that breaks it.
#![allow(clippy::unwrap_used, clippy::disallowed_macros, reason = "a command that prints")]

#[path = "../tests/model/mod.rs"]
mod model;
#[path = "../tests/swarm/mod.rs"]
mod swarm;

use model::{Faults, Mission};
use stateright::{Checker, Model};

/// Drones, walls, steps, message faults, crashes, cuts.
const LIST: [[u8; 6]; 6] = [
    [3, 1, 11, 1, 1, 0],
    [3, 1, 11, 1, 0, 1],
    [3, 1, 11, 0, 1, 1],
    [4, 2, 17, 1, 0, 0],
    [4, 1, 12, 0, 1, 1],
    [5, 2, 18, 1, 0, 0],
];

fn explore([drones, walls, steps, messages, crashes, cuts]: [u8; 6]) {
    let faults = Faults { messages, crashes, cuts };
    let mission = Mission { drones: drones.into(), walls: walls.into(), steps: steps.into(), faults };
    let checker = mission.checker().threads(2).spawn_dfs().join();
    let states = checker.unique_state_count();
    println!(
        "{drones} drones, {walls} walls, {steps} steps, {messages} messages, {crashes} crashes, {cuts} cuts: {states}"
    );
    checker.assert_properties();
}

fn main() {
    let numbers: Vec<u8> = std::env::args().skip(1).map(|number| number.parse().expect("a small number")).collect();
    match numbers[..] {
        [] => {
            for mission in LIST {
                explore(mission);
            }
        }
        [drones, walls, steps, messages, crashes, cuts] => explore([drones, walls, steps, messages, crashes, cuts]),
        _ => panic!("expected DRONES WALLS STEPS MESSAGES CRASHES CUTS, or nothing"),
    }
}
