//! Nothing hangs: not if the launcher is stopped, a process dies at a bad moment, or a sweep is killed.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use std::fs;
use std::time::{Duration, Instant};
use support::process::{is_alive, pid_of, signal};
use support::{Place, eventually, json, paper};

/// Drone 4 is killed at 2 s and gets a new process at 3 s.
const RESTART: [&str; 2] = ["--set", "fault=[{ kind=\"restart\", at_s=2, drone=4, for_s=1 }]"];
/// Lockstep with short ticks, so that a flight takes some seconds.
const SLOW: [&str; 2] = ["--set", "time.dt_s=0.001"];

#[test]
fn a_stopped_launcher_delays_the_swarm_and_changes_nothing() {
    let place = Place::new();
    let alone = place.fly("s2-right", &[&SLOW[..], &["--runtime", "inline", "--no-record", "--out", "alone"]].concat());
    let mut flight = place.take_off("s2-right", &SLOW);
    flight.wait_until(0.5);
    signal("STOP", flight.pid());
    // Longer than the world offers a record at a time.
    std::thread::sleep(Duration::from_millis(2500));
    signal("CONT", flight.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_eq!(done.summary()["digest"], alone["digest"]);
}

#[test]
fn a_stopped_world_ends_the_run() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &SLOW);
    let processes = flight.processes();
    flight.wait_until(0.5);
    let stopped = Instant::now();
    signal("STOP", pid_of(&processes, "world", None));
    let done = flight.finish();
    assert!(done.code == Some(3) && done.stderr.contains("stopped"), "{done:?}");
    assert_eq!(json(place.join("out/summary.json"))["outcome"], "aborted");
    assert!(stopped.elapsed() < Duration::from_secs(12), "{:?}", stopped.elapsed());
}

/// Waits for a drone's second process and sends it a signal before it is ready. False if it came too late.
fn catch(launcher: u32, name: &str) -> bool {
    let children = format!("/proc/{launcher}/task/{launcher}/children");
    let since = Instant::now();
    while since.elapsed() < Duration::from_secs(60) {
        let Ok(list) = fs::read_to_string(&children) else { return false };
        for pid in list.split_whitespace().filter_map(|word| word.parse::<u32>().ok()) {
            let words = fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            if words.contains("--incarnation\x002\x00") {
                signal(name, pid);
                return true;
            }
        }
    }
    false
}

#[test]
fn a_drone_that_dies_while_it_is_restarted_is_dead_again() {
    for name in ["KILL", "STOP"] {
        let place = Place::new();
        let mut flight = place.take_off("s2-right", &[&SLOW[..], &RESTART].concat());
        flight.processes();
        assert!(catch(flight.pid(), name), "no second process");
        let caught = Instant::now();
        let done = flight.finish();
        assert_eq!(done.code, Some(0), "{name}: {done:?}");
        let told = &done.summary()["faults"];
        // If the process was caught too late, it was killed in flight, or hung.
        assert!(told.as_array().unwrap().len() >= 2 && told[1]["scheduled"] == false, "{told}");
        assert!(caught.elapsed() < Duration::from_secs(60), "{:?}", caught.elapsed());
    }
}

#[test]
fn an_interruption_ends_a_restart_that_hangs() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &[&SLOW[..], &RESTART].concat());
    flight.processes();
    assert!(catch(flight.pid(), "STOP"), "no second process");
    let asked = Instant::now();
    signal("INT", flight.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(130), "{done:?}");
    // The process that hangs is killed after two seconds. Had the run waited until it counts as hung, that would be five more.
    assert!(asked.elapsed() < Duration::from_millis(6500), "{:?}", asked.elapsed());
}

#[test]
fn the_flights_of_a_killed_sweep_end() {
    let place = Place::new();
    let experiment = place.join("sweep.toml");
    let text = format!(
        "name = \"killed\"\nscenario = {:?}\nruntime = \"processes\"\nseeds = [1]\n[grid]\n\"time.dt_s\" = [0.0005]\n",
        paper("s2-right")
    );
    fs::write(&experiment, text).unwrap();
    let mut sweep = place.start(&["sweep", experiment.to_str().unwrap(), "--out", "sweep", "--jobs", "1"]);
    let flights = place.join("sweep/flights").join(sweep.pid().to_string());
    let processes = flights.join("0/run/processes.json");
    sweep.wait_for(&processes);
    let flown = support::process::read(&processes);
    signal("KILL", sweep.pid());
    assert_eq!(sweep.end().code, None);
    let launcher = pid_of(&flown, "launcher", None);
    eventually("the flight ends", || !is_alive(launcher) && flown.iter().all(|process| !is_alive(process.pid)));
    assert_eq!(json(flights.join("0/run/summary.json"))["outcome"], "aborted");
    assert_eq!(support::process::shared_files(launcher), Vec::<String>::new());
}

#[test]
fn a_clock_that_never_ticks_is_refused() {
    let place = Place::new();
    for clock in ["realtime:1e-300", "realtime:1e300", "realtime:0"] {
        let refused = place.run(&["run", &paper("s1-left"), "--out", "out", "--clock", clock]);
        assert!(refused.code == Some(2) && refused.stderr.contains("SPEED"), "{refused:?}");
        assert!(!place.join("out").exists());
    }
}
