//! Flies one run, inline or as a swarm of processes.

use crate::error::FlightError;
use crate::grid::Grid;
use crate::row::Row;
use rustix::process::{Pid, Signal, kill_process};
use skein_protocol::record::Outcome;
use skein_report::{Recorder, RunCompletion, Summary};
use skein_runtime::run_facts::run_facts;
use skein_runtime::{PilotRegistry, Program, RuntimeError, inline};
use skein_scenario::Scenario;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::Duration;

/// Asked again and again whether to stop: gives the number of the signal that asks for it, or `None`.
pub type Interrupted<'a> = dyn Fn() -> Option<i32> + Sync + 'a;

/// How the runs of a sweep are flown.
#[derive(Clone, Debug)]
pub(crate) enum FlightMode {
    /// In the worker's thread.
    Inline,
    /// By one launcher process for each run.
    Processes {
        /// Folder for the files of runs in flight.
        folder: PathBuf,
    },
}

/// Time between two looks at a launcher process.
const POLL: Duration = Duration::from_millis(5);

/// Flies a run and returns its row; `None` if it was interrupted. If anything goes wrong, the row says so.
pub(crate) fn fly(
    grid: &Grid<'_>,
    job: usize,
    mode: &FlightMode,
    pilots: &PilotRegistry,
    interrupted: &Interrupted<'_>,
) -> Option<Row> {
    let flown = catch_unwind(AssertUnwindSafe(|| {
        let scenario = match grid.scenario(job) {
            Ok(scenario) => scenario,
            Err(error) => return Some(Row::unflown(job, "invalid", &error.to_string())),
        };
        let summary = match mode {
            FlightMode::Inline => fly_inline(&scenario, pilots, interrupted),
            FlightMode::Processes { folder } => {
                fly_processes(&scenario, pilots.program(), &folder.join(job.to_string()), interrupted)
            }
        };
        if interrupted().is_some() {
            return None;
        }
        Some(match summary {
            Ok(summary) => Row::flown(job, &summary, &scenario),
            Err(error) => Row::unflown(job, "failed", &error.to_string()),
        })
    }));
    flown.unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().cloned();
        let message = message.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.to_owned()));
        Some(Row::unflown(job, "failed", &format!("panicked: {}", message.unwrap_or_default())))
    })
}

/// Flies a mission in this thread with these pilots and returns its summary. Nothing is written.
///
/// # Errors
/// [`FlightError`] if the scenario cannot be flown or its record cannot be evaluated.
pub fn fly_inline(
    scenario: &Scenario,
    pilots: &PilotRegistry,
    interrupted: &Interrupted<'_>,
) -> Result<Summary, FlightError> {
    let mut facts = run_facts(scenario, "inline", "lockstep").map_err(RuntimeError::Shape)?;
    facts.pilots = pilots.entries(scenario)?;
    let mut recorder = Recorder::in_memory(facts);
    let end = inline::run(scenario, pilots, &mut recorder, interrupted)?;
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
    match end.sink_error {
        Some(error) => Err(FlightError::Record(error.to_string())),
        None => Ok(recorder.finish(&completion).0),
    }
}

/// Starts the program's `run` in a process group of its own. So a terminal's Ctrl-C reaches the sweep alone, which
/// forwards it.
fn fly_processes(
    scenario: &Scenario,
    program: &Program,
    folder: &Path,
    interrupted: &Interrupted<'_>,
) -> Result<Summary, FlightError> {
    std::fs::create_dir_all(folder).map_err(FlightError::process("making a folder for the run"))?;
    let path = folder.join("scenario.toml");
    std::fs::write(&path, scenario.to_toml()?).map_err(FlightError::process("writing the run's scenario"))?;
    let mut child = program
        .command()
        .arg("run")
        .arg(&path)
        // If the sweep is killed, its flights end as well.
        .args(["--parent", &std::process::id().to_string()])
        .args(["--json", "--no-record", "--force", "--out"])
        .arg(folder.join("run"))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .process_group(0)
        .spawn()
        .map_err(FlightError::process("starting a run"))?;
    let (stdout, stderr) = wait(&mut child, interrupted).map_err(FlightError::process("waiting for a run"))?;
    // The summary is read. What cannot be removed now is removed when the sweep ends.
    let _ = std::fs::remove_dir_all(folder);
    serde_json::from_str(stdout.trim()).map_err(|_| FlightError::NoSummary(stderr.trim().to_owned()))
}

/// Waits for a child, and interrupts it when the sweep is interrupted. Returns its stdout and stderr.
fn wait(child: &mut Child, interrupted: &Interrupted<'_>) -> std::io::Result<(String, String)> {
    let mut forwarded = false;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    std::thread::scope(|scope| {
        let drain = |stream: Option<Box<dyn Read + Send>>| {
            let mut text = Vec::new();
            // A pipe that breaks ends the text.
            let _ = stream.map(|mut stream| stream.read_to_end(&mut text));
            String::from_utf8_lossy(&text).into_owned()
        };
        let stdout = scope.spawn(move || drain(stdout.map(|s| Box::new(s) as Box<dyn Read + Send>)));
        let stderr = scope.spawn(move || drain(stderr.map(|s| Box::new(s) as Box<dyn Read + Send>)));
        while child.try_wait()?.is_none() {
            if interrupted().is_some() && !forwarded {
                forwarded = true;
                // A child that has just ended needs no signal.
                let _ = kill_process(Pid::from_child(child), Signal::INT);
            }
            std::thread::sleep(POLL);
        }
        Ok((stdout.join().unwrap_or_default(), stderr.join().unwrap_or_default()))
    })
}
