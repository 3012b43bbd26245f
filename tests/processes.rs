//! Every drone is a process, every run has a domain of its own, by either clock.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::collections::BTreeSet;
use support::process::{group, is_alive, pid_of, shared_files};
use support::{Done, Place, names, number, paper};

/// A fast wall clock: the flight of S2 takes about five seconds.
const REALTIME: [&str; 2] = ["--clock", "realtime:10"];
/// A formation of three without obstacles. Its mission ends after about five simulated seconds.
const SHORT: &str = "name = \"short\"\n[formation]\nshape = \"v\"\ndrones = 3\nspacing_m = 60\n\
    [mission]\nend = \"goal\"\ngoal_m = [50, 0]\n";

fn short(place: &Place) -> String {
    let path = place.join("short.toml");
    std::fs::write(&path, SHORT).unwrap();
    path.to_str().unwrap().to_owned()
}

fn reached(done: &Done) -> Value {
    assert_eq!(done.code, Some(0), "{done:?}");
    let summary = done.summary();
    assert_eq!(summary["outcome"], "reached");
    summary
}

#[test]
fn ten_processes_live_during_the_flight_and_have_ended_after_it() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &REALTIME);
    let processes = flight.processes();
    let roles: Vec<_> = processes.iter().map(|p| (p.role.as_str(), p.id)).collect();
    let mut wanted = vec![("launcher", None), ("world", None)];
    wanted.extend((0..8).map(|id| ("drone", Some(id))));
    assert_eq!(roles, wanted);
    let pids: BTreeSet<u32> = processes.iter().map(|p| p.pid).collect();
    assert_eq!(pids.len(), 10, "{processes:?}");
    assert_eq!(pid_of(&processes, "launcher", None), flight.pid());
    flight.wait_until(5.0);
    for process in &processes {
        assert!(is_alive(process.pid), "{process:?} is gone while it flies");
        let runs = std::fs::read(format!("/proc/{}/cmdline", process.pid)).unwrap();
        let word = if process.role == "launcher" { "run" } else { &process.role };
        let words: Vec<&[u8]> = runs.split(|&byte| byte == 0).collect();
        assert_eq!(words[1], word.as_bytes(), "{process:?}");
    }
    // Ctrl-C in a terminal reaches the launcher's process group. It must reach only the launcher.
    let launcher = group(flight.pid());
    assert!(processes[1..].iter().all(|process| group(process.pid) != launcher), "{processes:?}");
    assert!(!shared_files(flight.pid()).is_empty(), "its shared memory is not named skein_<pid>_");
    assert_eq!(place.runs_in_domain().len(), 1);
    reached(&flight.finish());
    assert!(pids.iter().all(|&pid| !is_alive(pid)));
    assert_eq!(place.runs_in_domain(), Vec::<String>::new());
}

#[test]
fn messages_and_senses_cross_through_services_in_shared_memory() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &REALTIME);
    let processes = flight.processes();
    let world = pid_of(&processes, "world", None);
    for process in processes.iter().filter(|process| process.pid != world) {
        let maps = std::fs::read_to_string(format!("/proc/{}/maps", process.pid)).unwrap();
        let prefix = format!("/dev/shm/skein_{}_", flight.pid());
        assert!(maps.contains(&prefix), "{process:?} maps nothing of its run");
    }
    flight.finish();
}

#[test]
fn the_wall_clock_gives_lockstep_s_digest_unless_it_missed_a_tick() {
    let place = Place::new();
    let scenario = short(&place);
    let lockstep = reached(&place.run(&["run", &scenario, "--json"]));
    assert_eq!(lockstep["deadline_misses"], 0);
    assert_eq!(lockstep["clock"], "lockstep");
    let mut missed = 0.0;
    // A busy machine may miss a tick, so there are several tries.
    for _ in 0..5 {
        let done = place.run(&["run", &scenario, "--json", "--clock", "realtime:5"]);
        let realtime = reached(&done);
        assert_eq!(realtime["clock"], "realtime:5");
        let factor = number(&realtime, "/realtime_factor");
        assert!(factor < 5.1, "faster than its clock: {factor}");
        missed = number(&realtime, "/deadline_misses");
        if missed == 0.0 {
            assert_eq!(realtime["digest"], lockstep["digest"]);
            assert_eq!(realtime["ticks"], lockstep["ticks"]);
            return;
        }
    }
    eprintln!("no flight without a missed tick, the last one had {missed}: digests were not compared");
}

#[test]
fn a_clock_that_is_too_fast_misses_ticks_and_reports_them() {
    let place = Place::new();
    let done = place.run(&["run", &short(&place), "--json", "--out", "out", "--clock", "realtime:100000"]);
    let summary = done.summary();
    assert!(number(&summary, "/deadline_misses") > 0.0, "{summary}");
    // Drones that miss ticks do not steer. The outcome may be any, but the exit code must agree with it.
    let code = match summary["outcome"].as_str() {
        Some("reached") => 0,
        Some("timeout") => 1,
        Some("unsafe") => 4,
        _ => panic!("{done:?}"),
    };
    assert_eq!(done.code, Some(code), "{done:?}");
    assert_eq!(summary["violations"].as_array().unwrap().is_empty(), code != 4, "{summary}");
    assert_eq!(summary["faults"], serde_json::json!([]), "to be late is no reason to die: {done:?}");
    let trace = std::fs::read_to_string(place.join("out/trace.csv")).unwrap();
    let recorded: BTreeSet<&str> = trace.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
    let told = number(&summary, "/ticks") - number(&summary, "/lost_ticks");
    assert_eq!(recorded.len() as f64, told, "what the recorder lost is counted: {summary}");
}

/// How long the machine is made busy.
const LOAD: std::time::Duration = std::time::Duration::from_secs(10);

/// Processes that take all time they can get, until this is dropped.
struct Hogs(Vec<std::process::Child>);

impl Hogs {
    fn new(count: usize) -> Self {
        let hog = || std::process::Command::new("sh").args(["-c", "while :; do :; done"]).spawn().unwrap();
        Self((0..count).map(|_| hog()).collect())
    }
}

impl Drop for Hogs {
    fn drop(&mut self) {
        self.0.iter_mut().for_each(|hog| drop(hog.kill()));
        self.0.iter_mut().for_each(|hog| drop(hog.wait()));
    }
}

/// Two hundred processes want the cores for ten seconds, while the swarm flies by a wall clock that is too fast for them. Commands come
/// late, by any time, and all distances are kept.
#[test]
fn commands_that_come_late_on_a_busy_machine_are_safe() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &["--clock", "realtime:50"]);
    flight.processes();
    let hogs = Hogs::new(200);
    std::thread::sleep(LOAD);
    drop(hogs);
    let done = flight.finish();
    let summary = done.summary();
    assert!(number(&summary, "/deadline_misses") > 100.0, "no load: {done:?}");
    assert_eq!(summary["violations"], serde_json::json!([]), "{done:?}");
    assert!(matches!(done.code, Some(0 | 1)), "{done:?}");
    assert_eq!(summary["faults"], serde_json::json!([]), "to be late is no reason to die: {done:?}");
}

#[test]
fn five_swarms_at_once_do_not_see_each_other() {
    let place = Place::new();
    let scenario = paper("s2-right");
    let alone = reached(&place.run(&["run", &scenario, "--json"]));
    for swarms in [2, 5] {
        let flights: Vec<_> = (0..swarms).map(|_| place.start(&["run", &scenario, "--json"])).collect();
        for flight in flights {
            let summary = reached(&flight.finish());
            assert_eq!(summary["digest"], alone["digest"]);
            assert_eq!(summary["messages"]["delivered"], alone["messages"]["delivered"]);
        }
    }
    let wanted: BTreeSet<String> = (1..=8).map(|number| format!("s2-right-{number}")).collect();
    assert_eq!(names(place.join("runs")).into_iter().collect::<BTreeSet<_>>(), wanted, "a number for each");
    assert_eq!(place.runs_in_domain(), Vec::<String>::new());
}

#[test]
fn a_swarm_that_is_interrupted_leaves_another_one_alone() {
    let place = Place::new();
    let (scenario, slow) = (paper("s2-right"), ["--clock", "realtime:15"]);
    let mut first = place.start(&[&["run", &scenario, "--json", "--out", "out"], &slow[..]].concat());
    first.processes();
    let second = place.start(&["run", &scenario, "--json"]);
    support::process::signal("INT", first.pid());
    assert_eq!(first.finish().code, Some(130));
    reached(&second.finish());
}
