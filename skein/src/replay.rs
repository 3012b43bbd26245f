//! `skein replay`: flies a recorded run again from its manifest, and compares the digests.

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use crate::options::{PinChoice, RuntimeChoice, WaitChoice};
use crate::output::print_line;
use crate::run_folder;
use clap::Args;
use serde_json::json;
use skein_protocol::record::Outcome;
use skein_report::{PilotEntry, Recorder, RunCompletion, Summary};
use skein_runtime::run_facts::run_facts;
use skein_runtime::{Clock, Launch, PATIENCE, PilotRegistry, ProcessInfo, RunEnd, RuntimeError, inline, supervisor};
use skein_scenario::{Scenario, ScenarioSource};
use std::path::PathBuf;

/// Arguments of `replay`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein replay runs/s2-right-1
  skein replay runs/s2-right-1 --runtime inline --json

Exit codes: 0 the digests are equal, 1 they differ, 2 the folder is not a recorded run, 3 the environment failed.")]
pub(crate) struct ReplayArgs {
    /// Folder of a recorded run
    pub(crate) run_dir: PathBuf,
    /// Runtime to fly in; the digest does not depend on it [default: the recorded run's]
    #[arg(long, value_enum)]
    pub(crate) runtime: Option<RuntimeChoice>,
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// Flies the run again in lockstep, and compares the digests. Writes nothing.
pub(crate) fn replay(args: &ReplayArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    let folder = run_folder::open(&args.run_dir)?;
    let manifest = folder.read_manifest().map_err(Failure::report)?;
    let recorded = folder.read_summary().map_err(Failure::report)?;
    let path = args.run_dir.join("manifest.json");
    let name = path.display().to_string();
    let source = ScenarioSource { name: &name, stem: "" };
    let scenario = Scenario::from_json(&manifest.scenario, source)
        .map_err(|error| Failure::usage(format!("expected the scenario of a run by this version of Skein: {error}")))?;
    let runtime = args.runtime.unwrap_or(match manifest.facts.runtime.as_str() {
        "inline" => RuntimeChoice::Inline,
        _ => RuntimeChoice::Processes,
    });
    pilots
        .check(&scenario, runtime == RuntimeChoice::Inline)
        .map_err(|problem| Failure::usage(format!("{}: scenario.{problem}", path.display())))?;
    check_programs(pilots, &scenario, &manifest.pilots)?;
    let interrupt = Interrupt::watch()?;
    let name = if runtime == RuntimeChoice::Inline { "inline" } else { "processes" };
    let mut recorder = Recorder::in_memory(run_facts(&scenario, name, "lockstep").map_err(Failure::usage)?);
    let end = fly(runtime, &scenario, pilots, &interrupt, &mut recorder).map_err(Failure::environment)?;
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
    let (flown, _) = recorder.finish(&completion);
    if let Some(signal) = end.signal {
        return Ok(Exit::Interrupted(signal));
    }
    if let Some(trouble) = end.failure.or(end.sink_error) {
        return Err(Failure::environment(trouble));
    }
    let equal = recorded.digest.is_some() && recorded.digest == flown.digest;
    print(args, &recorded, &flown, equal)?;
    Ok(if equal { Exit::Reached } else { Exit::NotReached })
}

/// Refuses programs that are not those of the recorded run.
fn check_programs(pilots: &PilotRegistry, scenario: &Scenario, recorded: &[PilotEntry]) -> Result<(), Failure> {
    for (now, then) in pilots.entries(scenario).map_err(Failure::usage)?.iter().zip(recorded) {
        if now.program != then.program {
            let hash = |entry: &PilotEntry| entry.program.clone().unwrap_or_else(|| "a built-in pilot".to_owned());
            return Err(Failure::usage(format!(
                "the pilot {:?} was flown by another program: expected the one with the hash {}, found {}",
                then.name,
                hash(then),
                hash(now)
            )));
        }
    }
    Ok(())
}

fn fly(
    runtime: RuntimeChoice,
    scenario: &Scenario,
    pilots: &PilotRegistry,
    interrupt: &Interrupt,
    recorder: &mut Recorder,
) -> Result<RunEnd, RuntimeError> {
    if runtime == RuntimeChoice::Inline {
        return inline::run(scenario, pilots, recorder, || interrupt.signal());
    }
    skein_bus::clean()?;
    let launch = Launch {
        scenario,
        clock: Clock::Lockstep,
        pin: PinChoice::Auto.into(),
        wait: WaitChoice::Block.into(),
        patience: PATIENCE,
        per_process: 1,
        program: pilots.program(),
        hosts: &[],
        on_ready: &mut |_: &[ProcessInfo]| Ok(()),
        interrupted: &mut || interrupt.signal(),
    };
    supervisor::run(launch, recorder)
}

/// Why the recorded run cannot be repeated from its scenario alone.
fn reasons(recorded: &Summary) -> Vec<String> {
    let unscheduled = recorded.faults.iter().filter(|fault| !fault.scheduled).count();
    let reasons = [
        (unscheduled > 0).then(|| format!("{unscheduled} of its faults were not in its scenario")),
        (recorded.deadline_misses > 0).then(|| format!("{} deadlines were missed", recorded.deadline_misses)),
        (recorded.outcome == Outcome::Aborted).then(|| "it was aborted".to_owned()),
    ];
    reasons.into_iter().flatten().collect()
}

fn print(args: &ReplayArgs, recorded: &Summary, flown: &Summary, equal: bool) -> Result<bool, Failure> {
    let reasons = if equal { Vec::new() } else { reasons(recorded) };
    let (was, is) = (recorded.digest.as_deref(), flown.digest.as_deref());
    if args.json {
        let ticks = [recorded.ticks, flown.ticks];
        print_line(json!({ "equal": equal, "recorded": was, "replayed": is, "ticks": ticks, "reasons": reasons }))
    } else {
        let result = if equal { "equal" } else { "different" };
        let why = if reasons.is_empty() { String::new() } else { format!("\nbecause   {}", reasons.join("; ")) };
        let (was, is) = (was.unwrap_or("none"), is.unwrap_or("none"));
        let (before, after) = (recorded.ticks, flown.ticks);
        print_line(format!("{result}\nrecorded  {was} after {before} ticks\nreplayed  {is} after {after} ticks{why}"))
    }
}
