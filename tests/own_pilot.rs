//! An application with pilots of its own, by the crate `skein` alone. This file is the application and its test: started with
//! `SKEIN_TEST_APP` set, it does what its arguments say.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod own_pilots;

use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output, Stdio};
use std::time::{Duration, Instant};

/// Set in the processes of the application.
const APP: &str = "SKEIN_TEST_APP";

/// Set in the processes of a program that is built with another version: the word that stands for that version, see
/// `skein_bus::Version`.
const OTHER_VERSION: &str = "SKEIN_TEST_VERSION";

/// Where a program of another version says which it is, in the control segment. This is the same in all versions.
const REFUSED: u64 = 64;

fn main() -> ExitCode {
    if std::env::var_os(APP).is_some() {
        if let Some(word) = std::env::var_os(OTHER_VERSION) {
            join_as_another_version(&word.to_string_lossy());
        }
        return own_pilots::app().main();
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    for (name, test) in TESTS {
        if wanted.is_empty() || wanted.iter().any(|word| name.contains(word.as_str())) {
            let folder = tempfile::tempdir().unwrap();
            test(&Bench { folder: folder.path().to_owned() });
            println!("test {name} ... ok");
        }
    }
    ExitCode::SUCCESS
}

/// Does what a drone's process of another version does: says which it is, and ends.
fn join_as_another_version(word: &str) {
    let args: Vec<String> = std::env::args().collect();
    let Some(control) = args.iter().position(|arg| arg == "--control").filter(|_| args[1] == "drone") else { return };
    let path = format!("/proc/self/fd/{}", args[control + 1]);
    let segment = std::fs::OpenOptions::new().write(true).open(path).unwrap();
    let word: u64 = word.parse().unwrap();
    std::os::unix::fs::FileExt::write_all_at(&segment, &word.to_ne_bytes(), REFUSED).unwrap();
    std::process::exit(3);
}

type Test = fn(&Bench);

const TESTS: &[(&str, Test)] = &[
    ("both_runtimes_fly_own_pilots_with_equal_digests", both_runtimes_fly_own_pilots_with_equal_digests),
    ("a_mixed_swarm_survives_faults_and_loss", a_mixed_swarm_survives_faults_and_loss),
    ("wrong_names_and_parameters_are_refused", wrong_names_and_parameters_are_refused),
    ("a_program_of_its_own_flies_some_drones", a_program_of_its_own_flies_some_drones),
    ("sweep_and_replay_know_the_pilots", sweep_and_replay_know_the_pilots),
    ("a_failing_pilot_is_named_and_the_others_fly_on", a_failing_pilot_is_named_and_the_others_fly_on),
    ("a_process_that_ends_or_hangs_is_a_failure", a_process_that_ends_or_hangs_is_a_failure),
    ("a_program_of_another_version_is_refused_with_words", a_program_of_another_version_is_refused_with_words),
    ("a_forked_process_never_flies", a_forked_process_never_flies),
    ("a_pilot_that_ends_an_inline_run_is_named", a_pilot_that_ends_an_inline_run_is_named),
    ("a_pilot_that_hangs_an_inline_run_can_be_interrupted", a_pilot_that_hangs_an_inline_run_can_be_interrupted),
    ("drones_of_a_shared_process_fail_alone", drones_of_a_shared_process_fail_alone),
    ("a_program_without_its_pilot_in_the_air_says_so", a_program_without_its_pilot_in_the_air_says_so),
];

/// A folder for one test.
struct Bench {
    folder: PathBuf,
}

impl Bench {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes a scenario: a V of six drones in the open that flies for three seconds, and these tables.
    fn scenario(&self, tables: &str) -> PathBuf {
        let path = self.path("own.toml");
        let head = "[formation]\nshape = \"v\"\ndrones = 6\nspacing_m = 60\n[time]\ntimeout_s = 3\n[mission]\nstop_x_m = 1e5\n";
        std::fs::write(&path, format!("{head}{tables}")).unwrap();
        path
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.env(APP, "1").current_dir(&self.folder).args(words);
        command
    }

    fn output(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    /// Flies and returns the summary.
    fn fly(&self, scenario: &Path, more: &[&str]) -> Value {
        let out = self.path("run");
        let words = ["run", scenario.to_str().unwrap(), "--json", "--force", "--out", out.to_str().unwrap()];
        let output = self.command(&words).args(more).output().unwrap();
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output.stderr)))
    }

    /// Flies inline and in processes, and returns the summary of the latter. The digests must be equal.
    fn fly_both(&self, scenario: &Path, more: &[&str]) -> Value {
        let inline = self.fly(scenario, &[&["--runtime", "inline", "--no-record"], more].concat());
        let processes = self.fly(scenario, &[&["--no-record"], more].concat());
        assert!(inline["digest"].is_string(), "{inline}");
        assert_eq!(inline["digest"], processes["digest"]);
        processes
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn both_runtimes_fly_own_pilots_with_equal_digests(bench: &Bench) {
    let scenario = bench.scenario("[[pilot]]\nname = \"drift\"\nparams = { gain_per_s = 0.4 }\n");
    let summary = bench.fly_both(&scenario, &[]);
    let pilots = summary["pilots"].as_array().unwrap();
    assert_eq!((pilots.len(), &pilots[0]["name"]), (1, &Value::from("drift")));
    assert_eq!(pilots[0]["params"]["gain_per_s"], 0.4);
    assert_eq!(pilots[0]["program"].as_str().unwrap().len(), 16);
    let packed = bench.fly(&scenario, &["--no-record", "--drones-per-process", "4"]);
    assert_eq!(packed["digest"], summary["digest"]);
    let other = bench.fly(&scenario, &["--no-record", "--set", "pilot.0.params.gain_per_s=0.5"]);
    assert_ne!(other["digest"], summary["digest"]);
    let named =
        bench.fly(&bench.scenario(""), &["--no-record", "--pilot", "drift", "--set", "pilot.0.params.gain_per_s=0.4"]);
    assert_eq!(named["digest"], summary["digest"]);
    // What pilots print does not get into the launcher's JSON.
    let loud = bench.scenario("[[pilot]]\nname = \"loud\"\n");
    bench.fly_both(&loud, &[]);
}

fn a_mixed_swarm_survives_faults_and_loss(bench: &Bench) {
    let scenario = bench.scenario(
        r#"
        [[pilot]]
        name = "drift"
        drones = [1, 2, 4]
        [radio]
        loss = 0.5
        [[fault]]
        kind = "kill"
        drone = 1
        at_s = 0.5
        [[fault]]
        kind = "freeze"
        drone = 2
        at_s = 0.5
        for_s = 1.0
        [[fault]]
        kind = "restart"
        drone = 4
        at_s = 0.7
        for_s = 0.5
        "#,
    );
    let summary = bench.fly_both(&scenario, &[]);
    let names: Vec<_> = summary["pilots"].as_array().unwrap().iter().map(|pilot| pilot["name"].clone()).collect();
    assert_eq!(names, ["drift", "paper"]);
    assert_eq!(summary["pilots"][1]["drones"], serde_json::json!([0, 3, 5]));
    let kinds: Vec<_> = summary["faults"].as_array().unwrap().iter().map(|fault| fault["kind"].clone()).collect();
    assert!(kinds.contains(&"kill".into()) && kinds.contains(&"freeze".into()), "{kinds:?}");
}

fn wrong_names_and_parameters_are_refused(bench: &Bench) {
    let refused = |tables: &str, more: &[&str]| {
        let path = bench.scenario(tables);
        let output = bench.command(&["run", path.to_str().unwrap()]).args(more).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
        assert!(!bench.path("runs").exists(), "nothing is started");
        text(&output.stderr)
    };
    let name = refused("[[pilot]]\nname = \"drifd\"\n", &[]);
    assert!(name.contains("own.toml:10:8: pilot.0.name: found \"drifd\""), "{name}");
    assert!(name.contains("\"drift\"") && name.contains("did you mean `drift`?"), "{name}");
    let value = refused("[[pilot]]\nname = \"drift\"\nparams = { gain_per_s = \"much\" }\n", &[]);
    let wanted = "own.toml:11:25: pilot.0.params.gain_per_s: expected a number, but found \"much\" (pilot \"drift\")";
    assert!(value.contains(wanted), "{value}");
    let set = refused("", &["--pilot", "drift", "--set", "pilot.0.params.gain_per_s=-1"]);
    assert!(set.contains("--set pilot.0.params.gain_per_s=-1: pilot.0.params.gain_per_s: expected"), "{set}");
    let inline = refused("[[pilot]]\ncommand = [\"python3\", \"x.py\"]\n", &["--runtime", "inline"]);
    assert!(inline.contains("own.toml:10:11: pilot.0.command: a program of its own cannot fly inline"), "{inline}");
}

fn a_program_of_its_own_flies_some_drones(bench: &Bench) {
    // The launcher is `skein` with the built-in pilots; this application is the program of the pilot.
    let program = std::env::current_exe().unwrap();
    let table =
        format!("[[pilot]]\nname = \"drift\"\ncommand = [{:?}]\ndrones = [1, 2, 5]\n", program.display().to_string());
    let scenario = bench.scenario(&table);
    let launch = |path: &Path, more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skein"));
        command.env(APP, "1").current_dir(&bench.folder).args(["run", path.to_str().unwrap(), "--json", "--no-record"]);
        let output = command.args(["--force", "--out", "out"]).args(more).output().unwrap();
        (
            output.status.code(),
            serde_json::from_slice::<Value>(&output.stdout).unwrap_or_default(),
            text(&output.stderr),
        )
    };
    let (_, summary, errors) = launch(&scenario, &[]);
    let here = bench.fly(&bench.scenario("[[pilot]]\nname = \"drift\"\ndrones = [1, 2, 5]\n"), &["--no-record"]);
    assert_eq!(summary["digest"], here["digest"], "{errors}");
    assert_eq!(summary["pilots"][0]["program"], here["pilots"][0]["program"]);
    let packed = launch(&bench.scenario(&table), &["--drones-per-process", "3"]).1;
    assert_eq!(packed["digest"], here["digest"]);
    let wrong = bench.scenario(&format!("{table}params = {{ gain_per_s = -1 }}\n"));
    let (code, _, errors) = launch(&wrong, &[]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("pilot.0.params.gain_per_s: expected"), "{errors}");
}

fn sweep_and_replay_know_the_pilots(bench: &Bench) {
    let scenario = bench.scenario("[[pilot]]\nname = \"drift\"\n");
    let run = bench.fly(&scenario, &[]);
    assert_eq!(run["metrics_own"]["gain"]["max"], 0.1);
    let manifest: Value = serde_json::from_slice(&std::fs::read(bench.path("run/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["facts"]["topics"][0]["topic"], "drift", "the recording has its schema");
    let page = std::fs::read_to_string(bench.path("run/report.html")).unwrap();
    assert!(page.contains("<figure id=\"metrics\">") && bench.path("run/plots/metrics.svg").exists());
    let replayed = |runtime: &str| bench.output(&["replay", "run", "--runtime", runtime]);
    for runtime in ["inline", "processes"] {
        let output = replayed(runtime);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    }
    // Without the pilot, or with another program, the run cannot be repeated.
    let bare =
        Command::new(env!("CARGO_BIN_EXE_skein")).args(["replay", "run"]).current_dir(&bench.folder).output().unwrap();
    assert!(bare.status.code() == Some(2) && text(&bare.stderr).contains("found \"drift\""), "{}", text(&bare.stderr));
    let manifest = bench.path("run").join("manifest.json");
    let hash = run["pilots"][0]["program"].as_str().unwrap();
    let changed = std::fs::read_to_string(&manifest).unwrap().replace(hash, "00000000000000ff");
    std::fs::write(&manifest, changed).unwrap();
    let other = replayed("inline");
    assert_eq!(other.status.code(), Some(2));
    assert!(text(&other.stderr).contains("was flown by another program"), "{}", text(&other.stderr));
    let experiment =
        "name = \"e\"\nscenario = [\"own.toml\"]\nseeds = [1]\n[grid]\n\"pilot.0.params.gain_per_s\" = [0.2, 0.4]\n";
    std::fs::write(bench.path("e.toml"), experiment).unwrap();
    let sweep = bench.output(&["sweep", "e.toml", "--json", "--jobs", "1"]);
    assert_eq!(sweep.status.code(), Some(0), "{}", text(&sweep.stderr));
    let csv = std::fs::read_to_string(bench.path("sweeps/e/runs.csv")).unwrap();
    assert!(csv.lines().next().unwrap().contains(",metric.gain,"), "{csv}");
    assert!(bench.path("sweeps/e/plots/metric.gain.svg").exists());
    // What is wrong is named with its place: in the experiment, in the scenario, in the manifest.
    let refused = |words: &[&str], wanted: &str| {
        let output = bench.output(words);
        let errors = text(&output.stderr);
        assert!(output.status.code() == Some(2) && errors.contains(wanted), "expected {wanted:?} in:\n{errors}");
    };
    std::fs::write(bench.path("f.toml"), experiment.replace("0.4", "-0.4")).unwrap();
    refused(
        &["sweep", "f.toml"],
        "skein: f.toml:5:37: pilot.0.params.gain_per_s: expected a number from 0, found -0.4",
    );
    refused(&["hunt", "f.toml"], "skein: f.toml:5:37: pilot.0.params.gain_per_s: expected a number from 0, found -0.4");
    bench.scenario("[[pilot]]\nname = \"drift\"\nparams = { gain_per_s = -1 }\n");
    let plain = experiment.split_once("[grid]").unwrap().0;
    std::fs::write(bench.path("g.toml"), plain).unwrap();
    refused(&["sweep", "g.toml"], "skein: g.toml: own.toml:11:25: pilot.0.params.gain_per_s: expected a number from 0");
    let changed = std::fs::read_to_string(&manifest).unwrap();
    let empty = "\"name\": \"drift\",";
    assert!(changed.contains(empty), "{changed}");
    std::fs::write(&manifest, changed.replacen(empty, &format!("{empty} \"params\": {{ \"gain_per_s\": -1 }},"), 1))
        .unwrap();
    refused(
        &["replay", "run"],
        "skein: run/manifest.json: scenario.pilot.0.params.gain_per_s: expected a number from 0",
    );
}

/// The table of a pilot that makes a mistake after half a second.
fn clumsy(how: &str) -> String {
    format!("[[pilot]]\nname = \"clumsy\"\ndrones = [2]\nparams = {{ how = {how:?} }}\n[[pilot]]\nname = \"drift\"\n")
}

/// The only failure of a summary: that of drone 2 after half a second.
fn reason(summary: &Value) -> String {
    let failures = summary["failures"].as_array().unwrap();
    assert_eq!(failures.len(), 1, "{failures:?}");
    assert_eq!((&failures[0]["drone"], &failures[0]["pilot"]), (&Value::from(2), &Value::from("clumsy")));
    assert!((0.48..0.56).contains(&failures[0]["t_s"].as_f64().unwrap()), "{failures:?}");
    let faults = summary["faults"].as_array().unwrap();
    assert!(faults.iter().any(|fault| fault["target"] == 2 && fault["scheduled"] == false), "{faults:?}");
    assert_eq!(summary["ticks"], 150, "the others fly on");
    failures[0]["reason"].as_str().unwrap().to_owned()
}

fn a_failing_pilot_is_named_and_the_others_fly_on(bench: &Bench) {
    let wrong = [
        ("panic", "panicked at "),
        ("nan", "it commanded Acceleration([NaN, 0.0, 0.0]), which is not finite"),
        ("flood", "it said 65 messages in a tick, 64 at most"),
        ("oversize", "the message has 273 bytes"),
        ("say", "it gives up"),
    ];
    for (how, expected) in wrong {
        let summary = bench.fly_both(&bench.scenario(&clumsy(how)), &[]);
        let reason = reason(&summary);
        assert!(reason.contains(expected), "{how}: {reason}");
    }
    let path = bench.scenario(&clumsy("panic"));
    let output = bench.output(&["run", path.to_str().unwrap(), "--quiet", "--no-record"]);
    let errors = text(&output.stderr);
    assert_eq!(errors.lines().filter(|line| line.contains("panicked")).count(), 1, "{errors}");
    assert!(errors.contains("the pilot of drone 2 failed: panicked at ") && !errors.contains("backtrace"), "{errors}");
}

fn a_process_that_ends_or_hangs_is_a_failure(bench: &Bench) {
    let wrong = [
        ("exit", "its process exited with code 7"),
        ("abort", "its process was ended by signal 6"),
        ("hang", "it did not answer for 0.5 s and was killed"),
    ];
    for (how, expected) in wrong {
        let summary = bench.fly(&bench.scenario(&clumsy(how)), &["--no-record", "--patience", "0.5"]);
        assert_eq!(reason(&summary), expected);
    }
}

fn a_program_of_another_version_is_refused_with_words(bench: &Bench) {
    let program = std::env::current_exe().unwrap().display().to_string();
    let table = format!("[[pilot]]\nname = \"drift\"\ncommand = [{program:?}]\ndrones = [1]\n");
    let path = bench.scenario(&table);
    let mut command = Command::new(env!("CARGO_BIN_EXE_skein"));
    command.env(APP, "1").current_dir(&bench.folder).args(["run", path.to_str().unwrap(), "--no-record"]);
    let other = skein_bus::Version { minor: skein_bus::Version::OWN.minor + 7, ..skein_bus::Version::OWN };
    let word =
        [other.major, other.minor, other.wire, other.layout].iter().fold(0, |word, &n| word << 16 | u64::from(n));
    let output = command.env(OTHER_VERSION, word.to_string()).output().unwrap();
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{errors}");
    let wanted =
        format!("drone 1, pilot \"drift\": {program} is built with {other}, expected {}", skein_bus::Version::OWN);
    assert!(errors.contains(&wanted) && errors.contains("build it again with this version"), "{errors}");
    assert!(wanted.contains(&format!("Skein 0.{} (messages of version", other.minor)), "{wanted}");
}

fn a_forked_process_never_flies(bench: &Bench) {
    let alone = bench.fly_both(&bench.scenario(&clumsy("nothing")), &[]);
    for how in ["fork", "fork at birth"] {
        let path = bench.scenario(&clumsy(how));
        for runtime in ["inline", "processes"] {
            let words = ["run", path.to_str().unwrap(), "--json", "--no-record", "--force", "--out", "run"];
            let output = bench.command(&words).args(["--runtime", runtime]).output().unwrap();
            let errors = text(&output.stderr);
            assert!(errors.contains("which the pilot of drone 2 forked, is ended: only the process"), "{errors}");
            let summary: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{errors}"));
            assert_eq!(summary["digest"], alone["digest"], "{how}, {runtime}: the drone flies on");
            assert_eq!(summary["failures"], serde_json::json!([]));
        }
    }
}

fn a_pilot_that_ends_an_inline_run_is_named(bench: &Bench) {
    for (how, threads) in [("exit", "1"), ("exit", "2"), ("exit at birth", "1")] {
        let path = bench.scenario(&clumsy(how));
        let words = ["run", path.to_str().unwrap(), "--json", "--force", "--out", "run", "--runtime", "inline"];
        // More drones than one thread takes at a time.
        let done = bench.command(&words).args(["--threads", threads, "--set", "formation.drones=20"]).output().unwrap();
        let errors = text(&done.stderr);
        assert_eq!(done.status.code(), Some(3), "{how}, {threads}: {errors}");
        assert!(
            errors.contains("skein: the pilot of drone 2 ended the process, and with it the run"),
            "{how}: {errors}"
        );
    }
    // A process that the pilot forks may end as it likes.
    let alone = bench.fly(&bench.scenario(&clumsy("nothing")), &["--runtime", "inline"]);
    let forked = bench.fly(&bench.scenario(&clumsy("fork and exit")), &["--runtime", "inline"]);
    assert_eq!(forked["digest"], alone["digest"]);
}

fn a_pilot_that_hangs_an_inline_run_can_be_interrupted(bench: &Bench) {
    let path = bench.scenario(&clumsy("hang"));
    let words = ["run", path.to_str().unwrap(), "--force", "--out", "run", "--runtime", "inline", "--threads", "2"];
    // The signals, and within which time after the last one the run ends, s.
    let cases: [(&[&str], i32, [f64; 2]); 2] = [(&["INT"], 130, [2.0, 4.0]), (&["INT", "TERM"], 143, [0.0, 1.5])];
    for (signals, code, [least_s, most_s]) in cases {
        let mut command = bench.command(&words);
        command.args(["--set", "formation.drones=20"]).stderr(Stdio::piped());
        let mut flight = command.spawn().unwrap();
        let mut errors = BufReader::new(flight.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("it hangs") {
            line.clear();
            assert!(errors.read_line(&mut line).unwrap() > 0, "the run has ended");
        }
        let mut asked = Instant::now();
        for signal in signals {
            std::thread::sleep(Duration::from_millis(500));
            asked = Instant::now();
            assert!(Command::new("kill").args(["-s", signal, &flight.id().to_string()]).status().unwrap().success());
        }
        let status = flight.wait().unwrap();
        let took_s = asked.elapsed().as_secs_f64();
        let mut said = String::new();
        errors.read_to_string(&mut said).unwrap();
        assert_eq!(status.code(), Some(code), "{said}");
        assert!((least_s..most_s).contains(&took_s), "{signals:?}: {took_s} s");
        assert!(said.contains("the pilot of drone 2 does not return"), "{said}");
        let report = bench.output(&["report", "run"]);
        assert_eq!(report.status.code(), Some(0), "{}", text(&report.stderr));
    }
}

fn drones_of_a_shared_process_fail_alone(bench: &Bench) {
    let scenario = bench.scenario(&clumsy("panic"));
    let alone = bench.fly(&scenario, &["--no-record"]);
    let packed = bench.fly(&scenario, &["--no-record", "--drones-per-process", "3"]);
    assert_eq!(packed["digest"], alone["digest"]);
    assert_eq!(reason(&packed), reason(&alone));
}

fn a_program_without_its_pilot_in_the_air_says_so(bench: &Bench) {
    let path = bench.scenario("");
    let output = bench.output(&["run", path.to_str().unwrap(), "--runtime", "inline", "--no-record"]);
    let errors = text(&output.stderr);
    assert!(errors.contains("warning: no drone flies with a pilot of this program (clumsy, drift, loud)"), "{errors}");
}
