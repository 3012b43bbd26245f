//! Drones swap places by word alone, and keep their distances.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn summary(runtime: &str, more: &[&str]) -> Value {
    let out = tempfile::tempdir().expect("a temporary folder");
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("circle.toml");
    let mut run = Command::new(env!("CARGO_BIN_EXE_antipodal"));
    run.arg("run").arg(scenario).args(more);
    run.args(["--runtime", runtime, "--json", "--no-record", "--force", "--out"]).arg(out.path());
    let output = run.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn ten_drones_swap_places_over_a_late_and_lossy_radio() {
    let radio = ["--set", "radio.delay_s=0.3", "--set", "radio.loss=0.3"];
    let (inline, processes) = (summary("inline", &radio), summary("processes", &radio));
    assert_eq!(inline["digest"], processes["digest"]);
    assert_eq!(inline["outcome"], "reached");
    assert!(inline["min_separation_m"].as_f64() >= Some(0.5), "{}", inline["min_separation_m"]);
    assert_eq!(inline["violations"], Value::Array(Vec::new()));
}

#[test]
fn a_delay_costs_time() {
    let seconds = |delay: &str| summary("inline", &["--set", delay])["mission_s"].as_f64();
    assert!(seconds("radio.delay_s=0.3") > seconds("radio.delay_s=0"));
}
