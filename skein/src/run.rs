//! `skein run`: flies one mission.

use crate::cli::{RunArgs, TableArgs};
use crate::colour;
use crate::complaint::complain;
use crate::doctor::check_room;
use crate::exit::{Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::options::RuntimeChoice;
use crate::output;
use crate::progress::MissionBar;
use crate::run_options;
use rustix::process::Signal;
use skein_protocol::record::{Outcome, RecordSink};
use skein_report::{
    DataFiles, FlightRecord, HostEntry, Interrupted, Manifest, ProcessEntry, Recorder, ReportError, ReservedSummary,
    Role, RunCompletion, RunFacts, RunFolder, StepTimes, Summary, page, text,
};
use skein_runtime::advice;
use skein_runtime::run_facts::run_facts;
use skein_runtime::{
    HostReport, HostShare, Launch, PATIENCE, PilotRegistry, ProcessInfo, ProcessRole, RunEnd, RuntimeError,
    end_with_parent, inline, supervisor,
};
use skein_scenario::Scenario;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::time::Instant;

/// Receives the folder of a run.
pub(crate) type OnFolder = dyn Fn(&Path) + Send + Sync;

/// Flies the mission, writes its folder and prints its summary.
pub(crate) fn run(args: &RunArgs, pilots: &PilotRegistry, on_folder: Option<&OnFolder>) -> Result<Exit, Failure> {
    let started = Instant::now();
    if let Some(parent) = args.parent {
        end_with_parent(parent, Signal::TERM).map_err(Failure::environment)?;
    }
    run_options::check(args)?;
    let per_process = args.drones_per_process.unwrap_or(1);
    let scenario = input::scenario(&args.scenario, pilots, args.runtime == RuntimeChoice::Inline)?;
    check_packing(per_process, &scenario)?;
    if args.runtime == RuntimeChoice::Processes {
        check_room(scenario.formation.drones, per_process)?;
    }
    let runtime = match args.runtime {
        RuntimeChoice::Processes => "processes",
        RuntimeChoice::Inline => "inline",
    };
    let mut facts = run_facts(&scenario, runtime, &args.clock.to_string()).map_err(Failure::usage)?;
    facts.pilots = pilots.entries(&scenario).map_err(Failure::usage)?;
    facts.topics = pilots.topics().to_vec();
    data_files(args).check(&facts).map_err(Failure::report)?;
    if !args.quiet {
        for warning in advice::warnings(&scenario).map_err(Failure::usage)? {
            complain(format!("warning: {warning}"));
        }
        warn_of_idle_pilots(pilots, &scenario);
    }
    let own_program = pilots.flies_own(&scenario).then(|| pilots.program().hash()).transpose();
    let own_program = own_program.map_err(Failure::environment)?;
    let shares = match args.runtime {
        RuntimeChoice::Processes => {
            args.network.shares((&args.scenario, &scenario), own_program.as_deref(), per_process)?
        }
        RuntimeChoice::Inline => Vec::new(),
    };
    let interrupt = Interrupt::watch()?;
    let folder = open_folder(args, &scenario)?;
    if let Some(tell) = on_folder {
        tell(folder.path());
    }
    let manifest = manifest(&facts, &scenario)?;
    let flown = begin(args, &folder, &manifest, scenario.timeout_s()).and_then(|Begun { reserved, mut sink }| {
        let end = fly(args, (&scenario, &shares), pilots, &folder, &interrupt, &mut sink);
        let end = end.or_else(killed_early).map_err(failure)?;
        Ok((end, reserved, sink.finish()))
    });
    let (end, reserved, recorder) = match flown {
        Ok(flown) => flown,
        Err(failure) => {
            folder.abandon();
            return Err(failure);
        }
    };
    // A signal from now on stops the writing of files.
    let late_signal = interrupt.take().filter(|_| end.signal.is_none());
    let wall_s = started.elapsed().as_secs_f64() - end.startup_s;
    let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: Some(wall_s), startup_s: Some(end.startup_s) };
    let reporting = Instant::now();
    let (mut summary, record) = recorder.finish(&completion);
    summary.hosts = host_entries(&shares, &end);
    if let (None, Some(signal)) = (&summary.reason, end.signal) {
        summary.reason = Some(format!("interrupted by signal {signal}"));
    }
    let mut trouble: Vec<String> = end.failure.iter().chain(&end.sink_error).cloned().collect();
    if end.bad_records > 0 {
        trouble.push(format!("{} records could not be used and were left out", end.bad_records));
    }
    // The summary comes first: it is there even if nothing else can be written.
    trouble.extend(reserved.write(&summary).err().map(|error| error.to_string()));
    trouble.extend(print(args, &summary, &folder).err().map(|failure| failure.to_string()));
    let stop = || late_signal.or(interrupt.signal());
    let written = record.map_or(Ok(()), |record| write_files(args, &folder, &manifest, &summary, record, &stop));
    summary.report_s = Some(reporting.elapsed().as_secs_f64());
    let written = written.and_then(|()| folder.write_summary(&summary));
    let stopped = matches!(written, Err(ReportError::Interrupted)).then(stop).flatten();
    trouble.extend(written.err().map(|error| error.to_string()));
    trouble.iter().for_each(complain);
    if FlightRecord::is_left_in(&folder) {
        let folder = folder.path().display();
        complain(format!("the record is kept in {folder}; `skein report {folder}` writes its files"));
    }
    Ok(exit(end.signal.or(stopped), !trouble.is_empty(), &summary))
}

/// What became of each host.
fn host_entries(shares: &[HostShare], end: &RunEnd) -> Vec<HostEntry> {
    let entry = |(share, report): (&HostShare, &Option<HostReport>)| HostEntry {
        name: share.name.clone(),
        drones: (share.first.0..share.first.0 + share.count).collect(),
        lateness_us: report.as_ref().and_then(|report| report.lateness_us).map(|[p50, p99, max]| StepTimes {
            p50,
            p99,
            max,
        }),
        ticks: report.as_ref().map(|report| report.ticks),
        bytes_down: report.as_ref().map(|report| report.bytes_down),
        bytes_up: report.as_ref().map(|report| report.bytes_up),
    };
    shares.iter().zip(&end.hosts).map(entry).collect()
}

/// What a flight writes to.
struct Begun {
    reserved: ReservedSummary,
    sink: MissionBar<Recorder>,
}

/// Makes the files that the flight needs. From here on, the folder is this run's.
fn begin(args: &RunArgs, folder: &RunFolder, manifest: &Manifest, timeout_s: f64) -> Result<Begun, Failure> {
    folder.begin(manifest).map_err(Failure::environment)?;
    let facts = manifest.facts.clone();
    let (quiet, course, gate_x_m) = (args.quiet || args.json, facts.course, facts.last_gate_x_m());
    let reserved = folder.reserve_summary(facts.drones).map_err(Failure::environment)?;
    let recorder = match args.no_record {
        true => Recorder::in_memory(facts),
        false => Recorder::in_folder(facts, folder).map_err(Failure::environment)?,
    };
    Ok(Begun { reserved, sink: MissionBar::new(recorder, quiet, timeout_s, course, gate_x_m) })
}

/// Refuses process faults if drones share processes: the fault would hit all drones of the process.
fn check_packing(per_process: u32, scenario: &Scenario) -> Result<(), Failure> {
    use skein_scenario::FaultKind::{Freeze, Kill, Restart};
    let of_process = |fault: &skein_scenario::Fault| [Kill, Freeze, Restart].contains(&fault.kind);
    if per_process > 1 && scenario.fault_plan.iter().any(of_process) {
        let why = "the scenario kills, freezes or restarts drones, which needs one process per drone";
        return Err(Failure::usage(format!("--drones-per-process {per_process}: {why}")));
    }
    Ok(())
}

/// Says so if the program has pilots of its own, and no drone flies with one of them.
fn warn_of_idle_pilots(pilots: &PilotRegistry, scenario: &Scenario) {
    let own = pilots.own_names();
    if !own.is_empty() && !pilots.flies_own(scenario) {
        let names = own.join(", ");
        complain(format!(
            "warning: no drone flies with a pilot of this program ({names}): use --pilot {}, or [[pilot]]",
            own[0]
        ));
    }
}

/// Why a flight could not begin.
fn failure(error: RuntimeError) -> Failure {
    match error {
        // The process has said on stderr what its pilot refuses.
        RuntimeError::EndedEarly { status, .. } if status.code() == Some(2) => Failure::usage(error),
        RuntimeError::Pilot(_) | RuntimeError::OtherVersion { .. } => Failure::usage(error),
        error => Failure::environment(error),
    }
}

/// The end of a run one of whose processes was killed before the first tick.
fn killed_early(error: RuntimeError) -> Result<RunEnd, RuntimeError> {
    match &error {
        RuntimeError::EndedEarly { status, .. } if status.signal().is_some() => {
            Ok(RunEnd { failure: Some(error.to_string()), ..RunEnd::default() })
        }
        _ => Err(error),
    }
}

fn open_folder(args: &RunArgs, scenario: &Scenario) -> Result<RunFolder, Failure> {
    let folder = match &args.out {
        Some(path) => RunFolder::at(path, args.force),
        None => RunFolder::numbered(Path::new("runs"), &scenario.name),
    };
    folder.map_err(Failure::report)
}

/// The manifest, which says what is flown.
fn manifest(facts: &RunFacts, scenario: &Scenario) -> Result<Manifest, Failure> {
    let resolved = serde_json::to_value(scenario).map_err(Failure::environment)?;
    let commit = option_env!("SKEIN_COMMIT").map(str::to_owned);
    Ok(Manifest::new(facts.clone(), resolved, env!("CARGO_PKG_VERSION"), commit))
}

/// Which data files are wanted.
fn data_files(args: &RunArgs) -> DataFiles {
    let TableArgs { every, parquet } = args.tables;
    DataFiles { every, parquet, messages: false }
}

/// Writes everything that is made from the record, and removes the record once all is written.
fn write_files(
    args: &RunArgs,
    folder: &RunFolder,
    manifest: &Manifest,
    summary: &Summary,
    record: FlightRecord,
    stop: &(dyn Fn() -> Option<i32> + Sync),
) -> Result<(), ReportError> {
    let stop = || stop().is_some();
    let interrupted = Interrupted::when(&stop);
    record.write_files(manifest, &interrupted)?;
    page::write(folder, manifest, summary, &interrupted)?;
    data_files(args).write(folder, &manifest.facts, &interrupted)?;
    record.remove()
}

fn fly(
    args: &RunArgs,
    (scenario, hosts): (&Scenario, &[HostShare]),
    pilots: &PilotRegistry,
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
            let settings = inline::Settings { threads: args.threads, clock: args.clock };
            inline::run_with(settings, scenario, pilots, sink, || interrupt.signal())
        }
        RuntimeChoice::Processes => {
            skein_bus::clean()?;
            let launch = Launch {
                scenario,
                clock: args.clock,
                pin: args.pin.unwrap_or_default().into(),
                wait: args.wait.unwrap_or_default().into(),
                patience: args.patience.unwrap_or(PATIENCE),
                per_process: args.drones_per_process.unwrap_or(1),
                program: pilots.program(),
                hosts,
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

fn print(args: &RunArgs, summary: &Summary, folder: &RunFolder) -> Result<bool, Failure> {
    if args.json {
        output::print_line(serde_json::to_string(summary).map_err(Failure::environment)?)
    } else if args.quiet {
        Ok(true)
    } else {
        let text = text::summary(summary, colour::wanted(output::is_terminal()));
        output::print_line(format!("{text}\nfolder  {}", folder.path().display()))
    }
}

fn exit(signal: Option<i32>, trouble: bool, summary: &Summary) -> Exit {
    match (signal, summary.outcome) {
        (Some(signal), _) => Exit::Interrupted(signal),
        _ if trouble => Exit::Environment,
        (None, Outcome::Aborted) => Exit::Environment,
        (None, Outcome::Unsafe) => Exit::Unsafe,
        (None, Outcome::Timeout | Outcome::Stuck) => Exit::NotReached,
        (None, Outcome::Reached) => Exit::Reached,
    }
}
