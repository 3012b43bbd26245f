//! One command flies the paper's missions. It meets the published numbers, and every way to fly a mission gives the same digest.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use support::{Place, assert_near, number};

const PAPER: [&str; 2] = ["--strategy", "congestion-aware-paper"];
const SHORTEST: [&str; 2] = ["--strategy", "shortest-path"];
/// Greatest relative deviation from the published times and energies.
const TIME: f64 = 0.05;
const ENERGY: f64 = 0.04;
/// Greatest deviation of a forecast, s.
const FORECAST_S: f64 = 0.15;
/// Greatest relative difference between a flight and its mirror image.
const MIRROR: f64 = 0.005;

/// The published numbers of a geometry with the obstacle on the right: centred, the paper's rule, shortest path.
struct Geometry {
    name: &'static str,
    pass_s: [f64; 3],
    forecast_s: [f64; 3],
    energy_j: [f64; 2],
    ratio: f64,
    separation_m: f64,
}

const GEOMETRIES: [Geometry; 3] = [
    Geometry {
        name: "s1",
        pass_s: [28.6, 30.45, 38.25],
        forecast_s: [27.57, 30.10, 37.36],
        energy_j: [54_120.0, 62_170.0],
        ratio: 1.15,
        separation_m: 33.0,
    },
    Geometry {
        name: "s2",
        pass_s: [28.65, 30.55, 39.35],
        forecast_s: [27.36, 29.95, 38.08],
        energy_j: [54_080.0, 62_050.0],
        ratio: 1.15,
        separation_m: 37.0,
    },
    Geometry {
        name: "s3b",
        pass_s: [28.65, 29.55, 36.6],
        forecast_s: [27.60, 28.93, 34.68],
        energy_j: [55_910.0, 63_080.0],
        ratio: 1.125,
        separation_m: 35.0,
    },
];

/// Flies inline and without a record, which is fast.
fn inline(name: &str, args: &[&str]) -> Value {
    Place::new().fly(name, &[&["--runtime", "inline", "--no-record"], args].concat())
}

fn pass_s(summary: &Value) -> f64 {
    number(summary, "/stages/0/pass_time_s")
}

fn energy_j(summary: &Value) -> f64 {
    number(summary, "/energy_j/total")
}

fn split(summary: &Value) -> &Value {
    &summary["stages"][0]["split_left_right"]
}

fn digest(summary: &Value) -> &str {
    let digest = summary["digest"].as_str().unwrap();
    assert!(digest.len() >= 16 && digest.bytes().all(|byte| byte.is_ascii_hexdigit()), "{digest}");
    digest
}

fn assert_safe(summary: &Value, separation_m: f64) {
    assert_eq!(summary["violations"], json!([]), "{summary}");
    assert!(number(summary, "/min_separation_m") >= separation_m, "{summary}");
    assert!(number(summary, "/min_clearance_m") >= 15.0, "{summary}");
}

#[test]
fn ten_processes_fly_s2_as_published() {
    let place = Place::new();
    let done = place.take_off("s2-right", &PAPER).finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    let summary = done.summary();
    assert_eq!(summary["outcome"], "reached");
    assert_eq!(summary["runtime"], "processes");
    assert_eq!(summary["strategy"], "congestion-aware-paper");
    assert_eq!(split(&summary), &json!([6, 2]));
    assert_eq!(summary["stages"][0]["split"], json!([2, 6]), "the rightmost route first");
    assert_near("pass time", pass_s(&summary), 30.55, TIME);
    assert_near("energy", energy_j(&summary), 54_080.0, ENERGY);
    assert_safe(&summary, 37.0);
    assert!(number(&summary, "/formation_error_m") <= 0.8);
    assert_eq!(summary["drones"], 8);
    let mut told = support::json(place.join("out/summary.json"));
    // The summary is printed before the report is written.
    assert!(told["report_s"].take().is_number());
    assert_eq!(told, summary, "stdout tells what the file tells");
}

#[test]
fn centred_obstacles_split_the_swarm_in_halves() {
    for geometry in &GEOMETRIES {
        let summary = inline(&format!("{}-centred", geometry.name), &PAPER);
        assert_eq!(split(&summary), &json!([4, 4]), "{}", geometry.name);
        assert_near(geometry.name, pass_s(&summary), geometry.pass_s[0], TIME);
        assert_forecast(&summary, geometry.forecast_s[0]);
        assert_safe(&summary, geometry.separation_m);
    }
}

#[test]
fn six_drones_pass_a_shifted_obstacle_on_its_short_side() {
    for geometry in &GEOMETRIES {
        let (right, left) = both_sides(geometry, &PAPER, [6, 2], 1);
        assert_near("energy", energy_j(&right), geometry.energy_j[0], ENERGY);
        assert_near("mirrored time", pass_s(&left), pass_s(&right), MIRROR);
        assert_near("mirrored energy", energy_j(&left), energy_j(&right), MIRROR);
    }
}

#[test]
fn the_shortest_path_costs_more_time_and_energy() {
    for geometry in &GEOMETRIES {
        let (right, left) = both_sides(geometry, &SHORTEST, [8, 0], 2);
        for (side, shortest) in [("right", right), ("left", left)] {
            assert_near("energy", energy_j(&shortest), geometry.energy_j[1], ENERGY);
            let ratio = energy_j(&shortest) / energy_j(&inline(&format!("{}-{side}", geometry.name), &PAPER));
            assert!((ratio - geometry.ratio).abs() <= 0.03, "{}-{side}: ratio {ratio}", geometry.name);
        }
    }
}

/// Flies a geometry with its obstacle on either side. Both flights must split and pass as published.
fn both_sides(geometry: &Geometry, strategy: &[&str], wanted: [u32; 2], row: usize) -> (Value, Value) {
    let fly = |side: &str, wanted: [u32; 2]| {
        let name = format!("{}-{side}", geometry.name);
        let summary = inline(&name, strategy);
        assert_eq!(split(&summary), &json!(wanted), "{name}");
        assert_near(&name, pass_s(&summary), geometry.pass_s[row], TIME);
        assert_forecast(&summary, geometry.forecast_s[row]);
        assert_safe(&summary, geometry.separation_m);
        summary
    };
    (fly("right", wanted), fly("left", [wanted[1], wanted[0]]))
}

fn assert_forecast(summary: &Value, wanted_s: f64) {
    let found_s = number(summary, "/stages/0/predicted_s");
    assert!((found_s - wanted_s).abs() <= FORECAST_S, "forecast {found_s} s, wanted {wanted_s} s: {summary}");
}

#[test]
fn fixed_splits_are_flown_and_the_rule_takes_the_best_of_them() {
    let times = ["4/4", "6/2", "8/0"].map(|told| {
        let summary = inline("s2-right", &["--strategy", &format!("fixed:{told}")]);
        let flown: Vec<u64> = split(&summary).as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
        assert_eq!(format!("{}/{}", flown[0], flown[1]), told);
        pass_s(&summary)
    });
    assert!(times[1] < times[0] && times[1] < times[2], "{times:?}");
}

/// Flies in processes and inline; the digests must be equal.
fn assert_same_digest(name: &str, args: &[&str], process_args: &[&str]) -> String {
    let place = Place::new();
    let done = place.take_off(name, &[args, process_args].concat()).finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    let (processes, inline) = (done.summary(), inline(name, args));
    assert_eq!(digest(&processes), digest(&inline), "{name} {args:?} {process_args:?}");
    assert_eq!(processes["ticks"], inline["ticks"]);
    assert_eq!(processes["energy_j"], inline["energy_j"]);
    assert_eq!(processes["messages"]["delivered"], inline["messages"]["delivered"]);
    digest(&processes).to_owned()
}

#[test]
fn processes_and_inline_give_the_same_digest() {
    for (name, seed) in [("s1-right", "1"), ("s2-left", "2"), ("s3b-centred", "3")] {
        assert_same_digest(name, &["--seed", seed], &[]);
    }
    assert_same_digest("s2-right", &SHORTEST, &[]);
}

#[test]
fn the_digest_does_not_depend_on_the_number_of_threads() {
    // Nine drones are more than a thread takes at a time.
    let with = |threads| ["--set", "formation.drones=9", "--set", "radio.loss=0.2", "--threads", threads];
    let one = inline("s2-right", &with("1"));
    for threads in ["2", "3", "16"] {
        let several = inline("s2-right", &with(threads));
        assert_eq!(digest(&several), digest(&one), "{threads} threads");
        assert_eq!(several["messages"], one["messages"], "{threads} threads");
    }
    let refused = Place::new().run(&["run", &support::paper("s2-right"), "--threads", "2"]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
}

#[test]
fn both_runtimes_give_the_same_digest_with_delay_and_loss() {
    let rough = ["--set", "radio.delay_s=0.1", "--set", "radio.loss=0.2", "--seed"];
    let with = |seed| [&rough[..], &[seed]].concat();
    let digests = ["1", "2", "3"].map(|seed| assert_same_digest("s2-right", &with(seed), &[]));
    assert!(digests[0] != digests[1] && digests[1] != digests[2] && digests[0] != digests[2], "{digests:?}");
    assert_eq!(digest(&inline("s2-right", &with("1"))), digests[0], "the same seed, the same flight");
    assert_ne!(digest(&inline("s2-right", &["--seed", "1"])), digests[0], "without delay and loss");
    let summary = inline("s2-right", &with("1"));
    let (lost, delivered) = (number(&summary, "/messages/dropped/loss"), number(&summary, "/messages/delivered"));
    let share = lost / (lost + delivered);
    assert!((share - 0.2).abs() < 0.01, "{share} of all messages were lost");
    assert!(number(&summary, "/messages/delay_s/p50") >= 0.1);
}

#[test]
fn waiting_and_pinning_do_not_change_the_digest() {
    let ways: [&[&str]; 3] = [&["--wait", "yield"], &["--pin", "off"], &["--wait", "yield", "--pin", "off"]];
    for way in ways {
        assert_same_digest("s1-centred", &[], way);
    }
}

#[test]
fn ten_flights_on_busy_cores_give_one_digest() {
    let busy = AtomicBool::new(true);
    let wanted = digest(&inline("s2-right", &[])).to_owned();
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().unwrap().get() {
            scope.spawn(|| {
                while busy.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let fly = || {
            let done = Place::new().take_off("s2-right", &[]).finish();
            (done.code == Some(0)).then(|| digest(&done.summary()).to_owned())
        };
        // The threads must end before an assertion fails. Otherwise the failing test would wait for them for ever.
        let found: Vec<_> = (0..10).map(|_| std::panic::catch_unwind(fly)).collect();
        busy.store(false, Ordering::Relaxed);
        for digest in found {
            assert_eq!(digest.unwrap().as_ref(), Some(&wanted));
        }
    });
}
