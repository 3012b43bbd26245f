//! `skein run`: flies one mission.

use crate::cli::RunArgs;
use crate::doctor::check_room;
use crate::exit::{Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::options::RuntimeChoice;
use crate::progress::MissionBar;
use skein_protocol::record::{Outcome, RecordSink};
use skein_report::{Manifest, ProcessEntry, Recorder, Role, RunCompletion, RunFacts, RunFolder, Summary, page, text};
use skein_runtime::advice;
use skein_runtime::run_facts::run_facts;
use skein_runtime::{Launch, PilotKind, ProcessInfo, ProcessRole, RunEnd, RuntimeError, inline, supervisor};
use skein_scenario::Scenario;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::time::Instant;

/// Flies the mission, writes its folder and prints its summary.
pub(crate) fn run(args: &RunArgs) -> Result<Exit, Failure> {
    let started = Instant::now();
    let scenario = input::scenario(&args.scenario)?;
    check_packing(args, &scenario)?;
    if args.runtime == RuntimeChoice::Processes {
        check_room(scenario.formation.drones, args.drones_per_process)?;
    }
    let runtime = match args.runtime {
        RuntimeChoice::Processes => "processes",
        RuntimeChoice::Inline => "inline",
    };
    let facts = run_facts(&scenario, runtime, &args.clock.to_string()).map_err(Failure::usage)?;
    if !args.quiet {
        for warning in advice::warnings(&scenario).map_err(Failure::usage)? {
            eprintln!("skein: warning: {warning}");
        }
    }
    let interrupt = Interrupt::watch()?;
    let folder = open_folder(args, &scenario)?;
    let manifest = write_manifest(&folder, &facts, &scenario)?;
    let recorder = match args.no_record {
        true => Recorder::in_memory(facts.clone()),
        false => Recorder::in_folder(facts.clone(), &folder, &manifest.scenario).map_err(Failure::environment)?,
    };
    let ticks = (scenario.timeout_s() / scenario.time.dt_s).ceil() as u64;
    let mut sink = MissionBar::new(recorder, args.quiet || args.json, ticks);
    let end = fly(args, &scenario, &folder, &interrupt, &mut sink).map_err(Failure::environment)?;
    let wall_s = started.elapsed().as_secs_f64() - end.startup_s;
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: Some(wall_s), startup_s: Some(end.startup_s) };
    let reporting = Instant::now();
    let (mut summary, recorded) = sink.finish().finish(&completion);
    if let (None, Some(signal)) = (&summary.reason, end.signal) {
        summary.reason = Some(format!("interrupted by signal {signal}"));
    }
    // The summary is written even if the report cannot be written.
    let reported = if args.no_record { Ok(Vec::new()) } else { page::write(&folder, &manifest, &summary) };
    summary.report_s = Some(reporting.elapsed().as_secs_f64());
    folder.write_summary(&summary).map_err(Failure::environment)?;
    print(args, &summary, &folder);
    let files = recorded.and(reported.map(|_| ())).err().map(|error| error.to_string());
    let trouble = end.failure.clone().or(end.sink_error.clone()).or(files);
    if let Some(trouble) = &trouble {
        eprintln!("skein: {trouble}");
    }
    Ok(exit(&end, trouble.is_some(), &summary))
}

/// Refuses process faults if drones share processes: the fault would hit all drones of the process.
fn check_packing(args: &RunArgs, scenario: &Scenario) -> Result<(), Failure> {
    use skein_scenario::FaultKind::{Freeze, Kill, Restart};
    let of_process = |fault: &skein_scenario::Fault| [Kill, Freeze, Restart].contains(&fault.kind);
    if args.drones_per_process > 1 && scenario.fault_plan.iter().any(of_process) {
        let why = "the scenario kills, freezes or restarts drones, which needs one process per drone";
        return Err(Failure::usage(format!("--drones-per-process {}: {why}", args.drones_per_process)));
    }
    Ok(())
}

fn open_folder(args: &RunArgs, scenario: &Scenario) -> Result<RunFolder, Failure> {
    use skein_report::ReportError::{Exists, NotARun};
    let folder = match &args.out {
        Some(path) => RunFolder::at(path, args.force),
        None => RunFolder::numbered(Path::new("runs"), &scenario.name),
    };
    folder.map_err(|error| match error {
        Exists(_) | NotARun(_) => Failure::usage(error),
        other => Failure::environment(other),
    })
}

/// Writes the manifest, which says what is flown, into the run's folder.
fn write_manifest(folder: &RunFolder, facts: &RunFacts, scenario: &Scenario) -> Result<Manifest, Failure> {
    let resolved = serde_json::to_value(scenario).map_err(Failure::environment)?;
    let commit = option_env!("SKEIN_COMMIT").map(str::to_owned);
    let manifest = Manifest::new(facts.clone(), resolved, env!("CARGO_PKG_VERSION"), commit);
    folder.write_manifest(&manifest).map_err(Failure::environment)?;
    Ok(manifest)
}

fn fly(
    args: &RunArgs,
    scenario: &Scenario,
    folder: &RunFolder,
    interrupt: &Interrupt,
    sink: &mut dyn RecordSink,
) -> Result<RunEnd, RuntimeError> {
    let launcher = ProcessInfo { role: ProcessRole::Launcher, id: None, pid: std::process::id() };
    let mut on_ready = |processes: &[ProcessInfo]| {
        let entries: Vec<ProcessEntry> = processes.iter().map(entry).collect();
        Ok(folder.write_processes(&entries)?)
    };
    match args.runtime {
        RuntimeChoice::Inline => {
            on_ready(&[launcher]).map_err(RuntimeError::OnReady)?;
            inline::run(scenario, sink, || interrupt.signal())
        }
        RuntimeChoice::Processes => {
            skein_bus::clean()?;
            let executable = std::env::current_exe().map_err(RuntimeError::system("finding this executable"))?;
            let launch = Launch {
                scenario,
                clock: args.clock,
                pin: args.pin.into(),
                wait: args.wait.into(),
                pilot: PilotKind::Swarm,
                per_process: args.drones_per_process,
                executable,
                on_ready: &mut on_ready,
                interrupted: &mut || interrupt.signal(),
            };
            supervisor::run(launch, sink)
        }
    }
}

fn entry(process: &ProcessInfo) -> ProcessEntry {
    let role = match process.role {
        ProcessRole::World => Role::World,
        ProcessRole::Drone => Role::Drone,
        ProcessRole::Launcher => Role::Launcher,
    };
    ProcessEntry { role, id: process.id, pid: process.pid }
}

fn print(args: &RunArgs, summary: &Summary, folder: &RunFolder) {
    let mut out = std::io::stdout().lock();
    // A closed pipe is the reader's choice.
    let _ = if args.json {
        serde_json::to_string(summary).map_err(std::io::Error::from).and_then(|json| writeln!(out, "{json}"))
    } else if args.quiet {
        Ok(())
    } else {
        let colour = out.is_terminal() && std::env::var_os("NO_COLOR").is_none();
        writeln!(out, "{}\nfolder  {}", text::summary(summary, colour), folder.path().display())
    };
}

fn exit(end: &RunEnd, trouble: bool, summary: &Summary) -> Exit {
    match (end.signal, summary.outcome) {
        (Some(signal), _) => Exit::Interrupted(signal),
        _ if trouble => Exit::Environment,
        (None, Outcome::Aborted) => Exit::Environment,
        (None, Outcome::Unsafe) => Exit::Unsafe,
        (None, Outcome::Timeout | Outcome::Stuck) => Exit::NotReached,
        (None, Outcome::Reached) => Exit::Reached,
    }
}
