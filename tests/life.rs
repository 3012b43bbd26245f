//! Interruptions end a run cleanly, killed launchers and worlds leave no process behind, and a mission continues without a
//! drone that was killed.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};
use support::process::{Role, is_alive, pid_of, shared_files, signal, state};
use support::{Done, Flight, Place, eventually, faults, number};

/// A fast wall clock, for tests that act during the flight: S2 takes about three seconds.
const REALTIME: [&str; 2] = ["--clock", "realtime:20"];
/// Lockstep with short ticks, so that the flight takes some seconds as well.
const LOCKSTEP: [&str; 4] = ["--clock", "lockstep", "--set", "time.dt_s=0.0005"];
/// Processes of a killed launcher must have ended after this.
const END_LIMIT: Duration = Duration::from_secs(2);

fn take_off(place: &Place, args: &[&str]) -> (Flight, Vec<Role>) {
    let mut flight = place.take_off("s2-right", args);
    let processes = flight.processes();
    (flight, processes)
}

fn summary_file(place: &Place) -> Value {
    support::json(place.join("out/summary.json"))
}

/// The launcher ended on a signal: it has the exit code, it wrote its summary, and nothing is left.
fn assert_aborted(place: &Place, done: &Done, code: i32) {
    assert_eq!(done.code, Some(code), "{done:?}");
    assert_eq!(summary_file(place)["outcome"], "aborted", "{done:?}");
    assert_eq!(done.summary()["outcome"], "aborted");
    assert_eq!(place.runs_in_domain(), Vec::<String>::new(), "{done:?}");
}

#[test]
fn signals_in_flight_end_the_run_cleanly() {
    for clock in [&LOCKSTEP[..], &REALTIME[..]] {
        for (name, code) in [("INT", 130), ("TERM", 143)] {
            let place = Place::new();
            let (mut flight, _) = take_off(&place, clock);
            flight.wait_until(1.0);
            signal(name, flight.pid());
            let done = flight.finish();
            assert_aborted(&place, &done, code);
            assert!(number(&summary_file(&place), "/sim_s") >= 1.0, "what was flown is told");
        }
    }
}

#[test]
fn signals_during_start_up_end_the_run_cleanly() {
    for clock in [&LOCKSTEP[..], &REALTIME[..]] {
        for (name, code) in [("INT", 130), ("TERM", 143)] {
            let place = Place::new();
            let mut flight = place.take_off("s2-right", clock);
            flight.wait_for(&place.join("out/manifest.json"));
            signal(name, flight.pid());
            let done = flight.finish();
            assert_aborted(&place, &done, code);
        }
    }
}

#[test]
fn the_first_of_several_signals_counts() {
    let place = Place::new();
    let (flight, _) = take_off(&place, &REALTIME);
    signal("INT", flight.pid());
    signal("INT", flight.pid());
    assert_aborted(&place, &flight.finish(), 130);
}

#[test]
fn inline_runs_are_interrupted_too() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &["--runtime", "inline", "--set", "time.dt_s=0.0002"]);
    flight.wait_for(&place.join("out/processes.json"));
    signal("TERM", flight.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(143), "{done:?}");
    assert_eq!(summary_file(&place)["outcome"], "aborted");
}

/// No process of the run lives longer than two seconds.
fn assert_all_die(processes: &[Role], since: Instant) {
    eventually("all processes of the run end", || processes.iter().all(|process| !is_alive(process.pid)));
    assert!(since.elapsed() < END_LIMIT, "they lived for {:?}", since.elapsed());
}

/// What a killed launcher leaves behind is removed by `clean` or by the next run.
#[test]
fn processes_end_with_a_killed_launcher_and_the_next_run_cleans_up() {
    for (clock, cleaner) in [(&LOCKSTEP[..], "clean"), (&REALTIME[..], "clean"), (&REALTIME[..], "run")] {
        let place = Place::new();
        let (mut flight, processes) = take_off(&place, clock);
        let (killed, launcher) = (Instant::now(), flight.pid());
        signal("KILL", launcher);
        assert_eq!(flight.end().code, None);
        assert_all_die(&processes, killed);
        assert_eq!(place.runs_in_domain().len(), 1, "no process was left to remove it");
        assert!(!shared_files(launcher).is_empty());
        let done = match cleaner {
            "clean" => place.run(&["clean"]),
            _ => place.run(&["run", &support::paper("s2-right"), "--json"]),
        };
        assert_eq!(done.code, Some(0), "{done:?}");
        assert_eq!(place.runs_in_domain(), Vec::<String>::new());
        assert_eq!(shared_files(launcher), Vec::<String>::new());
    }
}

#[test]
fn cleaning_leaves_living_runs_alone() {
    let place = Place::new();
    let (flight, _) = take_off(&place, &REALTIME);
    let done = place.run(&["clean"]);
    assert!(done.stdout.starts_with("removed 0 dead runs"), "{done:?}");
    assert_eq!(place.runs_in_domain().len(), 1);
    assert_eq!(flight.finish().code, Some(0));
}

#[test]
fn when_all_are_killed_the_next_run_works() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, &REALTIME);
    let (killed, launcher) = (Instant::now(), flight.pid());
    // The launcher is killed last. Until then it may end some of the others itself.
    let all: Vec<String> = processes.iter().rev().map(|process| process.pid.to_string()).collect();
    let script = format!("kill -s KILL {}", all.join(" "));
    std::process::Command::new("sh").args(["-c", &script]).status().unwrap();
    assert_eq!(flight.end().code, None);
    assert_all_die(&processes, killed);
    let done = place.run(&["run", &support::paper("s2-right"), "--json", "--out", "next"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_eq!(shared_files(launcher), Vec::<String>::new());
    assert_eq!(place.runs_in_domain(), Vec::<String>::new());
}

#[test]
fn without_its_world_a_run_is_aborted() {
    for clock in [&LOCKSTEP[..], &REALTIME[..]] {
        let place = Place::new();
        let (mut flight, processes) = take_off(&place, clock);
        flight.wait_until(1.0);
        signal("KILL", pid_of(&processes, "world", None));
        let done = flight.finish();
        assert_aborted(&place, &done, 3);
        assert!(done.stderr.contains("world") && done.stderr.contains("KILL"), "{done:?}");
    }
}

/// Simulated seconds per second in flights that lose a drone.
const SPEED: f64 = 10.0;

/// Ends a drone's process at about this time of the flight, later on a busy machine. Returns the summary.
fn without(drone: u64, at_s: f64, how: &str) -> Value {
    let place = Place::new();
    let (flight, processes) = take_off(&place, &["--clock", &format!("realtime:{SPEED}")]);
    std::thread::sleep(Duration::from_secs_f64(at_s / SPEED));
    signal(how, pid_of(&processes, "drone", Some(drone)));
    let done = flight.finish();
    assert_eq!(done.code, Some(0), "drone {drone} ended at about {at_s} s: {done:?}");
    let summary = done.summary();
    assert_eq!(summary["outcome"], "reached");
    assert_eq!(summary["violations"], json!([]), "drone {drone} ended at about {at_s} s");
    assert!(number(&summary, "/min_separation_m") >= 37.0);
    assert_unscheduled(&place.join("out"), &summary, drone, "kill");
    let (noticed_s, ended_s) = (number(&summary, "/faults/0/t_s"), number(&summary, "/mission_s"));
    assert!(0.8 * at_s < noticed_s && noticed_s < ended_s, "noticed at {noticed_s} s of {ended_s} s");
    summary
}

/// The run has this one fault, in its events and in its summary.
fn assert_unscheduled(folder: &Path, summary: &Value, drone: u64, kind: &str) {
    let events = faults(folder);
    assert_eq!(events.len(), 1, "{events:?}");
    for fault in [&events[0], &summary["faults"][0]] {
        assert_eq!(fault["kind"], kind);
        assert_eq!(fault["target"], drone);
        assert_eq!(fault["scheduled"], false);
        assert!(fault["t_s"].is_number());
    }
    assert_eq!(summary["faults"].as_array().unwrap().len(), 1);
}

#[test]
fn a_member_killed_in_cruise_is_lost_and_the_mission_continues() {
    let summary = without(7, 1.0, "KILL");
    assert_eq!(summary["drones"], 8, "as many as there were at the start");
    let split = summary["stages"][0]["split"].as_array().unwrap();
    assert_eq!(split.iter().filter_map(Value::as_u64).sum::<u64>(), 7, "the living ones are split: {summary}");
}

#[test]
fn a_member_killed_in_the_queue_is_lost_and_the_mission_continues() {
    without(3, 20.0, "KILL");
}

#[test]
fn a_member_killed_while_reforming_is_lost_and_the_mission_continues() {
    without(3, 40.0, "KILL");
    // Drone 3 then hovers where another drone has to pass.
    without(3, 46.0, "KILL");
}

#[test]
fn a_leader_killed_in_cruise_is_replaced() {
    let summary = without(0, 1.0, "KILL");
    let leaders: Vec<u64> =
        summary["leaders"].as_array().unwrap().iter().map(|l| l["leader"].as_u64().unwrap()).collect();
    assert_eq!(leaders[0], 0);
    assert!(leaders.iter().any(|&leader| leader != 0), "{leaders:?}");
    assert!(number(&summary, "/elections") >= 2.0);
    assert!(number(&summary, "/failover_s/0") > 0.0);
}

#[test]
fn a_leader_killed_in_the_queue_or_while_reforming_does_not_end_the_mission() {
    without(0, 20.0, "KILL");
    without(0, 40.0, "KILL");
}

#[test]
fn a_drone_process_that_ends_by_another_signal_is_dead_as_well() {
    without(6, 5.0, "TERM");
}

#[test]
fn a_drone_killed_in_lockstep_is_lost_and_the_mission_continues() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, &LOCKSTEP);
    flight.wait_until(1.0);
    signal("KILL", pid_of(&processes, "drone", Some(4)));
    let done = flight.finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_unscheduled(&place.join("out"), &done.summary(), 4, "kill");
}

#[test]
fn a_stopped_drone_is_hung_in_lockstep_and_the_mission_continues() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, &LOCKSTEP);
    flight.wait_until(1.0);
    let stopped = Instant::now();
    signal("STOP", pid_of(&processes, "drone", Some(5)));
    let done = flight.finish();
    assert!(stopped.elapsed() >= Duration::from_secs(5), "given up too early: {:?}", stopped.elapsed());
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_unscheduled(&place.join("out"), &done.summary(), 5, "hung");
}

#[test]
fn a_stopped_drone_does_not_delay_the_others_by_the_wall_clock() {
    let place = Place::new();
    let (mut flight, processes) = take_off(&place, &REALTIME);
    flight.wait_until(1.0);
    let drone = pid_of(&processes, "drone", Some(5));
    signal("STOP", drone);
    eventually("it is stopped", || state(drone) == "T");
    flight.wait_until(12.0);
    assert_eq!(state(drone), "T", "it flew on without it");
    signal("CONT", drone);
    let done = flight.finish();
    let summary = done.summary();
    assert!(number(&summary, "/deadline_misses") > 100.0, "{done:?}");
    assert_eq!(summary["faults"], json!([]), "by the wall clock it is late, not hung: {done:?}");
}

/// A file in shared memory, as a run of `launcher` would have it.
fn stray(launcher: &str, name: &str, content: &[u8]) -> std::path::PathBuf {
    let path = std::path::PathBuf::from(format!("/dev/shm/skein_{launcher}_18ea000000000000_0_{name}"));
    std::fs::write(&path, content).unwrap();
    path
}

#[test]
fn files_of_runs_whose_folder_is_gone_are_removed_when_no_process_uses_them() {
    let place = Place::new();
    // No process has such a number.
    let (left, used, homeless) = ("4194305", "4194306", "4194307");
    let gone = stray(left, "ab_node.0_10_0.global_mgmt", b"");
    let held = [stray(used, "ab.dynamic", b""), stray(used, "ab.data", b"")];
    let open = std::fs::File::open(&held[0]).unwrap();
    let nowhere = place.join("nowhere");
    let home = stray(homeless, "home", nowhere.to_str().unwrap().as_bytes());
    let beside = stray(homeless, "ab.data", b"");
    let lock = std::fs::File::open(&home).unwrap();
    lock.lock().unwrap();
    let no_run = [stray("x", "y", b""), "/dev/shm/skein_notes".into()];
    std::fs::write(&no_run[1], "mine").unwrap();
    let there = |paths: &[&std::path::PathBuf]| paths.iter().map(|path| path.exists()).collect::<Vec<_>>();

    let done = place.run(&["clean"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_eq!(there(&[&gone]), [false], "nobody uses it: {done:?}");
    assert_eq!(there(&[&held[0], &held[1]]), [true; 2], "one of them is open: {done:?}");
    assert_eq!(there(&[&home, &beside]), [true; 2], "their launcher lives: {done:?}");
    assert_eq!(there(&[&no_run[0], &no_run[1]]), [true; 2], "they are of no run: {done:?}");

    // A run has a folder that this command does not look into.
    drop((open, lock));
    std::fs::create_dir(&nowhere).unwrap();
    assert_eq!(place.run(&["clean"]).code, Some(0));
    assert_eq!(there(&[&held[0], &held[1], &home, &beside]), [false, false, true, true]);
    std::fs::remove_dir(&nowhere).unwrap();
    assert_eq!(place.run(&["clean"]).code, Some(0));
    assert_eq!(there(&[&home, &beside]), [false; 2], "its folder and its launcher are gone");
    no_run.iter().for_each(|path| std::fs::remove_file(path).unwrap());
}

#[test]
fn the_files_of_a_living_run_stay_though_others_clean() {
    let (place, other) = (Place::new(), Place::new());
    let (mut flight, _) = take_off(&place, &REALTIME);
    flight.wait_until(1.0);
    let before = support::process::shared_files(flight.pid());
    assert_eq!(other.run(&["clean"]).code, Some(0));
    assert_eq!(support::process::shared_files(flight.pid()), before);
    // What the processes of a killed run leave for good, another run removes when the folder is gone.
    signal("KILL", flight.pid());
    let pid = flight.pid();
    assert_eq!(flight.end().code, None);
    std::fs::remove_dir_all(place.join("x/skein")).unwrap();
    eventually("all of it is removed", || {
        assert_eq!(other.run(&["clean"]).code, Some(0));
        support::process::shared_files(pid).is_empty()
    });
}
