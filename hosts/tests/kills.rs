//! A host is killed at many moments: in the start, in flight, after the end. No process hangs, and nothing is left.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::io::Read;
use std::time::Duration;
use support::{Place, children_of, free_endpoint, wait, wait_until};

/// Number of kills; the variable of the environment sets another one.
fn kills() -> u32 {
    std::env::var("HOST_KILLS").map_or(8, |text| text.parse().unwrap())
}

/// A moment between 0 and 1.2 s that looks random and is the same in each run.
fn moment(number: u32) -> Duration {
    let mut state = u64::from(number) + 1;
    for _ in 0..3 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state ^= state >> 33;
    }
    Duration::from_micros(state % 1_200_000)
}

#[test]
fn a_host_that_is_killed_at_any_moment_leaves_nothing() {
    let place = Place::new();
    let scenario = place.scenario("");
    let mut named = 0;
    for number in 0..kills() {
        let mut host = place.host("a", &free_endpoint(), &[]);
        let args = ["run", &scenario, "--json", "--no-record", "--hosts", "a=4", "--connect", &host.endpoint];
        let mut flight = place.command(&args).spawn().unwrap();
        std::thread::sleep(moment(number));
        let processes = [children_of(host.pid()), children_of(flight.id())].concat();
        host.kill();
        let status = wait(&mut flight);
        let (mut out, mut err) = (String::new(), String::new());
        flight.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        flight.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        let moment = moment(number);
        match status.code() {
            // It was killed after the end, or in flight: then the summary names its drones.
            Some(0 | 1) => {
                let summary: Value = serde_json::from_str(&out).unwrap();
                let faults = summary["faults"].as_array().unwrap();
                let gone = faults.iter().filter(|fault| fault["kind"] == "host-down").count();
                assert!(gone == 0 || gone == 4, "{moment:?}: {faults:?}");
                assert_eq!(gone == 4, err.contains("host a is gone"), "{moment:?}: {err}");
                named += u32::from(gone == 4);
            }
            // It was killed in the start: the message names it.
            Some(2 | 3) => {
                assert!(err.contains("host a"), "{moment:?}: {err}");
                named += 1;
            }
            code => panic!("{moment:?}: {code:?}, {err}"),
        }
        let alive = |pid: &u32| {
            std::path::Path::new(&format!("/proc/{pid}/fd")).read_dir().is_ok_and(|mut fds| fds.next().is_some())
        };
        wait_until("all processes end", Duration::from_secs(2), || !processes.iter().any(alive));
    }
    assert!(named > 0, "no kill hit a run");
    // A host cleans up what it left when it starts again.
    drop(place.host("a", &free_endpoint(), &[]));
    if let Ok(entries) = std::fs::read_dir(place.path().join("x/skein")) {
        let left: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).filter(|name| name != "lock").collect();
        assert!(left.is_empty(), "{left:?}");
    }
}
