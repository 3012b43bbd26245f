//! Leaders die, hang, are cut off and come back, in real processes. The survivors elect a leader, the mission ends in
//! formation, and both runtimes give the same digest.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use support::Place;

/// One case: the faults, the scenario, and the drone that leads the swarm in the end, if the case says so.
struct Case {
    name: &'static str,
    scenario: &'static str,
    faults: &'static str,
    elections: usize,
    /// What a dead drone does. One that hovers in a gap closes it for good.
    failsafe: &'static str,
}

const CASES: [Case; 9] = [
    Case {
        name: "kill-leader",
        scenario: "s2-right",
        faults: "{kind='kill', at_s=3, target='leader'}",
        elections: 2,
        failsafe: "hover",
    },
    Case {
        name: "kill-while-deciding",
        scenario: "s2-right",
        faults: "{kind='kill', on='detected', target='leader'}",
        elections: 2,
        failsafe: "hover",
    },
    Case {
        name: "kill-leader-and-successor",
        scenario: "s2-right",
        faults: "{kind='kill', at_s=3, target='leader'}, {kind='kill', at_s=4.6, target='leader'}",
        elections: 3,
        failsafe: "hover",
    },
    Case {
        name: "freeze-and-wake",
        scenario: "s2-right",
        faults: "{kind='freeze', at_s=3, target='leader', for_s=5}",
        elections: 2,
        failsafe: "hover",
    },
    Case {
        name: "partition-and-heal",
        scenario: "s2-right",
        faults: "{kind='partition', at_s=2, sides=[[0, 1, 2, 3], [4, 5, 6, 7]], for_s=3}",
        elections: 2,
        failsafe: "hover",
    },
    Case {
        name: "restart",
        scenario: "s2-right",
        faults: "{kind='restart', at_s=2, target='leader', for_s=1}",
        elections: 2,
        failsafe: "hover",
    },
    Case {
        name: "blind-leader",
        scenario: "s2-right",
        faults: "{kind='blind', at_s=2, target='leader', for_s=6}",
        elections: 2,
        failsafe: "hover",
    },
    Case {
        name: "kill-group-leader-in-the-gap",
        scenario: "forest",
        faults: "{kind='kill', at_s=74, target='group-leader:N12'}",
        elections: 4,
        failsafe: "land",
    },
    Case {
        name: "leader-while-splitting-one-in-the-queue-and-back",
        scenario: "s2-right",
        faults: "{kind='restart', on='grouped', target='leader', for_s=8}, {kind='kill', on='queued', after_s=2, drone=5}",
        elections: 2,
        failsafe: "hover",
    },
];

fn args(case: &Case, runtime: &str, clock: &str, out: &str) -> Vec<String> {
    let faults = format!("fault=[{}]", case.faults.replace('\'', "\""));
    let failsafe = format!("faults.failsafe=\"{}\"", case.failsafe);
    let scenario = support::paper(case.scenario);
    let words = ["run", &scenario, "--json", "--no-record", "--strategy", "congestion-aware-paper", "--out", out];
    // Two dead drones that hover right before the swarm make the mission long.
    let time = "time.timeout_s=300";
    let rest = ["--clock", clock, "--runtime", runtime, "--set", &faults, "--set", &failsafe, "--set", time];
    words.into_iter().chain(rest).map(str::to_owned).collect()
}

fn fly(place: &Place, case: &Case, runtime: &str, clock: &str) -> Value {
    let args = args(case, runtime, clock, &format!("{}-{runtime}", case.name));
    let done = place.run(&args.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(done.code, Some(0), "{done:?}");
    done.summary()
}

/// The swarm has one leader in the end and was led again in time. Exit code 0 says that it reached the goal safely.
fn assert_led(case: &Case, summary: &Value) {
    let elections = summary["elections"].as_u64().unwrap() as usize;
    assert!(elections >= case.elections, "{}: {elections} elections", case.name);
    assert_eq!(summary["leaders"].as_array().unwrap().last().unwrap()["group"], "N", "{}", case.name);
    assert!(summary["formation_error_m"].as_f64().unwrap() <= 0.8, "{}", case.name);
    let fires = summary["faults"].as_array().unwrap().iter().filter(|fault| fault["scheduled"] == true).count();
    assert_eq!(fires, case.faults.matches("kind=").count(), "{}: {}", case.name, summary["faults"]);
}

/// A leader with a broken sensor hands over at once, and no drone has died.
fn assert_handed_over(summary: &Value) {
    let leaders = summary["leaders"].as_array().unwrap();
    let (blind, heir) = (&leaders[0], &leaders[1]);
    assert!(heir["group"] == "N" && heir["leader"] != blind["leader"], "{leaders:?}");
    assert!((2.0..2.3).contains(&heir["t_s"].as_f64().unwrap()), "{leaders:?}");
    assert_eq!(summary["failover_s"].as_array().unwrap().len(), 0);
    let while_blind = |leader: &&Value| leader["leader"] == blind["leader"] && leader["t_s"].as_f64() < Some(8.0);
    assert_eq!(leaders[1..].iter().filter(while_blind).count(), 0, "{leaders:?}");
}

#[test]
fn every_case_ends_in_formation_with_one_digest() {
    let place = Place::new();
    for case in &CASES {
        let inline = fly(&place, case, "inline", "lockstep");
        assert_led(case, &inline);
        if case.name == "blind-leader" {
            assert_handed_over(&inline);
        }
        let processes = fly(&place, case, "processes", "lockstep");
        assert_eq!(inline["digest"], processes["digest"], "{}", case.name);
        assert_eq!(processes["split_brain_s"], inline["split_brain_s"], "{}", case.name);
    }
}

#[test]
fn every_case_ends_in_formation_by_the_wall_clock() {
    let place = Place::new();
    CASES.iter().for_each(|case| by_the_wall_clock(&place, case));
}

/// On a machine that is too busy to keep time, the flight is another one. It is tried again a few times, then skipped.
fn by_the_wall_clock(place: &Place, case: &Case) {
    for attempt in 0..3 {
        let out = format!("{}-wall-{attempt}", case.name);
        let done =
            place.run(&args(case, "processes", "realtime:20", &out).iter().map(String::as_str).collect::<Vec<_>>());
        let summary = done.summary();
        if done.code == Some(0) {
            return assert_led(case, &summary);
        }
        assert_ne!(summary["deadline_misses"], 0, "{} kept time and failed: {done:?}", case.name);
    }
    eprintln!("{}: this machine is too busy for the wall clock, nothing is compared", case.name);
}
