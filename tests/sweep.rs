//! A sweep that was interrupted or killed resumes without losing or repeating a run, a bad experiment flies nothing, and the
//! command of a row repeats its run.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;
use support::process::signal;
use support::{Place, eventually, names, paper};

/// S2, two strategies, two losses, six seeds: 24 runs.
fn experiment(place: &Place, name: &str, more: &str) -> String {
    let text = format!(
        "scenario = {:?}\nstrategies = [\"congestion-aware\", \"shortest-path\"]\n{more}\n[grid]\n\
         formation.start_jitter_m = 2\nradio.loss = [0, 0.3]\n",
        paper("s2-right")
    );
    fs::write(place.join(name), text).unwrap();
    name.to_owned()
}

/// A pilot that does not see obstacles flies into one.
const COLLIDE: &str = "[formation]\ndrones = 2\nspacing_m = 60\n[[pilot]]\nname = \"cruise\"\n[time]\ntimeout_s = 30\n\
                       [[obstacle]]\nshape = \"circle\"\ncentre_m = [150, 0]\nradius_m = 20\n";

fn rows(folder: &Path) -> usize {
    fs::read_to_string(folder.join("rows.jsonl")).map_or(0, |text| text.matches('\n').count())
}

fn read(place: &Place, path: &str) -> String {
    fs::read_to_string(place.join(path)).unwrap()
}

/// The rows of runs.csv as fields by column. In these tests only quoted reasons contain commas.
fn csv(text: &str) -> Vec<Vec<(String, String)>> {
    let mut lines = text.lines().map(fields);
    let head = lines.next().unwrap();
    lines.map(|line| head.iter().cloned().zip(line).collect()).collect()
}

fn fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            c => fields.last_mut().unwrap().push(c),
        }
    }
    fields
}

fn field<'a>(row: &'a [(String, String)], name: &str) -> &'a str {
    &row.iter().find(|(column, _)| column == name).unwrap_or_else(|| panic!("no column {name}")).1
}

#[test]
fn a_resumed_sweep_gives_the_same_files_as_an_undisturbed_one() {
    let place = Place::new();
    let file = experiment(&place, "e.toml", "seeds = 6");
    let undisturbed = place.run(&["sweep", &file, "--out", "whole"]);
    assert_eq!(undisturbed.code, Some(0), "{undisturbed:?}");
    assert!(undisturbed.stdout.contains("100.0 % [61.0, 100.0]"), "Wilson's interval of 6 of 6: {undisturbed:?}");

    let folder = place.join("torn");
    let begin = || place.start(&["sweep", &file, "--out", "torn", "--jobs", "1", "--quiet"]);
    let flight = begin();
    eventually("three runs are done", || rows(&folder) >= 3);
    signal("INT", flight.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(130), "{done:?}");
    let first = rows(&folder);
    assert!((3..24).contains(&first), "{first} runs before the interruption");
    assert!(!folder.join("runs.csv").exists());

    let mut flight = begin();
    eventually("three more are done", || rows(&folder) >= first + 3);
    signal("KILL", flight.pid());
    assert_eq!(flight.end().code, None);
    let second = rows(&folder);
    assert!((first + 3..24).contains(&second), "{second} runs before the kill");
    let mut text = fs::read(folder.join("rows.jsonl")).unwrap();
    text.extend_from_slice(b"{\"job\":23,\"outcome\":\"rea");
    fs::write(folder.join("rows.jsonl"), text).unwrap();

    let done = place.run(&["sweep", &file, "--out", "torn", "--jobs", "2"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    for file in ["runs.csv", "summary.json"] {
        assert_eq!(read(&place, &format!("whole/{file}")), read(&place, &format!("torn/{file}")), "{file}");
    }
    assert_eq!(rows(&folder), 24, "no run is repeated");
    assert_eq!(names(folder.join("plots")), names(place.join("whole/plots")));
    let again = place.run(&["sweep", &file, "--out", "torn"]);
    assert_eq!((again.code, rows(&folder)), (Some(0), 24), "a complete sweep flies nothing");

    // As if a process of one run had been killed from outside.
    let all = read(&place, "torn/rows.jsonl");
    let cut_short = all.replacen("\"outcome\":\"reached\"", "\"outcome\":\"aborted\"", 1);
    assert_ne!(cut_short, all);
    fs::write(folder.join("rows.jsonl"), cut_short).unwrap();
    let again = place.run(&["sweep", &file, "--out", "torn"]);
    assert_eq!(
        (again.code, read(&place, "torn/rows.jsonl")),
        (Some(0), all),
        "a run that was cut short is flown again"
    );
}

#[test]
fn merged_shards_give_the_same_files_as_one_machine() {
    let place = Place::new();
    let file = experiment(&place, "e.toml", "seeds = 14");
    let whole = place.run(&["sweep", &file, "--out", "whole"]);
    assert_eq!(whole.code, Some(0), "{whole:?}");
    let folders = ["a", "b", "c", "d", "e", "f", "g"];
    let parts = ["1/7", "2/7", "3/7", "4/7", "5/7", "6/7", "7/7"];
    let shard = |(part, out)| (["sweep", "e.toml", "--shard", part, "--out", out, "--jobs", "1"], out);
    let shards: Vec<_> = parts.into_iter().zip(folders).map(shard).collect();
    let merge = |folders: &[&str]| place.run(&[&["sweep", "merge"], folders, &["--out", "merged"]].concat());

    // Two of them are killed.
    for (args, out) in &shards[..2] {
        let mut flight = place.start(args);
        eventually("a run is done", || rows(&place.join(out)) >= 1);
        signal("KILL", flight.pid());
        flight.end();
        assert!(rows(&place.join(out)) < 8, "{out} was killed too late");
    }
    for (args, out) in &shards[2..] {
        let done = place.run(args);
        assert_eq!((done.code, rows(&place.join(out))), (Some(0), 8), "{done:?}");
        assert!(done.stdout.contains("skein sweep merge") && !place.join(out).join("runs.csv").exists(), "{done:?}");
    }
    let early = place.run(&[&["sweep", "progress", "--json"], &folders[..6]].concat());
    assert_eq!(early.code, Some(1), "{early:?}");
    let (found, flown) = (early.summary(), folders[..6].iter().map(|out| rows(&place.join(out))).sum::<usize>());
    assert_eq!((&found["done"], &found["runs"], &found["absent"]), (&flown.into(), &56.into(), &["7/7"].into()));
    let early = merge(&folders);
    assert!(early.code == Some(2) && early.stderr.contains("of 56 runs are missing"), "{early:?}");
    for (args, out) in &shards[..2] {
        let resumed = place.run(args);
        assert_eq!((resumed.code, rows(&place.join(out))), (Some(0), 8), "{resumed:?}");
    }

    let done = place.run(&[&["sweep", "progress"], &folders[..]].concat());
    assert!(done.code == Some(0) && done.stdout.contains("56 of 56 runs are done: 56 reached"), "{done:?}");
    // The experiment is not needed any more.
    fs::remove_file(place.join("e.toml")).unwrap();
    let merged = merge(&["c", "a", "g", "f", "b", "e", "d"]);
    assert_eq!(merged.code, Some(0), "{merged:?}");
    for file in ["runs.csv", "summary.json", "ratios.csv"] {
        assert_eq!(read(&place, &format!("whole/{file}")), read(&place, &format!("merged/{file}")), "{file}");
    }
    assert_eq!(names(place.join("merged/plots")), names(place.join("whole/plots")));
}

#[test]
fn shards_that_do_not_belong_together_are_refused() {
    let place = Place::new();
    for (name, seeds) in [("e.toml", 1), ("other.toml", 2)] {
        fs::write(place.join(name), format!("name = \"e\"\nscenario = {:?}\nseeds = {seeds}\n", paper("s2-right")))
            .unwrap();
    }
    let fly = |args: &[&str]| place.run(&[&["sweep"], args, &["--quiet"]].concat());
    for (file, part, out) in [("e.toml", "1/2", "a"), ("e.toml", "1/2", "again"), ("other.toml", "2/2", "other")] {
        let done = fly(&[file, "--shard", part, "--out", out]);
        assert_eq!(done.code, Some(0), "{done:?}");
    }
    fs::create_dir(place.join("empty")).unwrap();
    let refused: [(&[&str], &str); 6] = [
        (&["merge", "a", "again"], "run 0 is in a and in again"),
        (&["merge", "a", "other"], "hold shards of different sweeps"),
        (&["merge", "a", "empty"], "empty: is not the folder of a shard"),
        (&["e.toml", "--shard", "2/2", "--out", "a"], "a: holds shard 1/2; expected shard 2/2"),
        (&["e.toml", "--out", "a"], "a: holds shard 1/2; expected all runs"),
        (&["e.toml", "--shard", "3/2"], "expected I/N, such as 2/7"),
    ];
    for (args, words) in refused {
        let done = fly(args);
        assert!(done.code == Some(2) && done.stderr.contains(words), "{args:?}: {done:?}");
    }
}

#[test]
fn rows_are_tidy_and_their_commands_repeat_them_by_processes() {
    let place = Place::new();
    let text = "scenario = [SCENARIO, \"random\"]\nseeds = [3, 8]\n[random]\ndrones = [5, 6]\nobstacles = [1, 1]\n\
                [grid]\nradio.loss = [0.2]\n";
    fs::write(place.join("e.toml"), text.replace("SCENARIO", &format!("{:?}", paper("s1-left")))).unwrap();
    let done = place.run(&["sweep", "e.toml", "--json", "--set", "radio.delay_s=0.1"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    let rows = csv(&read(&place, "sweeps/e/runs.csv"));
    let which: Vec<_> = rows.iter().map(|row| (field(row, "scenario"), field(row, "seed"))).collect();
    assert_eq!(which, [("s1-left", "3"), ("s1-left", "8"), ("random", "3"), ("random", "8")]);
    assert_eq!(done.summary()["cells"].as_array().unwrap().len(), 2);
    assert_eq!(done.summary()["cells"][1]["n"], 2);
    for row in [&rows[1], &rows[2]] {
        assert_eq!((field(row, "strategy"), field(row, "radio.loss")), ("congestion-aware-paper", "0.2"));
        assert_eq!((field(row, "outcome"), field(row, "failures")), ("reached", ""));
        let ratio: f64 = field(row, "separation_ratio").parse().unwrap();
        assert!((0.5..3.0).contains(&ratio), "{row:?}");
        let mut command = Command::new("sh");
        let skein = Path::new(env!("CARGO_BIN_EXE_skein")).parent().unwrap();
        let path = format!("{}:{}", skein.display(), std::env::var("PATH").unwrap());
        command.args(["-c", &format!("{} --json --no-record", field(row, "command"))]).env("PATH", path);
        let output = command.current_dir(place.join("")).env("XDG_RUNTIME_DIR", place.join("x")).output().unwrap();
        let summary: Value =
            serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"));
        assert_eq!(summary["runtime"], "processes");
        assert_eq!(summary["digest"], field(row, "digest"), "{}", field(row, "command"));
    }
}

#[test]
fn both_runtimes_give_the_same_rows() {
    let place = Place::new();
    let more = "seeds = [5]\nruntime = \"processes\"";
    let done = place.run(&["sweep", &experiment(&place, "processes.toml", more), "--quiet"]);
    assert_eq!((done.code, done.stdout.as_str()), (Some(0), ""), "{done:?}");
    let done = place.run(&["sweep", &experiment(&place, "inline.toml", "seeds = [5]"), "--quiet"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    assert_eq!(read(&place, "sweeps/processes/runs.csv"), read(&place, "sweeps/inline/runs.csv"));
    assert_eq!(place.runs_in_domain(), Vec::<String>::new());
    assert!(!place.join("sweeps/processes/flights").exists());
}

#[test]
fn an_interrupted_sweep_leaves_no_process_behind() {
    let place = Place::new();
    let file = experiment(&place, "e.toml", "seeds = [5]\nruntime = \"processes\"");
    let slow = ["sweep", &file, "--out", "s", "--set", "time.dt_s=0.0005"];
    let flight = place.start(&slow);
    eventually("a swarm flies", || !place.runs_in_domain().is_empty());
    signal("TERM", flight.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(143), "{done:?}");
    assert_eq!(place.runs_in_domain(), Vec::<String>::new(), "{done:?}");
    assert_eq!(rows(&place.join("s")), 0, "an interrupted run is no row");
}

#[test]
fn a_failing_run_is_a_row_and_the_sweep_is_complete() {
    let place = Place::new();
    let file = experiment(&place, "e.toml", "seeds = 2");
    let done = place.run(&["sweep", &file, "--set", "time.timeout_s=10", "--out", "late"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    let rows = csv(&read(&place, "late/runs.csv"));
    assert_eq!(rows.len(), 8);
    assert!(rows.iter().all(|row| field(row, "outcome") == "timeout" && !field(row, "reason").is_empty()), "{rows:?}");
    assert!(done.stdout.contains("0.0 % [0.0, 65.8]"), "{done:?}");

    // The spacing is 38.2 m and the safe distance 37 m. Some seeds draw starts that are too close to each other.
    let jitter = ["--set", "formation.spacing_m=38.2", "--set", "formation.start_jitter_m=0.9"];
    let text = format!("scenario = {:?}\nseeds = 40\n", paper("s2-right"));
    fs::write(place.join("jitter.toml"), text).unwrap();
    let done = place.run(&[&["sweep", "jitter.toml"], &jitter[..], &["--set", "time.timeout_s=1"]].concat());
    assert_eq!(done.code, Some(0), "{done:?}");
    let rows = csv(&read(&place, "sweeps/jitter/runs.csv"));
    let invalid: Vec<_> = rows.iter().filter(|row| field(row, "outcome") == "invalid").collect();
    assert!((1..40).contains(&invalid.len()), "{} of 40", invalid.len());
    assert!(field(invalid[0], "reason").contains("apart at the start"), "{:?}", invalid[0]);

    fs::write(place.join("collide.toml"), COLLIDE).unwrap();
    fs::write(place.join("c.toml"), "scenario = \"collide.toml\"\nseeds = 1\n").unwrap();
    let done = place.run(&["sweep", "c.toml"]);
    assert_eq!(done.code, Some(0), "{done:?}");
    let rows = csv(&read(&place, "sweeps/c/runs.csv"));
    assert_eq!((field(&rows[0], "outcome"), field(&rows[0], "failures")), ("unsafe", "clearance"), "{rows:?}");
    assert!(field(&rows[0], "command").starts_with("skein run collide.toml "), "{rows:?}");
}

#[test]
fn an_interrupted_hunt_writes_what_it_has_found() {
    let place = Place::new();
    fs::write(place.join("collide.toml"), COLLIDE).unwrap();
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let flight = place.start(&["hunt", "collide.toml", "--flights", "10000000", "--out", name]);
        eventually("the folder is made", || place.join(name).exists());
        std::thread::sleep(std::time::Duration::from_secs(2));
        signal(name, flight.pid());
        let done = flight.finish();
        assert_eq!(done.code, Some(code), "{done:?}");
        assert_eq!(names(place.join(name)), ["finding-1.toml"], "{done:?}");
        assert!(done.stdout.contains(&format!("skein run {name}/finding-1.toml")), "{done:?}");
    }
}

#[test]
fn bad_experiments_fly_nothing_and_foreign_folders_are_refused() {
    let place = Place::new();
    let file = experiment(&place, "e.toml", "seeds = 1");
    let done = place.run(&["sweep", &file, "--set", "radio.los=0.5"]);
    assert_eq!(done.code, Some(2), "{done:?}");
    assert!(done.stderr.contains("radio.los") && done.stderr.contains("loss"), "{done:?}");
    let misspelt = experiment(&place, "m.toml", "seeds = 1\nmetric = []");
    let done = place.run(&["sweep", &misspelt]);
    assert_eq!(done.code, Some(2), "{done:?}");
    assert!(done.stderr.contains("m.toml:4:1: unknown key \"metric\", expected one of name, "), "{done:?}");
    assert!(done.stderr.contains("; did you mean `metrics`?"), "{done:?}");
    let strategy = experiment(&place, "s.toml", "seeds = 1");
    let text = read(&place, &strategy).replace("\"shortest-path\"", "\"fixed:9/1\"");
    fs::write(place.join("s.toml"), text).unwrap();
    let done = place.run(&["sweep", "s.toml"]);
    assert!(done.code == Some(2) && done.stderr.contains("s.toml:2:35: strategy: found fixed:9/1"), "{done:?}");
    // 10^10 runs. They do not fit into the memory.
    let axes: String = (0..4).map(|i| format!("obstacle.{i}.x = {{ from = 0, to = 1, steps = 100 }}\n")).collect();
    fs::write(place.join("many.toml"), format!("scenario = \"random\"\nseeds = 100\n[grid]\n{axes}")).unwrap();
    for command in ["sweep", "hunt"] {
        let done = place.run(&[command, "many.toml"]);
        let wanted =
            "many.toml:2:9: found 10000000000 runs, 100000000 cells with 100 seeds each, expected at most 10000000";
        assert!(done.code == Some(2) && done.stderr.contains(wanted), "{done:?}");
    }
    assert_eq!(place.run(&["sweep", "none.toml"]).code, Some(2));
    assert!(!place.join("sweeps").exists() && !place.join("hunts").exists(), "nothing is made");

    assert_eq!(place.run(&["sweep", &file, "--quiet"]).code, Some(0));
    let done = place.run(&["sweep", &file, "--set", "radio.delay_s=0.1"]);
    assert_eq!(done.code, Some(2), "{done:?}");
    assert!(done.stderr.contains("changed"), "{done:?}");
    let other = experiment(&place, "other.toml", "seeds = 2");
    assert_eq!(place.run(&["sweep", &other, "--out", "sweeps/e"]).code, Some(2));
    assert_eq!(place.run(&["sweep", &other, "--out", "."]).code, Some(2));
}

#[test]
fn a_scene_can_be_flown_alone() {
    let place = Place::new();
    let scene = place.run(&["scene", "7", "--drones", "5..5", "--obstacles", "2..2"]);
    assert_eq!(scene.code, Some(0), "{scene:?}");
    assert_eq!(scene.stdout.matches("[[obstacle]]").count(), 2);
    fs::write(place.join("scene.toml"), &scene.stdout).unwrap();
    let check = place.run(&["check", "scene.toml", "--json"]);
    assert_eq!((check.code, &check.summary()["drones"]), (Some(0), &5.into()), "{check:?}");
    for bad in [&["scene", "x"][..], &["scene", "1", "--drones", "9..5"], &["scene", "1", "--drones", "0..5"]] {
        assert_eq!(place.run(bad).code, Some(2), "{bad:?}");
    }
}
