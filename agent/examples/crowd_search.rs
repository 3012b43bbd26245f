//! Searches for a crowd that violates a distance although all its drones follow the safety rule of `docs/safety.md`:
//! `cargo run --release -p skein-agent --example crowd_search -- DRONE_TICKS`. The default of `DRONE_TICKS` is three million.
//!
//! The command fails if a distance is violated in a crowd whose commands take effect at once, or in a crowd that keeps apart by word
//! alone. Late commands of drones that sense their neighbours are outside the theorem. For them the command only prints the result.
#![allow(clippy::disallowed_macros, reason = "this command prints its results")]

#[path = "../tests/crowd/mod.rs"]
mod crowd;

use crowd::words::{Adversary, fly_by_words};
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

/// The same for crowds that sense no neighbours, over a radio that delays, loses and doubles messages.
fn search_by_words(lag: u32, drone_ticks: usize) -> usize {
    let (mut flown, mut least, mut crowds, mut broken, mut sum_m) = (0, f64::INFINITY, 0, 0, 0.0);
    while flown < drone_ticks {
        crowds += 1;
        let seed = crowds + 1_000_000 * u64::from(lag + 100);
        let mut random = Keyed(seed);
        let drones = 2 + (random.unit() * random.unit() * 48.0) as usize;
        let (density, wish) = (random.within(0.7, 4.0), WISHES[(seed % 5) as usize]);
        let adversary = Adversary {
            delay_s: random.within(0.0, 3.0),
            loss: random.within(0.0, 0.8),
            restarts: random.within(-0.2, 0.2),
        };
        let (least_m, ticks, flown_m) = fly_by_words(seed, drones, density, 1000, (wish, lag), adversary);
        broken += usize::from(least_m < -1e-6);
        (flown, least, sum_m) = (flown + ticks, least.min(least_m), sum_m + flown_m);
    }
    println!(
        "by word alone, {lag:2} ticks late: {flown} drone-ticks in {crowds} crowds, {broken} broken, \
         at least {least:.4} m beyond the distance to keep; {:.0} m flown",
        sum_m / crowds as f64
    );
    broken
}

fn main() -> ExitCode {
    let drone_ticks = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(3_000_000);
    let broken = search(0, drone_ticks);
    for lag in [1, 2, 5, 10] {
        search(lag, drone_ticks / 3);
    }
    let by_words: usize = [0, 10].into_iter().map(|lag| search_by_words(lag, drone_ticks / 6)).sum();
    ExitCode::from(u8::from(broken + by_words > 0))
}
