//! Scheduled faults: every kind gives one digest in both runtimes, and process faults are carried out on real processes.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::{Value, json};
use support::process::{Role, is_alive, pid_of, read, state};
use support::{Flight, Place, eventually, faults};

/// Every kind of fault in a short flight that ends by time-out: the value of `--set fault.0=…`, and what the summary must say.
const KINDS: [(&str, &str, Option<u64>); 13] = [
    ("kind=\"kill\", on=\"detected\", target=\"leader\"", "kill", Some(0)),
    ("kind=\"freeze\", at_s=3, drone=4, for_s=2", "freeze", Some(4)),
    ("kind=\"restart\", on=\"queued\", target=\"member\", for_s=1.5", "restart", Some(1)),
    ("kind=\"slow\", at_s=1, drone=2, reaction_time_s=0.3, for_s=5", "slow", Some(2)),
    ("kind=\"deaf\", on=\"leader-elected\", after_s=1, target=\"random\", for_s=3", "deaf", None),
    ("kind=\"mute\", at_s=2, target=\"leader\", for_s=4", "mute", Some(0)),
    ("kind=\"partition\", at_s=2, sides=[[0, 1, 2], [3, 4, 5, 6]], for_s=4", "partition", None),
    ("kind=\"blind\", at_s=2, drone=0, for_s=4", "blind", Some(0)),
    ("kind=\"noise\", at_s=1, drone=3, position_std_m=0.2, velocity_bias_mps=[0.1, 0]", "noise", Some(3)),
    (
        "kind=\"ranging\", at_s=1, drone=2, ranging_dropout_share=0.4, ranging_std_m=1, ranging_latency_s=0.5, \
         ranging_field_rad=3, ranging_occlusion=true, for_s=6",
        "ranging",
        Some(2),
    ),
    (
        "kind=\"gnss\", at_s=1, drone=5, position_bias_m=[0, 0.5], position_drift_mps=[0.02, 0], for_s=6",
        "gnss",
        Some(5),
    ),
    ("kind=\"clock\", at_s=2, target=\"leader\", clock_offset_s=0.4, clock_drift_ppm=-100, for_s=5", "clock", Some(0)),
    ("kind=\"wind\", at_s=1, wind_mps2=[0, 0.3], gust_mps2=0.4, for_s=6", "wind", None),
];

/// The summary of eleven seconds of S2 with one fault.
fn short(place: &Place, fault: &str, runtime: &str, out: &str) -> Value {
    let fault = format!("fault=[{{ {fault} }}]");
    let done = place.run(&[
        "run",
        &support::paper("s2-right"),
        "--json",
        "--runtime",
        runtime,
        "--out",
        out,
        "--set",
        &fault,
        "--set",
        "time.timeout_s=11",
    ]);
    assert_eq!(done.code, Some(1), "it ends by its time: {done:?}");
    assert_eq!(place.runs_in_domain(), Vec::<String>::new(), "{done:?}");
    done.summary()
}

#[test]
fn every_kind_gives_one_digest_in_both_runtimes() {
    let place = Place::new();
    let undisturbed = short(&place, "kind=\"kill\", at_s=100, drone=0", "inline", "none")["digest"].clone();
    for (fault, kind, target) in KINDS {
        let (inline, out) = (short(&place, fault, "inline", &format!("{kind}-inline")), format!("{kind}-processes"));
        let processes = short(&place, fault, "processes", &out);
        assert_eq!(inline["digest"], processes["digest"], "{fault}");
        assert_ne!(inline["digest"], undisturbed, "{fault} has no effect");
        for told in [&inline["faults"], &processes["faults"]] {
            assert_eq!(told.as_array().unwrap().len(), 1, "{told}");
            assert_eq!((&told[0]["kind"], &told[0]["scheduled"]), (&json!(kind), &json!(true)));
            assert!(kind == "deaf" || told[0]["target"] == json!(target), "{told}");
        }
        assert_eq!(inline["faults"], processes["faults"]);
        assert_eq!(faults(&place.join(&out)).len(), 1);
    }
}

#[test]
fn refused_frames_are_counted_by_reason() {
    let place = Place::new();
    let dropped = |fault: &str, out: &str| short(&place, fault, "inline", out)["messages"]["dropped"].clone();
    let wall = dropped(KINDS[6].0, "wall");
    assert!(wall["partition"].as_u64().unwrap() > 100 && wall["deaf"] == 0, "{wall}");
    for (number, out) in [(4, "deaf"), (5, "mute")] {
        let cut = dropped(KINDS[number].0, out);
        assert!(cut["deaf"].as_u64().unwrap() > 50 && cut["partition"] == 0, "{out}: {cut}");
    }
}

/// Lockstep with short ticks, so that there is time to look at the processes.
fn take_off(place: &Place, fault: &str) -> (Flight, Vec<Role>) {
    let set = format!("fault=[{{ {fault} }}]");
    let args = ["--set", "time.dt_s=0.0005", "--set", "time.timeout_s=8", "--set", &set];
    let mut flight = place.take_off("s2-right", &args);
    let processes = flight.processes();
    (flight, processes)
}

#[test]
fn a_killed_process_has_ended_and_the_others_fly_on() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, "kind=\"kill\", at_s=1, drone=5");
    let pid = pid_of(&processes, "drone", Some(5));
    assert!(is_alive(pid));
    flight.wait_until(1.2);
    assert!(!is_alive(pid));
    assert!(is_alive(pid_of(&processes, "drone", Some(4))));
    assert_eq!(flight.finish().summary()["faults"][0]["t_s"], 1.0);
}

#[test]
fn a_frozen_process_is_stopped_and_continued() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, "kind=\"freeze\", at_s=1, drone=5, for_s=4");
    let pid = pid_of(&processes, "drone", Some(5));
    eventually("it is stopped", || state(pid) == "T");
    flight.wait_until(1.5);
    assert_eq!(state(pid), "T", "the others fly on without it");
    eventually("it is continued", || state(pid) != "T");
    let summary = flight.finish().summary();
    assert_eq!((&summary["faults"][0]["t_s"], &summary["deadline_misses"]), (&json!(1.0), &json!(0)));
}

#[test]
fn a_restarted_drone_has_a_new_process() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, "kind=\"restart\", at_s=1, drone=5, for_s=0.5");
    let first = pid_of(&processes, "drone", Some(5));
    flight.wait_until(1.7);
    let all = read(&place.join("out/processes.json"));
    assert_eq!(all[..processes.len()], processes[..], "the old entries stay");
    let [second] = &all[processes.len()..] else { panic!("{all:?}") };
    assert_eq!((second.role.as_str(), second.id), ("drone", Some(5)));
    assert!(second.pid != first && !is_alive(first) && is_alive(second.pid), "{first}, {second:?}");
    let done = flight.finish();
    assert_eq!(done.summary()["faults"].as_array().unwrap().len(), 1, "{done:?}");
    assert!(!is_alive(second.pid));
}

#[test]
fn all_drones_can_be_restarted_at_once_and_again() {
    let place = Place::new();
    let twice =
        "kind=\"restart\", at_s=1, target=\"all\", for_s=0.5 }, { kind=\"restart\", at_s=3, target=\"all\", for_s=0.1";
    let (inline, processes) = (short(&place, twice, "inline", "a"), short(&place, twice, "processes", "b"));
    assert_eq!(inline["digest"], processes["digest"]);
    assert_eq!(processes["faults"].as_array().unwrap().len(), 16);
    assert_eq!(read(&place.join("b/processes.json")).len(), 10 + 16);
}

#[test]
fn bad_faults_start_nothing() {
    let place = Place::new();
    let set = "fault=[{ kind=\"freeze\", at_s=1, drone=9 }]";
    let done = place.run(&["run", &support::paper("s2-right"), "--set", set]);
    assert_eq!(done.code, Some(2));
    assert!(done.stderr.contains("fault.0.drone: found drone 9") && done.stderr.contains("needs for_s"), "{done:?}");
    place.assert_untouched(&done);
}
