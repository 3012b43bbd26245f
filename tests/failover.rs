//! `skein bench failover` kills leaders by both clocks and prints what happened.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use support::{Done, Place};

fn bench(place: &Place, args: &[&str]) -> Done {
    let done = place.run(&[&["bench", "failover", "--json"], args].concat());
    assert_eq!(place.runs_in_domain(), Vec::<String>::new(), "{done:?}");
    done
}

fn rows(done: &Done) -> Vec<Value> {
    assert_eq!(done.code, Some(0), "{done:?}");
    let all = done.summary();
    assert_eq!(all["schema"], "skein-bench-failover/1");
    all["rows"].as_array().unwrap().clone()
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key} in {row}"))
}

/// By either clock: this many leaders were killed, no invariant was broken, and the numbers are consistent.
fn assert_consistent(row: &Value, clock: &str, kills: u64) {
    assert_eq!((&row["clock"], &row["violations"]), (&clock.into(), &0.into()), "{row}");
    assert!(row["kills"].as_u64().unwrap() <= kills && row["replaced"].as_u64() <= row["kills"].as_u64(), "{row}");
    let quantiles: Vec<f64> = ["p50_s", "p90_s", "p99_s", "max_s"].iter().map(|key| number(row, key)).collect();
    assert!(quantiles[0] > 0.03 && quantiles.is_sorted(), "{row}");
    // A leader sends fifty heartbeats per second, every drone ten beacons.
    assert!((12.0..40.0).contains(&number(row, "frames_per_s")), "{row}");
    assert!(number(row, "bytes_per_s") > 50.0 * number(row, "frames_per_s"), "{row}");
}

#[test]
fn lockstep_gives_the_same_figures_each_time() {
    let place = Place::new();
    let args = ["--clock", "lockstep", "--kills", "12", "--loss", "0,0.5", "--delay", "0,0.1"];
    let first = rows(&bench(&place, &[&args[..], &["--out", "failover.json"]].concat()));
    assert_eq!(first, rows(&bench(&place, &args)));
    let written: Value = serde_json::from_slice(&std::fs::read(place.join("failover.json")).unwrap()).unwrap();
    assert_eq!(written["rows"].as_array().unwrap(), &first);
    for (row, (delay_s, loss, p99_s)) in
        first.iter().zip([(0.0, 0.0, 0.1), (0.0, 0.5, 1.0), (0.1, 0.0, 0.6), (0.1, 0.5, 1.5)])
    {
        assert_consistent(row, "lockstep", 12);
        assert_eq!((number(row, "delay_s"), number(row, "loss")), (delay_s, loss));
        assert_eq!(
            (&row["kills"], &row["replaced"], &row["false_elections"]),
            (&12.into(), &12.into(), &0.into()),
            "{row}"
        );
        assert!(number(row, "p99_s") <= p99_s, "{row}");
        assert_eq!((&row["on_time"], &row["on_time_p99_s"]), (&row["kills"], &row["p99_s"]), "{row}");
        assert_eq!(row["digest"].as_str().unwrap().len(), 16);
    }
    let seeded = rows(&bench(&place, &[&args[..], &["--seed", "2"]].concat()));
    assert_ne!(first[1]["digest"], seeded[1]["digest"]);
}

#[test]
fn killed_processes_leave_nothing_behind_by_the_wall_clock() {
    let place = Place::new();
    let rows = rows(&bench(&place, &["--clock", "realtime", "--quick", "--kills", "3", "--loss", "0"]));
    let [row] = &rows[..] else { panic!("{rows:?}") };
    assert_consistent(row, "realtime", 3);
    // On a machine that is too busy to keep time, the flight is another one.
    if row["deadline_misses"] == 0 {
        assert_eq!(
            (&row["kills"], &row["replaced"], &row["false_elections"]),
            (&3.into(), &3.into(), &0.into()),
            "{row}"
        );
    }
}

#[test]
fn impossible_options_start_nothing() {
    let place = Place::new();
    let bad =
        [(&["--kills", "0"][..], "--kills"), (&["--loss", "2"], "radio.loss"), (&["--delay=-1"], "radio.delay_s")];
    for (args, said) in bad {
        let done = place.run(&[&["bench", "failover"], args].concat());
        assert_eq!(done.code, Some(2), "{done:?}");
        assert!(done.stderr.contains(said), "{done:?}");
        place.assert_untouched(&done);
    }
}
