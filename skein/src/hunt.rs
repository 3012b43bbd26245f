//! `skein hunt`.

use crate::exit::{Exit, Failure};
use crate::hunt_folder::HuntFolder;
use crate::interrupt::Interrupt;
use crate::missing::missing;
use crate::options::key_value;
use crate::output::print as print_text;
use crate::progress::RunsBar;
use crate::sweep::{in_experiment, jobs};
use clap::Args;
use serde_json::json;
use skein_runtime::PilotRegistry;
use skein_sweep::hunt::{self, FailureKind, Hunt, HuntReport};
use skein_sweep::{Grid, Progress, program_name};
use std::path::PathBuf;

/// Arguments of `hunt`.
#[derive(Debug, Args)]
#[command(
    after_help = "A hunt flies runs of the experiment (or seeds of the scenario), then missions that differ a little from \
those that came nearest to a failure. It makes each kind of failure that it finds small and writes it as a scenario file.
A mission that does not reach its goal counts unless its time limit is shorter than the default one, or `skein check` warns of it.
A hunt that is interrupted writes what it has found.

Exit codes: 0 nothing found, 1 a mission that does not reach its goal, 4 a broken invariant.

Examples:
  skein hunt experiments/wide-scenes.toml --flights 2000
  skein hunt scenarios/paper/forest.toml --set radio.preset=jammed"
)]
pub(crate) struct HuntArgs {
    /// Experiment or scenario file (TOML)
    pub(crate) source: PathBuf,
    /// Flights of the search; each finding takes up to 300 more to make it small
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub(crate) flights: u32,
    /// Seed of the changes that make neighbours
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Missions to fly side by side [default: number of cores]
    #[arg(long, value_name = "N", value_parser = jobs)]
    pub(crate) jobs: Option<usize>,
    /// Override a scenario key in every run, such as radio.range_m=200; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub(crate) overrides: Vec<(String, String)>,
    /// Folder for the scenario files of what is found; an existing one is refused [default: hunts/<name>-<number>]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Replace the findings in an existing --out folder
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
    /// Print the report as one JSON object
    #[arg(long)]
    pub(crate) json: bool,
    /// Print nothing but errors
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Hunts, writes what was found, and prints the report.
pub(crate) fn hunt(args: &HuntArgs, pilots: &PilotRegistry) -> Result<Exit, Failure> {
    if let Some(text) = missing(&args.source, "expected an experiment or a scenario (TOML)") {
        return Err(Failure::usage(text));
    }
    let experiment = hunt::source(&args.source).map_err(Failure::usage)?;
    let program = program_name(pilots.program());
    let grid = Grid::new(&experiment, &args.overrides).program(&program);
    let interrupt = Interrupt::watch()?;
    let interrupted = || interrupt.signal();
    let folder = match &args.out {
        Some(path) => HuntFolder::at(path, args.force)?,
        None => HuntFolder::numbered(&experiment.name)?,
    };
    let workers = args.jobs.or_else(|| std::thread::available_parallelism().ok().map(std::num::NonZero::get));
    let mut bar = RunsBar::new(args.quiet || args.json);
    let search = Hunt::new(&grid, pilots).flights(args.flights as usize).seed(args.seed).workers(workers.unwrap_or(1));
    let runs = args.flights as usize;
    let report = search.interrupted(&interrupted).run(|done, _| bar.show(Progress { done, runs }));
    bar.finish();
    let report = report.map_err(|error| Failure::usage(in_experiment(&args.source, &error.to_string())));
    let written = report.and_then(|report| Ok((folder.write(&report.findings)?, report)));
    folder.remove_if_empty();
    let (files, report) = written?;
    print(args, &program, &report, &files)?;
    Ok(interrupt.signal().map_or_else(|| exit(&report), Exit::Interrupted))
}

fn exit(report: &HuntReport) -> Exit {
    match &report.findings[..] {
        [] => Exit::Reached,
        [one] if one.failure.kind == FailureKind::NotReached => Exit::NotReached,
        _ => Exit::Unsafe,
    }
}

fn print(args: &HuntArgs, program: &str, report: &HuntReport, files: &[PathBuf]) -> Result<bool, Failure> {
    let findings = report.findings.iter().zip(files);
    let text = if args.json {
        let findings: Vec<_> = findings
            .map(|(finding, file)| {
                json!({
                    "failure": finding.failure.kind.words(), "value": finding.failure.value, "file": file,
                    "command": format!("{program} run {}", file.display()), "found_by": finding.command,
                })
            })
            .collect();
        let (separation, clearance) = (report.least_separation, report.least_clearance);
        format!(
            "{}\n",
            json!({
                "flights": report.flights, "findings": findings,
                "least_separation_ratio": separation, "least_clearance_ratio": clearance,
            })
        )
    } else if args.quiet {
        String::new()
    } else {
        let mut text = format!("{} flights, {} kinds of failure\n", report.flights, report.findings.len());
        for (finding, file) in findings {
            let value = if finding.failure.value > 0.0 {
                format!(", {:.3} of the distance to keep", finding.failure.value)
            } else {
                String::new()
            };
            text += &format!("\n  {}{value}\n  {program} run {}\n", finding.failure.kind.words(), file.display());
            text += &finding.command.iter().map(|command| format!("  found by: {command}\n")).collect::<String>();
        }
        let ratio = |name: &str, ratio: Option<f64>| {
            ratio.map_or(String::new(), |ratio| {
                format!("\n  least {name} of the others: {ratio:.3} of the distance to keep")
            })
        };
        text + &ratio("separation", report.least_separation) + &ratio("clearance", report.least_clearance) + "\n"
    };
    print_text(text)
}
