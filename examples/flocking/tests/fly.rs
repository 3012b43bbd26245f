//! The flocking laws fly between the trees without a collision.

use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn summary(law: &str, runtime: &str, more: &[&str]) -> Value {
    let out = tempfile::tempdir().expect("a temporary folder");
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("trees.toml");
    let mut run = Command::new(env!("CARGO_BIN_EXE_flocking"));
    run.arg("run").arg(scenario).args(["--set", &format!("pilot.0.name=\"{law}\"")]);
    run.args(more).args(["--runtime", runtime, "--json", "--force", "--out"]).arg(out.path());
    let output = run.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

#[test]
fn both_laws_keep_order_and_distance_in_both_runtimes() {
    for law in ["vasarhelyi", "olfati-saber"] {
        let (inline, processes) = (summary(law, "inline", &[]), summary(law, "processes", &[]));
        assert_eq!(inline["digest"], processes["digest"], "{law}");
        assert_eq!(inline["outcome"], "reached", "{law}");
        let metric = |name: &str| inline["metrics"][name].as_f64();
        assert!(metric("order") > Some(0.8), "{law}: {}", inline["metrics"]);
        assert_eq!(metric("safety"), Some(1.0), "{law}");
        assert_eq!(metric("union"), Some(1.0), "{law}");
    }
}

#[test]
fn both_laws_fly_by_what_they_hear_over_wifi() {
    for law in ["vasarhelyi", "olfati-saber"] {
        let wifi = ["--set", "pilot.0.params.by_radio=true", "--set", "radio.preset=wifi"];
        let (ranged, heard) = (summary(law, "inline", &[]), summary(law, "inline", &wifi));
        assert_eq!(summary(law, "processes", &wifi)["digest"], heard["digest"], "{law}");
        assert_ne!(ranged["digest"], heard["digest"], "{law}");
        assert!(heard["messages"]["delivered"].as_u64() > Some(10_000), "{law}: {}", heard["messages"]);
        assert!(heard["metrics"]["order"].as_f64() > Some(0.8), "{law}: {}", heard["metrics"]);
        assert_eq!(heard["metrics"]["safety"], 1.0, "{law}");
    }
}

#[test]
fn an_unknown_parameter_is_refused_with_its_place() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("trees.toml");
    let mut run = Command::new(env!("CARGO_BIN_EXE_flocking"));
    run.args(["run", "--set", "pilot.0.params.repulsion=1"]).arg(scenario);
    let output = run.output().expect("the program starts");
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("repulsion"), "{text}");
}
