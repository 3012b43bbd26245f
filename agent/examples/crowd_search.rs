//! Searches for a crowd that violates a distance although all its drones follow the safety rule of `docs/safety.md`:
//! `cargo run --release -p skein-agent --example crowd_search -- DRONE_TICKS`. The default of `DRONE_TICKS` is three million.
//!
//! The command fails if a distance is violated in a crowd whose commands take effect at once. Late commands are outside the
//! theorem. For them the command only prints the result.
#![allow(clippy::disallowed_macros, reason = "this command prints its results")]

#[path = "../tests/crowd/mod.rs"]
mod crowd;

use crowd::{Keyed, WISHES, fly};
use std::process::ExitCode;

/// Flies random crowds until `drone_ticks` drone-ticks are reached. `lag`: delay of commands, ticks. Returns the number of
/// crowds that violated a distance.
fn search(lag: u32, drone_ticks: usize) -> usize {
    let (mut flown, mut least, mut crowds, mut broken) = (0, f64::INFINITY, 0, 0);
    while flown < drone_ticks {
        crowds += 1;
        let seed = crowds + 1_000_000 * u64::from(lag);
        let mut random = Keyed(seed);
        let drones = 2 + (random.unit() * random.unit() * 198.0) as usize;
        let (density, wish) = (random.within(0.7, 4.0), WISHES[(seed % 5) as usize]);
        let (least_m, ticks) = fly(seed, drones, density, 400, wish, lag);
        broken += usize::from(least_m < -1e-6);
        (flown, least) = (flown + ticks, least.min(least_m));
    }
    println!(
        "{lag:2} ticks late: {flown} drone-ticks in {crowds} crowds, {broken} broken, \
         at least {least:.4} m beyond the distance to keep"
    );
    broken
}

fn main() -> ExitCode {
    let drone_ticks = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(3_000_000);
    let broken = search(0, drone_ticks);
    for lag in [1, 2, 5, 10] {
        search(lag, drone_ticks / 3);
    }
    ExitCode::from(u8::from(broken > 0))
}
