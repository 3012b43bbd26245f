//! Observers, recordings, replays and terminal tools.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::fs;
use std::process::Command;
use support::Place;
use support::process::signal;

/// Short ticks, so that a flight in lockstep takes some seconds.
const SLOW: [&str; 2] = ["--set", "time.dt_s=0.001"];

#[test]
fn observers_do_not_change_the_digest() {
    let place = Place::new();
    let alone = place.fly("s2-right", &[&SLOW[..], &["--runtime", "inline", "--no-record", "--out", "alone"]].concat());
    let mut flight = place.take_off("s2-right", &SLOW);
    flight.wait_until(0.5);
    for round in 0..10 {
        let topic = ["record", "air", "uplink", "senses"][round % 4];
        let seen = place.run(&["topic", "echo", topic, "--count", "20"]);
        assert_eq!((seen.code, seen.stdout.lines().count()), (Some(0), 20), "{seen:?}");
        let line: Value = serde_json::from_str(seen.stdout.lines().next().unwrap()).unwrap();
        assert_eq!(line["topic"], topic);
    }
    // An observer that dies with a full buffer does not disturb the swarm either.
    let dies = place.start(&["topic", "hz", "record"]);
    std::thread::sleep(std::time::Duration::from_millis(300));
    signal("KILL", dies.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_eq!(done.summary()["digest"], alone["digest"]);
}

#[test]
fn a_running_swarm_shows_in_the_terminal() {
    let place = Place::new();
    let without_swarm = place.run(&["topic", "list"]);
    assert_eq!(without_swarm.code, Some(3));
    assert!(without_swarm.stderr.contains("no swarm runs"), "{without_swarm:?}");
    assert!(place.run(&["top", "--once"]).stdout.contains("no swarm runs"));
    let topics = "pilot.0={ name = \"paper\", topics = [\"gossip\"] }";
    let mut flight = place.take_off("s2-right", &["--clock", "realtime:8", "--set", topics]);
    flight.wait_until(0.5);
    let to_the_end = ["air", "record"].map(|topic| place.start(&["topic", "hz", topic]));
    let list = place.run(&["topic", "list"]);
    let listed: Vec<Value> = list.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<&str> = listed.iter().map(|line| line["topic"].as_str().unwrap()).collect();
    assert_eq!(names, ["senses", "air", "uplink", "record", "gossip"]);
    assert!(listed[4]["service"].as_str().unwrap().contains("--kind gossip"), "{list:?}");
    let frames = place.run(&["topic", "echo", "air", "--count", "40"]);
    assert!(!frames.stdout.contains("4294967295") && !frames.stdout.contains("says"), "{frames:?}");
    let poses = place.run(&["topic", "echo", "air", "--drone", "3", "--kind", "pose", "--count", "2"]);
    let lines: Vec<Value> = poses.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.iter().all(|line| line["drone"] == 3 && line["kind"] == "pose") && lines.len() == 2, "{poses:?}");
    assert!(lines.iter().all(|line| line["message"]["position_m"].is_array() && line["error"].is_null()), "{poses:?}");
    let unknown: [(&[&str], &str); 4] = [
        (&["echo", "air", "--drone", "8"], "--drone 8: expected a drone of the run: 0 to 7"),
        (&["hz", "senses", "--drone", "8"], "--drone 8: expected a drone of the run: 0 to 7"),
        (&["echo", "uplink", "--kind", "gosip"], "presence, gossip; did you mean `gossip`?"),
        (&["hz", "record", "--kind", "pose"], "--kind pose: expected the topic `air` or `uplink`"),
    ];
    for (args, words) in unknown {
        let refused = place.run(&[&["topic"], args].concat());
        assert!(refused.code == Some(2) && refused.stderr.contains(words), "{refused:?}");
    }
    let top = place.run(&["top", "--once"]);
    assert!(top.stdout.contains("s2-right.") && top.stdout.contains("8/8"), "{top:?}");
    let top = place.run(&["top", "--json"]).summary();
    let swarm = &top["swarms"][0];
    assert_eq!((&swarm["scenario"], &swarm["alive"]), (&"s2-right".into(), &8.into()), "{top}");
    let members = swarm["groups"].as_array().unwrap().iter().flat_map(|group| group["drones"].as_array().unwrap());
    assert_eq!((members.count(), swarm["rows"].as_array().map(Vec::len)), (8, Some(8)), "{top}");
    assert!(place.run(&["top"]).stderr.contains("not a terminal"));
    flight.finish();
    for observer in to_the_end {
        let done = observer.finish();
        assert_eq!((done.code, done.stderr.as_str()), (Some(0), ""), "{done:?}");
    }
}

#[test]
fn a_replay_compares_digests() {
    let place = Place::new();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    let equal = place.run(&["replay", "out"]);
    assert_eq!(equal.code, Some(0), "{equal:?}");
    assert!(equal.stdout.starts_with("equal\n"), "{equal:?}");
    let path = place.join("out/summary.json");
    let digest = support::json(&path)["digest"].as_str().unwrap().to_owned();
    fs::write(&path, fs::read_to_string(&path).unwrap().replace(&digest, "0123456789abcdef")).unwrap();
    let other = place.run(&["replay", "out", "--json"]);
    assert_eq!(other.code, Some(1), "{other:?}");
    assert_eq!((other.summary()["equal"].as_bool(), &other.summary()["replayed"]), (Some(false), &digest.into()));
    assert_eq!(place.run(&["replay", "nowhere"]).code, Some(2));
}

#[test]
fn equal_runs_make_equal_recordings_in_both_runtimes() {
    let place = Place::new();
    for (name, runtime) in [("one", "processes"), ("two", "processes"), ("three", "inline")] {
        place.fly("s1-left", &["--runtime", runtime, "--out", name]);
    }
    let bytes = |name: &str| fs::read(place.join(name).join("run.mcap")).unwrap();
    assert!(bytes("one") == bytes("two"), "two runs, two recordings");
    assert!(bytes("one") == bytes("three"), "the runtime shows in the recording");
    let again = place.run(&["report", "one"]);
    assert!(again.stdout.contains("one/report.html"), "{again:?}");
}

/// Prints what the Python package mcap reads from a recording.
const SCRIPT: &str = "
import json, sys
from mcap.reader import make_reader
with open(sys.argv[1], 'rb') as file:
    reader = make_reader(file)
    topics = {}
    for schema, channel, message in reader.iter_messages():
        json.loads(message.data)
        topics[channel.topic] = topics.get(channel.topic, 0) + 1
    names = [a.name for a in reader.iter_attachments()]
    print(json.dumps({'topics': topics, 'attachments': names}))
";

#[test]
fn the_python_package_mcap_reads_a_recording() {
    if !Command::new("python3").args(["-c", "import mcap.reader"]).output().is_ok_and(|tried| tried.status.success()) {
        eprintln!("skipped: no Python package `mcap` on this machine (pip install mcap)");
        return;
    }
    let place = Place::new();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    let read = Command::new("python3").args(["-c", SCRIPT]).arg(place.join("out/run.mcap")).output().unwrap();
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let found: Value = serde_json::from_slice(&read.stdout).unwrap();
    assert_eq!(found["attachments"][0], "scenario.json");
    for topic in ["/tf", "/drones", "/scene", "/log", "/skein/state", "/skein/energy", "/skein/radio"] {
        assert!(found["topics"][topic].as_u64().is_some_and(|count| count > 10), "{topic}: {found}");
    }
}

#[test]
fn doctor_prints_how_many_drones_fit() {
    let place = Place::new();
    let found = place.run(&["doctor", "--json"]).summary();
    let limits = found["limits"].as_array().unwrap();
    let least = limits.iter().filter_map(|limit| limit["drones"].as_u64()).min();
    assert_eq!((found["drones"].as_u64(), limits.len()), (least, 6));
    assert!(place.run(&["doctor"]).stdout.starts_with("about "));
}
