//! Folders and files from elsewhere: what they hold neither steers the terminal nor blocks or exhausts their reader.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;
use support::Place;

/// A recorded run in the folder `out`.
fn recorded() -> Place {
    let place = Place::new();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    place
}

fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "no {from} in {}", path.display());
    fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn no_text_of_a_folder_steers_the_terminal() {
    let place = recorded();
    replace(
        &place.join("out/summary.json"),
        "\"scenario\": \"s1-left\"",
        "\"scenario\": \"\\u001b]0;evil\\u0007\\u009b2J\"",
    );
    replace(&place.join("out/summary.json"), "\"outcome\": \"reached\"", "\"outcome\": \"timeout\"");
    replace(&place.join("out/summary.json"), "\"reason\": \"", "\"reason\": \"\\u001b[31m");
    let report = place.run(&["report", "out"]);
    assert_eq!(report.code, Some(0), "{report:?}");
    fs::write(place.join("out/trace.csv"), "\x1b[2Jevil\n").unwrap();
    let bad = place.run(&["report", "out"]);
    assert!(bad.code == Some(2) && bad.stderr.contains("evil"), "{bad:?}");
    fs::write(place.join("evil.toml"), "name = \"\x1b[2J\"\n").unwrap();
    let scenario = place.run(&["check", "evil.toml"]);
    assert_eq!(scenario.code, Some(2), "{scenario:?}");
    for text in [&report.stdout, &bad.stderr, &scenario.stderr] {
        assert!(!text.contains(|c: char| c.is_control() && c != '\n' && c != '\t'), "{text:?}");
    }
}

#[test]
fn pipes_and_devices_in_a_folder_are_refused() {
    for name in ["manifest.json", "summary.json", "trace.csv", "run.mcap", "flight.spool"] {
        let place = recorded();
        let path = place.join("out").join(name);
        for kind in ["fifo", "device"] {
            let _ = fs::remove_file(&path);
            match kind {
                "fifo" => assert!(Command::new("mkfifo").arg(&path).status().unwrap().success()),
                _ => symlink("/dev/zero", &path).unwrap(),
            }
            for command in ["report", "replay", "view"] {
                let unread = command != "report" && name == "flight.spool"
                    || command == "replay" && ["trace.csv", "run.mcap"].contains(&name);
                if !unread {
                    let refused = place.run(&[command, "out"]);
                    assert!([Some(2), Some(3)].contains(&refused.code), "{kind} {name}: {refused:?}");
                }
            }
        }
    }
}
