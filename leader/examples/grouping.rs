//! Measures the exact grouping of 1000 drones over four routes, with and without its tie-break:
//! `cargo run --release -p skein-leader --example grouping`.
#![allow(
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "it measures and prints; nothing that flies does"
)]

use skein_leader::split::ArrivalTable;
use std::time::{Duration, Instant};

/// Drones, routes, headway (s).
const SIZE: (usize, usize, f64) = (1000, 4, 3.5);
const TIMES: usize = 5;

/// Arrivals of drones scattered before the routes' gates, s.
fn scattered() -> Vec<Vec<f64>> {
    let row =
        |i: usize| (0..SIZE.1).map(|r| ((i * 7919 + r * 104_729) % 4001) as f64 / 10.0 + 3.0 * r as f64).collect();
    (0..SIZE.0).map(row).collect()
}

/// Arrivals of drones in a block 40 abreast, 35 m apart, at 10 m/s, on routes 300 m apart, s.
fn block() -> Vec<Vec<f64>> {
    let place = |i: usize| ((i / 40) as f64 * 35.0 + 200.0, (i % 40) as f64 * 35.0 - 682.5);
    let gate = |r: usize| r as f64 * 300.0 - 450.0;
    (0..SIZE.0).map(place).map(|(x, y)| (0..SIZE.1).map(|r| x.hypot(y - gate(r)) / 10.0).collect()).collect()
}

fn median(work: impl Fn() -> f64) -> (Duration, f64) {
    let mut runs: Vec<(Duration, f64)> = (0..TIMES)
        .map(|_| {
            let started = Instant::now();
            let result = work();
            (started.elapsed(), result)
        })
        .collect();
    runs.sort_by_key(|run| run.0);
    runs[TIMES / 2]
}

fn main() {
    for (name, rows) in [("scattered", scattered()), ("block", block())] {
        let table = ArrivalTable::new(&rows, &[SIZE.2; SIZE.1]).unwrap();
        let (quick, least_s) = median(|| table.least_makespan_s());
        let (whole, split_s) = median(|| table.split().makespan_s);
        assert_eq!(least_s, split_s, "the tie-break keeps the makespan");
        println!(
            "{name}: {} drones, {} routes, T = {least_s:.1} s: {quick:.1?} without the tie-break, {whole:.1?} with it",
            SIZE.0, SIZE.1
        );
    }
}
