//! The boids fly, in both runtimes alike, through kills, freezes and loss.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

fn summary(runtime: &str, settings: &[&str]) -> Value {
    let out = tempfile::tempdir().expect("a temporary folder");
    let scenario: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("field.toml");
    let mut run = Command::new(env!("CARGO_BIN_EXE_boids"));
    run.arg("run").arg(scenario).args(["--runtime", runtime, "--json", "--force", "--out"]).arg(out.path());
    run.args(settings.iter().flat_map(|setting| ["--set", *setting]));
    let output = run.output().expect("the program starts");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{text}");
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn boids_fly_past_the_trees_as_one_flock() {
    let flown = summary("processes", &[]);
    assert_eq!(flown["outcome"], "reached");
    assert_eq!(flown["pilots"][0]["name"], "boids");
    assert!(flown["metrics"]["order"].as_f64() > Some(0.7), "{}", flown["metrics"]);
    assert_eq!(flown["metrics_own"]["neighbours"]["max"], 7.0);
}

#[test]
fn both_runtimes_fly_the_same_flight() {
    let cases: [&[&str]; 3] = [
        &[],
        &["radio.loss=0.5"],
        &[
            "fault.0={ kind = \"kill\", drone = 2, at_s = 20 }",
            "fault.1={ kind = \"freeze\", drone = 5, at_s = 30, for_s = 2 }",
        ],
    ];
    for settings in cases {
        let (inline, processes) = (summary("inline", settings), summary("processes", settings));
        assert!(inline["digest"].is_string());
        assert_eq!(inline["digest"], processes["digest"], "{settings:?}");
    }
}
