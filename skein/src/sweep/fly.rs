//! Flies one run of a sweep.

use super::grid::Grid;
use super::row::Row;
use crate::interrupt::Interrupt;
use rustix::process::{Pid, Signal, kill_process};
use skein_protocol::record::Outcome;
use skein_report::{Recorder, RunCompletion, Summary};
use skein_runtime::inline;
use skein_runtime::run_facts::run_facts;
use skein_scenario::Scenario;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// How runs are flown.
#[derive(Clone, Debug)]
pub enum Runtime {
    /// In this thread.
    Inline,
    /// By a `skein run` each, its files in this folder while it flies.
    Processes(PathBuf),
}

/// Between two looks at a swarm of processes.
const LOOK: Duration = Duration::from_millis(5);

/// The row of a run; `None` if it was interrupted. Whatever goes wrong stands in the row.
pub fn fly(grid: &Grid<'_>, job: usize, runtime: &Runtime, interrupt: &Interrupt) -> Option<Row> {
    let flown = catch_unwind(AssertUnwindSafe(|| {
        let scenario = match grid.scenario(job) {
            Ok(scenario) => scenario,
            Err(reason) => return Some(Row::unflown(job, "invalid", &reason)),
        };
        let summary = match runtime {
            Runtime::Inline => fly_inline(&scenario, interrupt),
            Runtime::Processes(folder) => fly_processes(&scenario, &folder.join(job.to_string()), interrupt),
        };
        if interrupt.signal().is_some() {
            return None;
        }
        Some(match summary {
            Ok(summary) => Row::flown(job, &summary, &scenario),
            Err(reason) => Row::unflown(job, "failed", &reason),
        })
    }));
    flown.unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<String>().cloned();
        let said = said.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()));
        Some(Row::unflown(job, "failed", &format!("panicked: {}", said.unwrap_or_default())))
    })
}

/// The summary of a flight in this thread; the error is why there is none.
pub fn fly_inline(scenario: &Scenario, interrupt: &Interrupt) -> Result<Summary, String> {
    let facts = run_facts(scenario, "inline", "lockstep").map_err(|_| "a scenario without facts")?;
    let mut recorder = Recorder::in_memory(facts);
    let end = inline::run(scenario, &mut recorder, || interrupt.signal()).map_err(|error| error.to_string())?;
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
    match end.sink_error {
        Some(error) => Err(error),
        None => Ok(recorder.finish(&completion).0),
    }
}

/// Starts `skein run` in a process group of its own, so that a terminal's Ctrl-C reaches the sweep alone, which hands
/// it on.
fn fly_processes(scenario: &Scenario, folder: &Path, interrupt: &Interrupt) -> Result<Summary, String> {
    let said = |error: std::io::Error| error.to_string();
    std::fs::create_dir_all(folder).map_err(said)?;
    let path = folder.join("scenario.toml");
    std::fs::write(&path, scenario.to_toml().map_err(|error| error.to_string())?).map_err(said)?;
    let mut child = Command::new(std::env::current_exe().map_err(said)?)
        .arg("run")
        .arg(&path)
        .args(["--json", "--no-record", "--force", "--out"])
        .arg(folder.join("run"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(said)?;
    let (out, complaint) = attend(&mut child, interrupt).map_err(said)?;
    // The summary is read; what cannot be removed is removed at the sweep's end.
    let _ = std::fs::remove_dir_all(folder);
    serde_json::from_str(out.trim()).map_err(|_| format!("no summary: {}", complaint.trim()))
}

/// Waits for a child, interrupts it when the sweep is interrupted; returns what it wrote.
fn attend(child: &mut Child, interrupt: &Interrupt) -> std::io::Result<(String, String)> {
    let mut told = false;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    std::thread::scope(|scope| {
        let drain = |stream: Option<Box<dyn Read + Send>>| {
            let mut text = Vec::new();
            let _ = stream.map(|mut stream| stream.read_to_end(&mut text));
            String::from_utf8_lossy(&text).into_owned()
        };
        let out = scope.spawn(move || drain(stdout.map(|s| Box::new(s) as Box<dyn Read + Send>)));
        let complaint = scope.spawn(move || drain(stderr.map(|s| Box::new(s) as Box<dyn Read + Send>)));
        while child.try_wait()?.is_none() {
            if interrupt.signal().is_some() && !told {
                told = true;
                let _ = kill_process(Pid::from_child(child), Signal::INT);
            }
            std::thread::sleep(LOOK);
        }
        Ok((out.join().unwrap_or_default(), complaint.join().unwrap_or_default()))
    })
}
