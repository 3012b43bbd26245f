//! docs/data.md lists exactly the columns, keys and events that are written.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use skein_protocol::record::{EventKind, FaultKind, Outcome, RunEvent, Totals, ViolationKind};
use skein_protocol::{Ballot, DroneId, ObstacleId, Phase, PlanStamp};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use support::data_page::{documented, rows};
use support::{Place, paper};

fn header(path: PathBuf) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().next().unwrap().split(',').map(str::to_owned).collect()
}

#[test]
fn the_tables_of_a_run_have_the_documented_columns() {
    let place = Place::new();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    let full = fs::read_to_string(place.join("out/trace.csv")).unwrap().lines().count();
    let done = place.run(&["report", "out", "--messages", "--every", "10"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    for table in ["trace.csv", "messages.csv", "formation.csv"] {
        assert_eq!(header(place.join("out").join(table)), documented(table), "{table}");
    }
    let thinned = fs::read_to_string(place.join("out/trace.csv")).unwrap().lines().count();
    assert!((full / 11..full / 9).contains(&thinned), "{thinned} of {full} lines");
    let many = "[formation]\nshape = \"grid\"\ndrones = 65\n[time]\ntimeout_s = 1\n";
    fs::write(place.join("many.toml"), many).unwrap();
    place.run(&["run", "many.toml", "--runtime", "inline", "--out", "many", "--every", "5"]);
    assert_eq!(fs::read_to_string(place.join("many/trace.csv")).unwrap().lines().count(), 1 + 65 * 11);
    let done = place.run(&["report", "many", "--messages"]);
    assert!(done.code == Some(2) && done.stderr.contains("at most 64 drones"), "{done:?}");
}

/// `.ci/run` runs this test with the feature `parquet` as well.
#[test]
fn tables_are_parquet_as_well_or_the_program_says_how_to_build_one_that_can() {
    let place = Place::new();
    let (scenario, experiment) = (paper("s1-left"), place.join("e.toml"));
    fs::write(&experiment, format!("scenario = {scenario:?}\nseeds = 1\n")).unwrap();
    let run = ["run", &scenario, "--runtime", "inline", "--out", "out", "--parquet"];
    let sweep = ["sweep", "e.toml", "--parquet"];
    if !cfg!(feature = "parquet") {
        for command in [&run[..], &sweep[..]] {
            let done = place.run(command);
            assert!(done.code == Some(2) && done.stderr.contains("--features parquet"), "{done:?}");
            place.assert_untouched(&done);
            assert!(!place.join("sweeps").exists());
        }
        return;
    }
    let done = [&run[..], &["report", "out", "--messages", "--parquet"], &sweep[..]].map(|command| place.run(command));
    assert!(done.iter().all(|done| done.code == Some(0)), "{done:?}");
    assert!(done[1].stdout.contains("trace.parquet") && done[1].stdout.contains("messages.parquet"), "{done:?}");
    for table in ["out/trace.parquet", "out/messages.parquet", "sweeps/e/runs.parquet"] {
        let bytes = fs::read(place.join(table)).unwrap();
        assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"), "{table}");
    }
}

/// One event of each kind.
fn one_of_each() -> Vec<EventKind> {
    let (drone, text, plan) = (DroneId(1), String::new, PlanStamp::default());
    let (kind, target) = (FaultKind::Wind, DroneId::NONE);
    vec![
        EventKind::Detected { stage: 0, drone, obstacle: ObstacleId(0), distance_m: 1.0 },
        EventKind::Passed { stage: 0 },
        EventKind::Leader { group: text(), ballot: Ballot::default(), leader: drone, leads: true },
        EventKind::Grouping {
            plan,
            group: text(),
            phase: Phase::Avoid,
            members: 1,
            routes: 2,
            obstacles: vec![],
            predicted_s: None,
        },
        EventKind::Assigned {
            plan,
            drone,
            group: text(),
            leader: drone,
            route: None,
            rank: 0,
            slot_m: Default::default(),
        },
        EventKind::Fault { kind, target, scheduled: true, detail: text() },
        EventKind::FaultOver { kind, target, detail: text() },
        EventKind::Failure { drone, pilot: text(), reason: text() },
        EventKind::Violation { kind: ViolationKind::Separation, drones: vec![], value_m: 1.0 },
        EventKind::End {
            outcome: Outcome::Reached,
            reason: text(),
            stuck: vec![],
            unfinished: vec![],
            standstill_s: None,
            totals: Box::new(Totals::default()),
        },
    ]
}

/// Place of an event's kind in [`one_of_each`]. A new kind makes this fail to compile.
fn place_of(kind: &EventKind) -> usize {
    match kind {
        EventKind::Detected { .. } => 0,
        EventKind::Passed { .. } => 1,
        EventKind::Leader { .. } => 2,
        EventKind::Grouping { .. } => 3,
        EventKind::Assigned { .. } => 4,
        EventKind::Fault { .. } => 5,
        EventKind::FaultOver { .. } => 6,
        EventKind::Failure { .. } => 7,
        EventKind::Violation { .. } => 8,
        EventKind::End { .. } => 9,
    }
}

#[test]
fn every_event_is_documented_with_all_its_keys() {
    let kinds = one_of_each();
    assert!(kinds.iter().enumerate().all(|(place, kind)| place_of(kind) == place));
    let mut written: Vec<(String, String)> = ["t_s", "event"].map(|key| ("all".to_owned(), key.to_owned())).into();
    for what in kinds {
        let event = serde_json::to_value(RunEvent { t_s: 0.0, what }).unwrap();
        let name = event["event"].as_str().unwrap().to_owned();
        let keys = event.as_object().unwrap().keys().filter(|key| !["t_s", "event"].contains(&key.as_str()));
        written.extend(keys.map(|key| (name.clone(), key.clone())));
    }
    let mut documented: Vec<(String, String)> = Vec::new();
    for row in rows("events.jsonl") {
        let event = if row[0].is_empty() { documented.last().unwrap().0.clone() } else { row[0].clone() };
        documented.push((event, row[1].clone()));
    }
    assert_eq!(documented, written);
}

/// The keys of an object by the schema, with their descriptions; those of nested objects after a point.
fn keys(schema: &Value, root: &Value, prefix: &str, found: &mut Vec<(String, String)>) {
    let schema = match schema["$ref"].as_str().and_then(|name| name.strip_prefix('#')) {
        Some(pointer) => root.pointer(pointer).unwrap(),
        None => schema,
    };
    for any in schema["anyOf"].as_array().into_iter().flatten() {
        keys(any, root, prefix, found);
    }
    if !schema["items"].is_null() && schema["items"]["type"].is_null() {
        keys(&schema["items"], root, &format!("{prefix}[]"), found);
    }
    for (name, value) in schema["properties"].as_object().into_iter().flatten() {
        let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        let text = value["description"].as_str().unwrap_or_default().replace('\n', " ").replace('|', "\\|");
        found.push((path.clone(), text));
        keys(value, root, &path, found);
    }
}

/// The summary's table is written from its schema. `SKEIN_WRITE_DOCS=1` writes it again.
#[test]
fn every_key_of_the_summary_is_documented() {
    let place = Place::new();
    let schema: Value = serde_json::from_str(&place.run(&["schema", "summary"]).stdout).unwrap();
    let mut found = Vec::new();
    keys(&schema, &schema, "", &mut found);
    let lines: String = found.iter().map(|(key, text)| format!("| `{key}` | {text} |\n")).collect();
    let page = support::data_page::path();
    let text = fs::read_to_string(&page).unwrap();
    let head = "| key | content |\n|---|---|\n";
    let begin = text.find("## summary.json\n").unwrap();
    let begin = begin + text[begin..].find(head).unwrap() + head.len();
    let end = begin + text[begin..].find("\n## ").unwrap();
    if std::env::var_os("SKEIN_WRITE_DOCS").is_some() {
        fs::write(&page, format!("{}{lines}{}", &text[..begin], &text[end..])).unwrap();
    } else {
        assert_eq!(&text[begin..end], lines, "SKEIN_WRITE_DOCS=1 cargo test -p skein --test data writes it");
    }
}

#[test]
fn the_tables_of_a_sweep_have_the_documented_columns() {
    let place = Place::new();
    let experiment = format!(
        "scenario = {:?}\nstrategies = [\"congestion-aware-paper\", \"shortest-path\"]\nseeds = 2\n[grid]\n\
         formation.start_jitter_m = [0, 2]\n",
        paper("s2-right")
    );
    fs::write(place.join("e.toml"), experiment).unwrap();
    let done = place.run(&["sweep", "e.toml"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    assert!(done.stdout.contains("2, all equal") && done.stdout.contains("give no interval"), "{done:?}");
    let folder = place.join("sweeps/e");
    for table in ["runs.csv", "ratios.csv"] {
        let mut written = header(folder.join(table));
        written.retain(|column| column != "formation.start_jitter_m");
        assert_eq!(written, documented(table), "{table}");
    }
    let summary = support::json(folder.join("summary.json"));
    let names = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<String>>();
    let lists = ["cells", "ratios", "paired"];
    let mut written: Vec<String> = names(&summary).into_iter().filter(|key| !lists.contains(&key.as_str())).collect();
    for list in lists {
        written.extend(names(&summary[list][0]).into_iter().map(|key| format!("{list}[].{key}")));
    }
    assert_eq!(written, documented("summary.json of a sweep"));
}

#[test]
fn the_lines_of_a_running_swarm_have_the_documented_keys() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &["--clock", "realtime:4"]);
    flight.wait_until(0.5);
    let names = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<String>>();
    for row in rows("Lines of running swarms") {
        let wanted: BTreeSet<&str> = row[1].split(", ").collect();
        for topic in row[0].split(", ") {
            let written = if topic.starts_with("top") {
                names(&place.run(&["top", "--json"]).summary()["swarms"][0])
            } else {
                let done = place.run(&["topic", "echo", topic, "--count", "1"]);
                names(&done.summary())
            };
            assert_eq!(written.iter().map(String::as_str).collect::<BTreeSet<_>>(), wanted, "{topic}");
        }
    }
    // What is left of the mission says no more.
    support::process::signal("INT", flight.pid());
    assert_eq!(flight.finish().code, Some(130));
}
