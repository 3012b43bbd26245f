//! Random signals to the processes of runs, sweeps, views and reports. After each round no process and no shared file is left, nothing
//! hangs, and each promised summary is there. `scripts/soak.sh` flies many rounds.
#![allow(clippy::unwrap_used, reason = "a test fails where it cannot go on")]

mod support;

use serde_json::Value;
use std::fs;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};
use support::process::{Role, is_alive, shared_files};
use support::{Place, json, paper};

/// Rounds of a short soak.
const ROUNDS: u64 = 6;
/// A round that takes longer hangs.
const WATCHDOG: Duration = Duration::from_secs(90);
/// Time between two polls.
const POLL: Duration = Duration::from_millis(5);
/// Signals that a process can be sent.
const SIGNALS: [&str; 5] = ["INT", "TERM", "HUP", "KILL", "STOP"];
/// Most signals to the processes of one run.
const RUN_SIGNALS: usize = 8;
/// Most signals to a sweep, and to a report, before it may complete.
const JOB_SIGNALS: usize = 3;

/// Random numbers by SplitMix64.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// A number below `limit`.
    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    fn pause(&mut self, most: Duration) -> Duration {
        most.mul_f64(self.below(1000) as f64 / 1000.0)
    }
}

/// What was done in a round, for its reader.
#[derive(Debug, Default)]
struct Log {
    said: Vec<String>,
    /// Signals that found their process, a CONT not counted.
    signals: u64,
}

impl Log {
    fn push(&mut self, what: impl Into<String>) {
        self.said.push(what.into());
    }
}

/// A number from the environment.
fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap_or_else(|_| panic!("{name}: {text} is no number")))
}

/// Sends a signal if the process is still there. A stopped process goes on after a while, mostly soon, and sometimes after it counts
/// as hung.
fn send(dice: &mut Dice, pid: u32, who: &str, log: &mut Log) {
    let name = dice.pick(&SIGNALS);
    if !kill(name, pid) {
        return log.push(format!("{name} to {who}, which is gone"));
    }
    log.signals += 1;
    log.push(format!("{name} to {who}"));
    if name == "STOP" {
        let most = if dice.below(8) == 0 { Duration::from_secs(6) } else { Duration::from_millis(800) };
        std::thread::sleep(dice.pause(most));
        kill("CONT", pid);
        log.push(format!("CONT to {who}"));
    }
}

/// Sends a signal to a process. False if it has ended.
fn kill(name: &str, pid: u32) -> bool {
    let script = format!("kill -s {name} {pid}");
    is_alive(pid)
        && std::process::Command::new("sh").args(["-c", &script]).stderr(Stdio::null()).status().unwrap().success()
}

/// Waits for the end of a command. Its exit code; `None` if a signal ended it.
fn wait(child: &mut Child, log: &Log) -> Option<i32> {
    let since = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if since.elapsed() > WATCHDOG {
            let _ = (child.kill(), child.wait());
            panic!("hangs after {log:?}");
        }
        std::thread::sleep(POLL);
    }
}

/// The processes of the run in `out`, as far as it has started them.
fn processes(place: &Place) -> Vec<Role> {
    fs::read(place.join("out/processes.json")).map_or(Vec::new(), |text| support::process::parse(&text))
}

/// Nothing lives, and after a cleaning nothing is left.
fn assert_clean(place: &Place, roles: &[Role], launcher: u32, log: &Log) {
    let alive = || roles.iter().filter(|role| is_alive(role.pid)).collect::<Vec<_>>();
    let since = Instant::now();
    while !alive().is_empty() && since.elapsed() < Duration::from_secs(10) {
        std::thread::sleep(POLL);
    }
    assert!(alive().is_empty(), "{:?} live on after {log:?}", alive());
    // A process that is not in the list yet may outlive its launcher for a moment.
    let left = || [place.runs_in_domain(), shared_files(launcher)].concat();
    loop {
        let clean = place.run(&["clean"]);
        assert_eq!(clean.code, Some(0), "{clean:?} after {log:?}");
        if left().is_empty() {
            return;
        }
        assert!(since.elapsed() < Duration::from_secs(20), "{:?} after {log:?}", left());
    }
}

/// The run's summary, by itself or by `skein report`. A launcher that was killed before its world flew has none.
fn assert_summary(place: &Place, code: Option<i32>, flew: bool, log: &Log) {
    if !place.join("out/summary.json").exists() || place.join("out/flight.spool").exists() {
        let report = place.run(&["report", "out"]);
        assert!(report.code == Some(0) || !flew, "{report:?} after {log:?}");
    }
    if flew || code.is_some_and(|code| [0, 1, 4].contains(&code)) {
        let summary = json(place.join("out/summary.json"));
        assert!(summary["outcome"].is_string() && summary["digest"].is_string(), "{summary} after {log:?}");
    }
}

/// Whether the folder holds the record of at least one tick.
fn flew(place: &Place) -> bool {
    let has = |name: &str| fs::metadata(place.join("out").join(name)).is_ok_and(|meta| meta.len() > 0);
    has("flight.spool") || has("summary.json")
}

/// A run whose processes get signals. Sometimes a view watches it.
fn run(dice: &mut Dice, log: &mut Log) {
    let place = Place::new();
    let (drones, clock) = (dice.pick(&[8, 8, 64]), dice.pick(&["lockstep", "realtime:10"]));
    let step = if clock == "lockstep" && drones == 8 { "0.001" } else { "0.02" };
    let text = format!("[formation]\nshape = \"grid\"\ndrones = {drones}\n[time]\ntimeout_s = 25\ndt_s = {step}\n");
    fs::write(place.join("s.toml"), text).unwrap();
    log.push(format!("a run of {drones} drones in {clock}"));
    let args = ["run", "s.toml", "--quiet", "--out", "out", "--clock", clock];
    let mut launcher = place.command(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let pid = launcher.id();
    let mut watcher = (dice.below(3) == 0).then(|| {
        log.push("a view");
        place.command(&["view"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    });
    for _ in 0..=dice.below(RUN_SIGNALS) {
        std::thread::sleep(dice.pause(Duration::from_millis(800)));
        // A zombie until it is waited for.
        if !is_alive(pid) {
            break;
        }
        let roles = processes(&place);
        match (dice.below(8), &watcher) {
            (0, _) => send(dice, pid, "the launcher", log),
            (1 | 2, Some(view)) => send(dice, view.id(), "the view", log),
            (_, _) if !roles.is_empty() => {
                let role = &roles[dice.below(roles.len())];
                send(dice, role.pid, &format!("{} {:?}", role.role, role.id), log);
            }
            _ => {}
        }
    }
    let code = wait(&mut launcher, log);
    log.push(format!("code {code:?}"));
    assert!(code.is_none_or(|code| [0, 1, 3, 4, 129, 130, 143].contains(&code)), "{log:?}");
    let roles = processes(&place);
    if let Some(view) = &mut watcher {
        kill("INT", view.id());
        wait(view, log);
    }
    assert_clean(&place, &roles, pid, log);
    if place.join("out/manifest.json").exists() {
        assert_summary(&place, code, !roles.is_empty() && flew(&place), log);
    }
}

/// A command that gets a signal each time it is started. Returns its last process id.
fn disturb(place: &Place, args: &[&str], most: Duration, dice: &mut Dice, log: &mut Log) -> u32 {
    let mut pid = 0;
    for _ in 0..=dice.below(JOB_SIGNALS) {
        let mut child = place.command(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        pid = child.id();
        std::thread::sleep(dice.pause(most));
        send(dice, pid, args[0], log);
        let code = wait(&mut child, log);
        log.push(format!("code {code:?}"));
        assert!(code.is_none_or(|code| [0, 129, 130, 143].contains(&code)), "{log:?}");
    }
    pid
}

/// A sweep that is interrupted; the same command completes it.
fn sweep(dice: &mut Dice, log: &mut Log) {
    let place = Place::new();
    let text = format!("scenario = {:?}\nseeds = 12\n[grid]\nformation.start_jitter_m = 2\n", paper("s2-right"));
    fs::write(place.join("e.toml"), text).unwrap();
    let args = ["sweep", "e.toml", "--quiet", "--out", "out"];
    let pid = disturb(&place, &args, Duration::from_secs(1), dice, log);
    let again = place.run(&args);
    assert_eq!(again.code, Some(0), "{again:?} after {log:?}");
    let rows = fs::read_to_string(place.join("out/runs.csv")).unwrap().lines().count();
    assert_eq!((rows, &json(place.join("out/summary.json"))["runs"]), (13, &Value::from(12)), "after {log:?}");
    assert_clean(&place, &[], pid, log);
}

/// A report that is interrupted; the same command completes it.
fn report(dice: &mut Dice, log: &mut Log) {
    let place = Place::new();
    place.fly("s1-left", &["--runtime", "inline", "--out", "out", "--set", "time.dt_s=0.005"]);
    let wanted = json(place.join("out/summary.json"));
    let args = ["report", "out"];
    let pid = disturb(&place, &args, Duration::from_millis(300), dice, log);
    assert_eq!(json(place.join("out/summary.json")), wanted, "after {log:?}");
    let again = place.run(&args);
    assert_eq!(again.code, Some(0), "{again:?} after {log:?}");
    assert!(support::names(place.join("out")).iter().all(|name| !name.ends_with(".part")), "after {log:?}");
    assert_clean(&place, &[], pid, log);
}

#[test]
fn random_signals_leave_nothing_behind() {
    let (rounds, seed) = (number("SKEIN_SOAK_ROUNDS", ROUNDS), number("SKEIN_SOAK_SEED", 0));
    let mut signals = 0;
    for round in seed..seed + rounds {
        let (mut dice, mut log) = (Dice(round), Log::default());
        log.push(format!("SKEIN_SOAK_SEED={round}"));
        match dice.below(6) {
            0 => sweep(&mut dice, &mut log),
            1 => report(&mut dice, &mut log),
            _ => run(&mut dice, &mut log),
        }
        signals += log.signals;
        println!("{}; {signals} signals so far", log.said.join(", "));
    }
}
