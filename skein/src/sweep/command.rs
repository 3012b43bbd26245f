//! The commands `sweep` and `scene`.

use super::args::{SceneArgs, SweepArgs};
use super::cells::cells;
use super::experiment::{Experiment, Mission};
use super::fly::Runtime;
use super::grid::Grid;
use super::plots::plots;
use super::pool::fly_all;
use super::random::{Bounds, scene_toml};
use super::ratios;
use super::row::{Row, write_csv};
use super::store::{Identity, Store};
use super::table::table;
use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use skein_protocol::digest::Digest;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Prints the TOML of one random scene.
pub fn scene(args: &SceneArgs) -> Result<Exit, Failure> {
    let default = Bounds::default();
    let bounds = Bounds {
        drones: args.drones.unwrap_or(default.drones),
        obstacles: args.obstacles.unwrap_or(default.obstacles),
    };
    let text = bounds.checked().and_then(|bounds| scene_toml(args.seed, bounds)).map_err(Failure::usage)?;
    // A closed pipe is the reader's choice.
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
    Ok(Exit::Reached)
}

/// Flies what is left of an experiment, and when nothing is left says what came of it.
pub fn sweep(args: &SweepArgs) -> Result<Exit, Failure> {
    let experiment = Experiment::read(&args.experiment).map_err(Failure::usage)?;
    let grid = Grid::new(&experiment, &args.overrides);
    let shown = args.experiment.display();
    grid.check().map_err(|error| Failure::usage(format!("{shown}: {error}")))?;
    let interrupt = Interrupt::watch()?;
    let folder = args.out.clone().unwrap_or_else(|| Path::new("sweeps").join(&experiment.name));
    let identity = identity(&experiment, &grid, &args.overrides);
    let (mut store, mut rows) = Store::open(&folder, &identity)?;
    fly_missing(args, &experiment, &grid, &mut store, &mut rows, &interrupt)?;
    if rows.len() < grid.len() {
        if let Some(signal) = interrupt.signal() {
            eprintln!("skein: {} of {} runs are done; the same command resumes the sweep", rows.len(), grid.len());
            return Ok(Exit::Interrupted(signal));
        }
        return Err(Failure::environment(format!("only {} of {} runs came back", rows.len(), grid.len())));
    }
    rows.sort_by_key(|row| row.job);
    tell(args, &experiment, &grid, &store, &rows)?;
    Ok(Exit::Reached)
}

fn identity(experiment: &Experiment, grid: &Grid<'_>, overrides: &[(String, String)]) -> Identity {
    let mut digest = Digest::default();
    let mut fold = |text: &str| {
        digest.word(text.len() as u64).bytes(text.as_bytes());
    };
    // Texts, not paths: a sweep may be resumed from another folder. Metrics only choose what is shown.
    let Experiment { strategies, seeds, grid: axes, processes, bounds, .. } = experiment;
    fold(&format!("{strategies:?} {seeds:?} {axes:?} {processes} {bounds:?} {overrides:?}"));
    for mission in &experiment.scenarios {
        match mission {
            Mission::Random => fold("random"),
            Mission::File { text, .. } => fold(text),
        }
    }
    fold(env!("CARGO_PKG_VERSION"));
    fold(option_env!("SKEIN_COMMIT").unwrap_or_default());
    Identity {
        schema: "skein-sweep-experiment/1".to_owned(),
        name: experiment.name.clone(),
        hash: format!("{:016x}", digest.value()),
        runs: grid.len(),
    }
}

fn fly_missing(
    args: &SweepArgs,
    experiment: &Experiment,
    grid: &Grid<'_>,
    store: &mut Store,
    rows: &mut Vec<Row>,
    interrupt: &Interrupt,
) -> Result<(), Failure> {
    let mut done = vec![false; grid.len()];
    rows.iter().for_each(|row| done[row.job] = true);
    let missing: Vec<usize> = (0..grid.len()).filter(|&job| !done[job]).collect();
    let flights = store.path("flights");
    let runtime = match experiment.processes {
        true => Runtime::Processes(flights.join(std::process::id().to_string())),
        false => Runtime::Inline,
    };
    let bar = progress_bar(args.quiet || args.json, grid.len(), rows.len());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let workers = args.jobs.unwrap_or(cores).min(missing.len());
    let ended = fly_all(grid, &missing, workers, &runtime, interrupt, |row| {
        bar.tick();
        let Some(row) = row else { return Ok(()) };
        store.keep(&row)?;
        rows.push(row);
        bar.inc(1);
        Ok::<(), std::io::Error>(())
    });
    bar.finish_and_clear();
    // Empty by now, or left by a sweep that was killed.
    let _ = std::fs::remove_dir_all(flights);
    ended.map_err(|error| Failure::environment(format!("{}: {error}", store.path("rows.jsonl").display())))
}

/// A bar over so many runs, of which some are done; none if `quiet` or stderr is no terminal.
pub fn progress_bar(quiet: bool, runs: usize, done: usize) -> ProgressBar {
    let hidden = quiet || !std::io::stderr().is_terminal();
    let bar = if hidden { ProgressBar::hidden() } else { ProgressBar::new(runs as u64) };
    if let Ok(style) = ProgressStyle::with_template("{spinner} {pos} of {len} runs {wide_bar} {per_sec}, {eta} left") {
        bar.set_style(style);
    }
    bar.with_position(done as u64).with_elapsed(std::time::Duration::ZERO)
}

/// Writes runs.csv, summary.json and the plots, and prints the table.
fn tell(
    args: &SweepArgs,
    experiment: &Experiment,
    grid: &Grid<'_>,
    store: &Store,
    rows: &[Row],
) -> Result<(), Failure> {
    let keys: Vec<&str> = experiment.grid.iter().map(|axis| axis.key.as_str()).collect();
    let mut csv = Vec::new();
    write_csv(&mut csv, grid, &keys, rows).map_err(Failure::environment)?;
    store.write("runs.csv", &csv)?;
    let cells = cells(grid, rows);
    let ratios = ratios::ratios(grid, rows);
    let summary = json!({
        "schema": "skein-sweep/1", "experiment": experiment.name, "runs": rows.len(),
        "scenarios": experiment.scenarios.iter().map(scenario).collect::<Vec<Value>>(),
        "seeds": experiment.seeds, "keys": keys,
        "cells": cells.iter().map(|cell| cell.json(&keys)).collect::<Vec<Value>>(),
        "ratios": ratios.iter().map(ratios::Ratios::json).collect::<Vec<Value>>(),
    });
    let text = serde_json::to_vec_pretty(&summary).map_err(Failure::environment)?;
    store.write("summary.json", &text)?;
    for (name, svg) in plots(experiment, &cells).map_err(Failure::environment)? {
        store.write(&format!("plots/{name}"), svg.as_bytes())?;
    }
    if let Some(svg) = ratios::figure(&experiment.name, &ratios).map_err(Failure::environment)? {
        store.write("plots/ratios.svg", svg.as_bytes())?;
        store.write("ratios.csv", ratios::csv(&ratios, &keys).as_bytes())?;
    }
    let mut out = std::io::stdout().lock();
    // A closed pipe is the reader's choice.
    let _ = match (args.json, args.quiet) {
        (true, _) => writeln!(out, "{summary}"),
        (false, true) => Ok(()),
        (false, false) => {
            let folder: PathBuf = store.path("");
            let table = table(&cells, &keys, &experiment.metrics);
            writeln!(out, "{table}{}folder  {}", ratios::text(&ratios), folder.display())
        }
    };
    Ok(())
}

fn scenario(mission: &Mission) -> Value {
    match mission {
        Mission::Random => json!("random"),
        Mission::File { path, .. } => json!(path),
    }
}
