//! Nothing of a flight is lost: not if the disk is full, the launcher is killed, two runs want one folder, or links are laid.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::fs::{self, File};
use std::os::unix::fs::{chown, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use support::process::signal;
use support::{Place, json, names, number, paper};

/// Flies in one thread.
const INLINE: [&str; 2] = ["--runtime", "inline"];
/// Short ticks: the record is large, and its files take some seconds to write.
const SHORT_TICKS: [&str; 4] = ["--runtime", "inline", "--set", "time.dt_s=0.002"];
/// A wall clock by which the flight takes about three seconds.
const REALTIME: [&str; 2] = ["--clock", "realtime:20"];

/// A small disk, mounted on a folder of a test.
struct Disk(PathBuf);

impl Disk {
    /// `None`, with the reason printed, if this user may not mount one.
    fn mount(place: &Place, size: &str) -> Option<Self> {
        let path = place.join("disk");
        fs::create_dir(&path).unwrap();
        let mount =
            Command::new("mount").args(["-t", "tmpfs", "-o", &format!("size={size}"), "skein"]).arg(&path).output();
        if mount.as_ref().is_ok_and(|done| done.status.success()) {
            return Some(Self(path));
        }
        eprintln!("skipped: a disk cannot be mounted: {mount:?}");
        None
    }

    fn resize(&self, size: &str) {
        let options = format!("remount,size={size}");
        assert!(Command::new("mount").args(["-o", &options]).arg(&self.0).status().unwrap().success());
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// The last time in a trace, s.
fn traced_s(folder: &Path) -> f64 {
    let trace = fs::read_to_string(folder.join("trace.csv")).unwrap();
    trace.lines().last().unwrap().split(',').next().unwrap().parse().unwrap()
}

#[test]
fn a_full_disk_costs_no_record_that_it_holds() {
    let place = Place::new();
    let Some(disk) = Disk::mount(&place, "2m") else { return };
    let out = disk.0.join("out");
    let run = ["run", &paper("s2-right"), "--json", "--out", out.to_str().unwrap()];
    let done = place.run(&[&run[..], &INLINE].concat());
    assert_eq!(done.code, Some(3), "{done:?}");
    assert!(done.stderr.contains("skein report"), "{done:?}");
    assert_eq!(done.summary()["outcome"], "reached");
    let mut kept = json(out.join("summary.json"));
    kept["report_s"] = Value::Null;
    assert_eq!(kept, done.summary(), "the summary is in the folder as well");
    let held = fs::metadata(out.join("flight.spool")).unwrap().len();
    assert!(held > 1_700_000, "the disk had room for more than {held} bytes of the record");
    disk.resize("64m");
    let report = place.run(&["report", out.to_str().unwrap()]);
    assert_eq!(report.code, Some(0), "{report:?}");
    // A tick of eight drones takes about 3300 bytes.
    let wanted_s = held as f64 / 4000.0 * 0.02;
    assert!(traced_s(&out) > wanted_s, "{} s of {wanted_s} s", traced_s(&out));
    assert!(out.join("report.html").exists() && !out.join("flight.spool").exists(), "{:?}", names(&out));
}

/// Flies with a limit of so many KiB per file (`ulimit -f`).
fn with_file_limit(place: &Place, limit_kib: u32, options: &[&str]) -> Output {
    let flown = place.command(&[&["run", &paper("s2-right"), "--json", "--out", "out", "--force"], options].concat());
    let words = flown.get_args().map(|word| word.to_str().unwrap()).collect::<Vec<_>>().join(" ");
    // In blocks of 512 bytes.
    let script = format!("ulimit -f {}; exec {} {words}", 2 * limit_kib, env!("CARGO_BIN_EXE_skein"));
    Command::new("sh").args(["-c", &script]).current_dir(place.join("")).output().unwrap()
}

#[test]
fn a_file_that_reaches_the_limit_of_sizes_is_an_error_with_words() {
    let place = Place::new();
    for (runtime, limit_kib, word) in [
        ("inline", 4, "File too large"),
        ("inline", 256, "File too large"),
        ("processes", 4, "File too large"),
        // Files in shared memory reach it first.
        ("processes", 100, "`ulimit -f`"),
        ("processes", 1024, "`ulimit -f`"),
    ] {
        let done = with_file_limit(&place, limit_kib, &["--runtime", runtime]);
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(3), "{runtime}, {limit_kib} KiB: {said}");
        assert!(said.contains(word), "{runtime}, {limit_kib} KiB: {said}");
    }
}

#[test]
fn a_record_that_was_cut_short_is_written_up() {
    let place = Place::new();
    // The page would be larger than 1 MiB.
    let done = with_file_limit(&place, 1024, &INLINE);
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(said.contains("File too large"), "{said}");
    assert_eq!(done.status.code(), Some(3), "{done:?}");
    let summary: Value = serde_json::from_slice(&done.stdout).unwrap();
    assert_eq!(
        (summary["outcome"].as_str(), json(place.join("out/summary.json"))["digest"].clone()),
        (Some("reached"), summary["digest"].clone())
    );
    assert!(place.join("out/trace.csv").exists() || place.join("out/flight.spool").exists());
}

#[test]
fn the_record_of_a_killed_launcher_is_written_up() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &REALTIME);
    flight.wait_until(5.0);
    let busy = place.run(&["report", "out"]);
    assert!(busy.code == Some(2) && busy.stderr.contains("at work"), "{busy:?}");
    signal("KILL", flight.pid());
    let pid = flight.pid();
    assert_eq!(flight.end().code, None);
    let early = place.run(&["replay", "out"]);
    assert!(early.code == Some(2) && early.stderr.contains("skein report"), "{early:?}");
    let report = place.run(&["report", "out"]);
    assert_eq!(report.code, Some(0), "{report:?}");
    let summary = json(place.join("out/summary.json"));
    assert_eq!(summary["outcome"], "aborted");
    assert!(number(&summary, "/sim_s") >= 5.0 && traced_s(&place.join("out")) >= 5.0, "{summary}");
    assert!(place.join("out/run.mcap").exists() && !place.join("out/flight.spool").exists());
    assert_eq!(place.run(&["clean"]).code, Some(0));
    assert_eq!(support::process::shared_files(pid), Vec::<String>::new());
}

#[test]
fn a_lost_terminal_ends_the_run_as_an_interruption_does() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &REALTIME);
    flight.wait_until(1.0);
    signal("HUP", flight.pid());
    let done = flight.finish();
    assert_eq!(done.code, Some(129), "{done:?}");
    assert_eq!(json(place.join("out/summary.json"))["outcome"], "aborted");
    assert!(traced_s(&place.join("out")) >= 1.0);
}

#[test]
fn an_interruption_stops_the_writing_and_keeps_the_record() {
    let place = Place::new();
    let mut flight = place.take_off("s2-right", &SHORT_TICKS);
    // The summary comes first, then the other files.
    flight.wait_for(&place.join("out/summary.json"));
    let asked = Instant::now();
    signal("INT", flight.pid());
    let done = flight.finish();
    assert!(asked.elapsed() < Duration::from_secs(2), "{:?}", asked.elapsed());
    assert_eq!(done.code, Some(130), "{done:?}");
    assert_eq!(done.summary()["outcome"], "reached");
    assert_eq!(names(place.join("out")), ["flight.spool", "manifest.json", "processes.json", "summary.json"]);
    let report = place.run(&["report", "out"]);
    assert_eq!(report.code, Some(0), "{report:?}");
    assert!(place.join("out/report.html").exists() && !place.join("out/flight.spool").exists());
}

#[test]
fn a_folder_in_use_is_refused() {
    let place = Place::new();
    let mut first = place.take_off("s2-right", &REALTIME);
    first.processes();
    let second = place.run(&["run", &paper("s1-left"), "--json", "--out", "./out", "--force", "--runtime", "inline"]);
    assert!(second.code == Some(2) && second.stderr.contains("at work"), "{second:?}");
    let done = first.finish();
    assert_eq!(done.code, Some(0), "{done:?}");
    assert!(traced_s(&place.join("out")) > 40.0);
    let third = place.run(&["run", &paper("s1-left"), "--json", "--out", "out", "--force", "--runtime", "inline"]);
    assert_eq!(third.code, Some(0), "{third:?}");
}

#[test]
fn nothing_is_written_through_links() {
    let place = Place::new();
    let mine = place.join("mine.txt");
    fs::write(&mine, "mine").unwrap();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    let laid = [
        ".summary.json.part",
        ".manifest.json.part",
        "summary.json",
        "trace.csv",
        "run.mcap",
        "report.html",
        "flight.spool",
    ];
    for name in laid {
        let _ = fs::remove_file(place.join("out").join(name));
        symlink(&mine, place.join("out").join(name)).unwrap();
    }
    place.fly("s1-left", &["--runtime", "inline", "--out", "out", "--force"]);
    assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
    assert!(!fs::symlink_metadata(place.join("out/summary.json")).unwrap().is_symlink());
}

#[test]
fn the_folder_of_another_user_is_refused() {
    let place = Place::new();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out"]);
    if chown(place.join("out"), Some(12345), None).is_err() {
        eprintln!("skipped: this user cannot give a folder away");
        return;
    }
    let sweep = format!("{}/../experiments/faults.toml", env!("CARGO_MANIFEST_DIR"));
    let run = ["run", &paper("s1-left"), "--runtime", "inline", "--out", "out", "--force"];
    fs::create_dir(place.join("empty")).unwrap();
    chown(place.join("empty"), Some(12345), None).unwrap();
    for args in [&run[..], &["report", "out"], &["sweep", &sweep, "--out", "empty"]] {
        let refused = place.run(args);
        assert!(refused.code == Some(2) && refused.stderr.contains("user 12345"), "{refused:?}");
    }
}

#[test]
fn a_full_stdout_is_a_failure_and_costs_no_file() {
    let place = Place::new();
    let full = || Stdio::from(File::options().write(true).open("/dev/full").unwrap());
    let scenario = paper("s1-left");
    let run = [&["run", &scenario, "--json", "--out", "out"], &INLINE[..]].concat();
    let done = place.command(&run).stdout(full()).output().unwrap();
    assert_eq!(done.status.code(), Some(3), "{done:?}");
    assert!(place.join("out/report.html").exists());
    assert_eq!(json(place.join("out/summary.json"))["outcome"], "reached");
    for args in [&["report", "out"][..], &["doctor"], &["schema", "summary"], &["check", &scenario], &["--help"]] {
        let done = place.command(args).stdout(full()).output().unwrap();
        assert_eq!(done.status.code(), Some(3), "{args:?}: {done:?}");
        let done = place.command(args).stdout(full()).stderr(full()).output().unwrap();
        assert_eq!(done.status.code(), Some(3), "{args:?} without stderr: {done:?}");
    }
}

/// Runs `script` with a shared memory of this size for itself; `$1` is the program, `$2` the scenario. `None`, with the reason
/// printed, if this user may not have one.
fn with_shared_memory(place: &Place, size: &str, script: &str) -> Option<Output> {
    let mounted = format!("mount -t tmpfs -o size={size} skein /dev/shm || exit 99; {script}");
    let words = ["-c", &mounted, "sh", env!("CARGO_BIN_EXE_skein"), &paper("s2-right")];
    let run = Command::new("unshare")
        .args(["--mount", "sh"])
        .args(words)
        .current_dir(place.join(""))
        .env("XDG_RUNTIME_DIR", place.join("x"))
        .output();
    match run {
        Ok(done) if done.status.code() != Some(99) && !done.stderr.starts_with(b"unshare:") => Some(done),
        other => {
            eprintln!("skipped: a shared memory of its own cannot be mounted: {other:?}");
            None
        }
    }
}

#[test]
fn a_run_that_does_not_fit_into_shared_memory_is_refused_with_both_numbers() {
    let place = Place::new();
    for size in ["100k", "2m"] {
        let Some(done) = with_shared_memory(&place, size, "\"$1\" run \"$2\" --out out; echo $?; ls /dev/shm") else {
            return;
        };
        assert_eq!(String::from_utf8_lossy(&done.stdout), "3\n", "{size}: {done:?}");
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(said.contains("shared memory") && said.contains("needed") && said.contains("free"), "{size}: {said}");
        assert!(!place.join("out").exists(), "{size}: {said}");
    }
}

/// Waits, in a script, until a run has begun its first tick. Before, it still takes pages.
const FIRST_TICK: &str = "until \"$1\" topic echo senses --count 1 >first.txt 2>&1; do sleep 0.01; done;";

/// A run that has started does not need another page.
#[test]
fn a_full_shared_memory_does_not_end_a_run_that_has_started() {
    // In lockstep the run must last until all is filled and the observer has looked.
    for (clock, dt_s) in [("realtime:20", 0.005), ("lockstep", 0.001)] {
        let place = Place::new();
        let script = format!(
            "\"$1\" run \"$2\" --json --out out --clock {clock} --set time.dt_s={dt_s} & {FIRST_TICK} \
             dd if=/dev/zero of=/dev/shm/others bs=4k 2>dd.txt; cp dd.txt filled.txt; \
             \"$1\" topic echo senses --count 1 >observer.txt 2>&1; wait $!"
        );
        let Some(done) = with_shared_memory(&place, "64m", &script) else { return };
        assert_eq!(done.status.code(), Some(0), "{clock}: {done:?}");
        let summary: Value = serde_json::from_slice(&done.stdout).unwrap();
        assert_eq!(
            (&summary["outcome"], &summary["faults"]),
            (&"reached".into(), &Value::Array(Vec::new())),
            "{clock}"
        );
        let filled = fs::read_to_string(place.join("filled.txt")).unwrap();
        assert!(filled.contains("No space left"), "{clock}: {filled}");
        let observer = fs::read_to_string(place.join("observer.txt")).unwrap();
        assert!(observer.contains("shared memory is full"), "{clock}: {observer}");
    }
}

/// The run keeps what a restarted drone needs. Drone 4 is killed at 20 s and 35 s and gets a new process 5 s later, while files of
/// others fill all that is free.
#[test]
fn a_full_shared_memory_does_not_keep_a_drone_from_its_restart() {
    let faults = "fault=[{kind=\"restart\", at_s=20, drone=4, for_s=5}, {kind=\"restart\", at_s=35, drone=4, for_s=5}]";
    // Little is free, so that it is filled long before the first restart.
    for (clock, dt_s) in [("realtime:5", "0.01"), ("lockstep", "0.0005")] {
        let place = Place::new();
        let script = format!(
            "\"$1\" run \"$2\" --json --out out --clock {clock} --set time.dt_s={dt_s} --set '{faults}' & {FIRST_TICK} \
             dd if=/dev/zero of=/dev/shm/others bs=4k 2>dd.txt; cp dd.txt filled.txt; wait $!"
        );
        let Some(done) = with_shared_memory(&place, "20m", &script) else { return };
        assert!(matches!(done.status.code(), Some(0 | 1)), "{clock}: {done:?}");
        let told = support::faults(&place.join("out"));
        let kinds: Vec<_> = told.iter().map(|fault| (fault["kind"].as_str().unwrap(), &fault["scheduled"])).collect();
        let said = String::from_utf8_lossy(&done.stderr);
        assert_eq!(kinds, [("restart", &Value::Bool(true)); 2], "{clock}: {told:?}, {said}");
        let filled = fs::read_to_string(place.join("filled.txt")).unwrap();
        assert!(filled.contains("No space left"), "{clock}: {filled}");
        let lived = fs::read_to_string(place.join("out/processes.json")).unwrap();
        assert_eq!(lived.matches("\"id\": 4,").count(), 3, "{clock}: three processes flew drone 4: {lived}");
    }
}

#[test]
fn a_start_that_fails_leaves_no_folder() {
    let place = Place::new();
    let long = place.join(&"x".repeat(120));
    fs::create_dir(&long).unwrap();
    let done =
        place.command(&["run", &paper("s1-left"), "--out", "out"]).env("XDG_RUNTIME_DIR", &long).output().unwrap();
    assert_eq!(done.status.code(), Some(3), "{done:?}");
    assert!(!place.join("out").exists());
}
