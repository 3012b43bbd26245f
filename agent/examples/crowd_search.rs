//! Searches for a crowd that violates a distance although all its drones follow the safety rule of `docs/safety.md`:
//! `cargo run --release -p skein-agent --example crowd_search -- DRONE_TICKS`. The default of `DRONE_TICKS` is three million.
//!
//! The command fails if a distance is violated, or if crowds that do not allow for their errors violate none.
#![allow(clippy::disallowed_macros, reason = "this command prints its results")]

#[path = "../tests/crowd/mod.rs"]
mod crowd;

use crowd::errors::Errors;
use crowd::words::{Adversary, fly_by_words, fly_with_errors};
use crowd::{Crowd, Flown, Keyed, WISHES, fly};
use std::process::ExitCode;

/// Flies random crowds until `drone_ticks` drone-ticks are reached, and prints what came of it. `crowd`: flies the crowd of a seed.
/// Returns the number of crowds that violated a distance.
fn search(name: &str, first_seed: u64, drone_ticks: usize, crowd: impl Fn(u64) -> Flown) -> usize {
    let (mut flown, mut least_m, mut crowds, mut broken, mut sum_m) = (0, f64::INFINITY, 0, 0, 0.0);
    while flown < drone_ticks {
        crowds += 1;
        let result = crowd(first_seed + crowds);
        broken += usize::from(result.least_m < -1e-6);
        (flown, least_m, sum_m) = (flown + result.drone_ticks, least_m.min(result.least_m), sum_m + result.mean_m);
    }
    println!(
        "{name}: {flown} drone-ticks in {crowds} crowds, {broken} broken, at least {least_m:.4} m beyond the distance to keep; \
         {:.0} m flown",
        sum_m / crowds as f64
    );
    broken
}

/// Crowds whose drones sense each other. `lag`: delay of commands, ticks. In half of them, processes stop for a while.
fn sighted(lag: u32, drone_ticks: usize) -> usize {
    search(&format!("{lag:2} ticks late"), 1_000_000 * u64::from(lag), drone_ticks, |seed| {
        let mut random = Keyed(seed);
        let drones = 2 + (random.unit() * random.unit() * 198.0) as usize;
        let (density, wish) = (random.within(0.7, 4.0), WISHES[(seed % 5) as usize]);
        let freezes = random.within(-0.1, 0.1).max(0.0);
        fly(seed, (drones, density), 400, (wish, lag), freezes)
    })
}

/// Crowds that sense no neighbours, over a radio that delays, loses and doubles messages.
fn by_words(lag: u32, drone_ticks: usize) -> usize {
    let first_seed = 1_000_000 * u64::from(lag + 100);
    search(&format!("by word alone, {lag:2} ticks late"), first_seed, drone_ticks, |seed| {
        let mut random = Keyed(seed);
        let drones = 2 + (random.unit() * random.unit() * 48.0) as usize;
        let (density, wish) = (random.within(0.7, 4.0), WISHES[(seed % 5) as usize]);
        let adversary = Adversary::random(&mut random);
        fly_by_words(seed, (drones, density), 1000, (wish, lag), adversary)
    })
}

/// The same with wrong positions, clocks and outlines, for which the drones allow or not.
fn with_errors(allowed: bool, drone_ticks: usize) -> usize {
    let name = format!("by words with errors, {}", if allowed { "with margins" } else { "without margins" });
    search(&name, 200_000_000, drone_ticks, |seed| {
        let mut random = Keyed(seed);
        let drones = 2 + (random.unit() * random.unit() * 48.0) as usize;
        let (density, wish) = (random.within(0.7, 4.0), WISHES[(seed % 5) as usize]);
        let adversary = Adversary::random(&mut random);
        let errors = |crowd: &Crowd| {
            let errors = Errors::random(crowd, seed);
            if allowed { errors } else { errors.unallowed() }
        };
        let lag = if seed % 2 == 0 { 0 } else { 10 };
        fly_with_errors(seed, (drones, density), 1000, (wish, lag), adversary, errors)
    })
}

fn main() -> ExitCode {
    let drone_ticks = std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(3_000_000);
    let late = [1, 2, 5, 10, 20].into_iter().map(|lag| sighted(lag, drone_ticks / 3));
    let sighted = sighted(0, drone_ticks) + late.sum::<usize>();
    let by_words: usize = [0, 10].into_iter().map(|lag| by_words(lag, drone_ticks / 6)).sum();
    let with_errors = with_errors(true, drone_ticks / 6) + usize::from(with_errors(false, drone_ticks / 12) == 0);
    ExitCode::from(u8::from(sighted + by_words + with_errors > 0))
}
