//! Several drones per process, and the system calls of a tick.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::{Command, Stdio};
use support::Place;

fn formation(place: &Place, drones: u32, timeout_s: f64) -> String {
    let path = place.join(&format!("formation-{drones}-{timeout_s}.toml"));
    let text = format!(
        "name = \"formation\"\n[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n\
         [drone]\nsafe_distance_m = 37\n[mission]\nstop_x_m = 100000\n[time]\ntimeout_s = {timeout_s}\n"
    );
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn drones_that_share_a_process_fly_as_with_one_process_each() {
    let place = Place::new();
    let scenario = formation(&place, 10, 6.0);
    let fly = |out: &str, more: &[&str]| -> Value {
        let mut args = vec!["run", &scenario, "--json", "--out", out];
        args.extend(more);
        let done = place.run(&args);
        assert_eq!(done.code, Some(1), "it ends by its time: {done:?}");
        done.summary()
    };
    let alone = fly("alone", &["--runtime", "inline"]);
    let packed = fly("packed", &["--drones-per-process", "4"]);
    assert_eq!(alone["digest"], packed["digest"]);
    assert_eq!(alone["messages"]["sent"], packed["messages"]["sent"]);
    let processes: Value =
        serde_json::from_slice(&std::fs::read(place.join("packed/processes.json")).unwrap()).unwrap();
    let drones = || processes.as_array().unwrap().iter().filter(|p| p["role"] == "drone");
    assert_eq!(drones().count(), 10);
    let pids: BTreeSet<u64> = drones().map(|p| p["pid"].as_u64().unwrap()).collect();
    assert_eq!(pids.len(), 3, "ten drones, four a process");
}

#[test]
fn a_process_fault_needs_one_process_per_drone() {
    let place = Place::new();
    let scenario = formation(&place, 4, 6.0);
    let with_fault = place.join("fault.toml");
    let text = std::fs::read_to_string(&scenario).unwrap() + "[[fault]]\nkind = \"kill\"\nat_s = 1\ndrone = 2\n";
    std::fs::write(&with_fault, text).unwrap();
    let done = place.run(&["run", with_fault.to_str().unwrap(), "--drones-per-process", "2"]);
    assert_eq!(done.code, Some(2), "{done:?}");
    assert!(done.stderr.contains("--drones-per-process 2"), "{done:?}");
}

#[test]
fn a_swarm_that_is_too_large_is_refused_with_the_largest_size_that_fits() {
    let place = Place::new();
    let scenario = formation(&place, 64, 6.0);
    let skein = env!("CARGO_BIN_EXE_skein");
    let out = place.join("none");
    let line = format!("ulimit -n 200 && exec {skein} run {scenario} --out {}", out.display());
    let done = Command::new("bash").args(["-c", &line]).output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(3), "{said}");
    assert!(said.contains("64 drones do not fit, 27 do: open files"), "{said}");
    assert!(!out.exists(), "nothing was begun");
}

/// System calls of a whole run, counted by `strace`. `None` if `strace` is missing or may not trace.
fn calls(place: &Place, scenario: &str, wait: &str) -> Option<BTreeMap<String, u64>> {
    let table = place.join(&format!("calls-{wait}"));
    let traced = Command::new("strace")
        .args(["-f", "-c", "-U", "name,calls", "-o", table.to_str().unwrap(), env!("CARGO_BIN_EXE_skein")])
        .args(["run", scenario, "--no-record", "--quiet", "--wait", wait, "--force", "--out"])
        .arg(place.join("traced"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .ok()?;
    (traced.code() == Some(1)).then_some(())?;
    let text = std::fs::read_to_string(table).ok()?;
    let rows = text.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        Some((words.next()?.to_owned(), words.next()?.parse().ok()?))
    });
    Some(rows.filter(|(name, _)| name != "total").collect())
}

#[test]
fn a_steady_tick_makes_no_system_calls_except_those_of_the_barrier() {
    let place = Place::new();
    let flights = [formation(&place, 4, 8.0), formation(&place, 4, 24.0)];
    let Some(counts) = flights.iter().map(|flight| calls(&place, flight, "block")).collect::<Option<Vec<_>>>() else {
        eprintln!("skipped: there is no strace here, or it may not trace");
        return;
    };
    let ticks = 16.0 / 0.02;
    // The launcher polls every millisecond. All others wait for each other.
    let own = ["futex", "epoll_wait", "epoll_pwait2", "epoll_pwait", "restart_syscall"];
    for (name, &count) in &counts[1] {
        let more = count as f64 - counts[0].get(name).copied().unwrap_or(0) as f64;
        if !own.contains(&name.as_str()) {
            assert!(more < 0.05 * ticks, "{name}: {more} more calls in {ticks} ticks");
        }
    }
    let futexes = (counts[1]["futex"] - counts[0]["futex"]) as f64 / ticks / 4.0;
    assert!(futexes > 0.2 && futexes < 4.0, "{futexes} futex calls an agent-step");
}

#[test]
fn the_bench_prints_each_case_and_its_ratio_to_the_baseline() {
    let place = Place::new();
    let args = ["bench", "runtime", "--drones", "2", "--rounds", "1", "--quick", "--compare", "uds", "--json"];
    let done = place.run(&args);
    assert_eq!(done.code, Some(0), "{done:?}");
    let bench: Value = serde_json::from_str(&done.stdout).unwrap();
    let rows = bench["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 8);
    assert!(rows.iter().all(|row| row["ticks_per_s"].as_f64().unwrap() > 0.0), "{rows:?}");
    let block = rows.iter().find(|row| row["case"] == "block").unwrap();
    for key in ["cpu_us_per_step", "switches_per_step", "calls_per_step", "pss_mib", "startup_s", "step_us_p99"] {
        assert!(block[key].as_f64().unwrap() > 0.0, "{key}: {block}");
    }
    let ratios = bench["ratios"].as_array().unwrap();
    let baseline = ratios.iter().filter(|ratio| ratio["to"] == "baseline").count();
    assert_eq!((ratios.len(), baseline), (6, 3), "{ratios:?}");
    for part in ["radio", "grouping", "sense", "record"] {
        let done = place.run(&["bench", part, "--drones", "8", "--rounds", "1", "--json"]);
        let figures: Value = serde_json::from_str(&done.stdout).unwrap();
        let values: Vec<f64> = figures.as_array().unwrap().iter().map(|f| f["value"].as_f64().unwrap()).collect();
        assert!(values.len() >= 2 && values.iter().all(|&value| value > 0.0), "{figures}");
    }
    let done = place.run(&["bench", "clock", "--drones", "3", "--rates", "50", "--seconds", "2", "--freeze", "--json"]);
    let rows: Value = serde_json::from_str(&done.stdout).unwrap_or_else(|_| panic!("{done:?}"));
    assert_eq!((rows[0]["ticks"].as_u64(), rows[0]["drones"].as_u64()), (Some(100), Some(3)), "{rows}");
    assert!(rows[0]["lateness_us_p99"].as_f64().unwrap() >= rows[0]["lateness_us_p50"].as_f64().unwrap());
}
