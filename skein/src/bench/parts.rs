//! The parts of a tick that grow with the swarm, each alone: radio, grouping, senses, record.

use super::Scratch;
use super::runtime::median;
use crate::exit::{Exit, Failure};
use clap::Args;
use serde::Serialize;
use skein_leader::split::ArrivalTable;
use skein_protocol::radio::Link;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, Message, SimTime, Vec2};
use skein_runtime::{DroneFactory, PilotKind, StepScratch, mission};
use skein_scenario::{Scenario, ScenarioSource};
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Arguments of these benches.
#[derive(Clone, Debug, Args)]
pub struct PartArgs {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "8,64,256,1000")]
    pub drones: Vec<u32>,
    /// Times each is measured; the median counts
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub json: bool,
}

/// Which part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    Radio,
    Grouping,
    Sense,
    Record,
}

/// One figure.
#[derive(Debug, Serialize)]
struct Figure {
    drones: u32,
    what: String,
    value: f64,
    unit: &'static str,
}

/// Measures one part and prints it.
pub fn part(part: Part, args: &PartArgs) -> Result<Exit, Failure> {
    let mut figures = Vec::new();
    for &drones in &args.drones {
        match part {
            Part::Radio => radio(drones, args.rounds, &mut figures)?,
            Part::Grouping => grouping(drones, args.rounds, &mut figures)?,
            Part::Sense => sense(drones, args.rounds, &mut figures)?,
            Part::Record => record(drones, args.rounds, &mut figures)?,
        }
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&figures).map_err(Failure::environment)?);
    } else {
        for Figure { drones, what, value, unit } in &figures {
            println!("{drones:>6} drones  {what:<52} {value:>10.3} {unit}");
        }
    }
    Ok(Exit::Reached)
}

/// The median of what each of several tries took, divided by `parts`, in µs.
fn timed(rounds: u32, parts: f64, mut work: impl FnMut()) -> f64 {
    median((0..rounds).map(|_| {
        let started = Instant::now();
        work();
        started.elapsed().as_secs_f64() * 1e6 / parts
    }))
}

fn scenario(drones: u32, more: &str) -> Result<Scenario, Failure> {
    let head = format!("[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n");
    let rest = "[drone]\nsafe_distance_m = 37\n[mission]\nstop_x_m = 1000000\n[time]\ntimeout_s = 36000\n";
    let text = head + rest + more;
    Scenario::parse(&text, ScenarioSource { name: "bench", stem: "bench" }, &[]).map_err(Failure::diagnostic)
}

/// What a frame's verdict costs by preset, and what a tick's frames cost a drone, with and without a range.
fn radio(drones: u32, rounds: u32, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    const VERDICTS: u32 = 100_000;
    for preset in ["ideal", "wifi", "mesh-lossy", "lte", "jammed", "satellite"] {
        let radio = scenario(drones, &format!("[radio]\npreset = {preset:?}\n"))?.radio();
        let link = |sequence| Link { source: DroneId(1), destination: DroneId(0), topic: 1, sequence };
        let (path, aired) = (Vec2::new(40.0, 30.0), |sequence| SimTime(i64::from(sequence) * 20_000_000));
        let us = timed(rounds, f64::from(VERDICTS), || {
            (0..VERDICTS).for_each(|n| _ = black_box(radio.outcome(link(n), path, aired(n))));
        });
        figures.push(Figure { drones, what: format!("verdict on a frame, {preset}"), value: us * 1000.0, unit: "ns" });
    }
    for (name, more) in [("unlimited range", ""), ("range of 100 m", "[radio]\nrange_m = 100\n")] {
        let us = tick_us(&scenario(drones, more)?, rounds)?;
        figures.push(Figure { drones, what: format!("a drone's tick, trivial pilot, {name}"), value: us, unit: "µs" });
    }
    Ok(())
}

/// What a tick of the trivial pilot costs a drone, its radio included, µs.
fn tick_us(scenario: &Scenario, rounds: u32) -> Result<f64, Failure> {
    const TICKS: u32 = 50;
    let mut world = mission::world(scenario).map_err(Failure::environment)?;
    let drones = scenario.formation.drones;
    let (factory, mut scratch) = (DroneFactory::new(scenario, PilotKind::Beacon), StepScratch::default());
    let pilot_host = |id| factory.pilot_host(DroneId(id), 1, SimTime::ZERO);
    let mut cockpits: Vec<_> = (0..drones).map(pilot_host).collect();
    let (mut slot, mut stats) = (Slot::default(), LinkStats::default());
    Ok(median((0..rounds).map(|_| {
        let mut spent_s = 0.0;
        for _ in 0..TICKS {
            let mut answers = Vec::new();
            let down = world.downlink().view();
            let started = Instant::now();
            for pilot_host in &mut cockpits {
                let said = pilot_host.step(&down, &mut scratch, &mut slot, &mut stats);
                answers.push((slot, said.iter().map(Message::encode).collect::<Vec<_>>()));
            }
            spent_s += started.elapsed().as_secs_f64();
            for ((slot, frames), id) in answers.iter().zip(0..) {
                world.take_slot(DroneId(id), slot);
                world.take_frames(DroneId(id), frames);
            }
            world.advance();
        }
        spent_s * 1e6 / f64::from(TICKS) / f64::from(drones)
    })))
}

/// The exact split over two and four routes, with and without its tie-break.
fn grouping(drones: u32, rounds: u32, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    for routes in [2usize, 4] {
        let arrival = |i: usize, r: usize| ((i * 7919 + r * 104_729) % 4001) as f64 / 10.0 + 3.0 * r as f64;
        let rows: Vec<Vec<f64>> = (0..drones as usize).map(|i| (0..routes).map(|r| arrival(i, r)).collect()).collect();
        let table = ArrivalTable::new(&rows, &vec![3.5; routes]).map_err(Failure::environment)?;
        let least = timed(rounds, 1000.0, || _ = black_box(table.least_makespan_s()));
        let whole = timed(rounds, 1000.0, || _ = black_box(table.split()));
        figures.push(Figure { drones, what: format!("least makespan, {routes} routes"), value: least, unit: "ms" });
        figures.push(Figure {
            drones,
            what: format!("split of least path, {routes} routes"),
            value: whole,
            unit: "ms",
        });
    }
    Ok(())
}

/// What the world's part of a tick costs a drone, with obstacles far and near.
fn sense(drones: u32, rounds: u32, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    for obstacles in [0usize, 16, 256] {
        let circle = |i: usize| {
            let (x, y) = (200 + 150 * (i % 16), 150 * (i / 16) as i64 - 1200);
            format!("[[obstacle]]\nshape = \"circle\"\ncentre_m = [{x}, {y}]\nradius_m = 10\n")
        };
        let scenario = scenario(drones, &(0..obstacles).map(circle).collect::<String>())?;
        let mut world = mission::world(&scenario).map_err(Failure::environment)?;
        const TICKS: u32 = 50;
        let us = timed(rounds, f64::from(TICKS * drones), || {
            for _ in 0..TICKS {
                black_box(world.downlink());
                (0..drones).for_each(|id| world.take_slot(DroneId(id), &Slot::default()));
                world.advance();
            }
        });
        let what = format!("the world's part of an agent-step, {obstacles} obstacles");
        figures.push(Figure { drones, what, value: us, unit: "µs" });
    }
    Ok(())
}

/// Recorded flights against unrecorded ones, in pairs.
fn record(drones: u32, rounds: u32, figures: &mut Vec<Figure>) -> Result<(), Failure> {
    let scratch = Scratch::new()?;
    let folder = &scratch.0;
    let file = folder.join("record.toml");
    let ticks = (80_000 / drones.max(8)).max(100);
    let mut flown = scenario(drones, "")?;
    flown.time.timeout_s = f64::from(ticks) * flown.time.dt_s;
    let text = flown.to_toml().map_err(Failure::environment)?;
    std::fs::write(&file, text).map_err(Failure::environment)?;
    for runtime in ["inline", "processes"] {
        let fly = |more: &[&str]| fly_s(&file, &folder.join("run"), runtime, more);
        let mut ratios = Vec::new();
        for round in 0..rounds {
            // Now one first, now the other.
            let (with, without) = if round % 2 == 0 {
                let with = fly(&[])?;
                (with, fly(&["--no-record"])?)
            } else {
                let without = fly(&["--no-record"])?;
                (fly(&[])?, without)
            };
            ratios.push(without / with);
        }
        let what = format!("ticks/s recorded over unrecorded, {runtime}");
        figures.push(Figure { drones, what, value: median(ratios.into_iter()), unit: "" });
    }
    Ok(())
}

/// Wall time of a flight from the first tick to the last, s.
fn fly_s(file: &Path, out: &Path, runtime: &str, more: &[&str]) -> Result<f64, Failure> {
    let executable = std::env::current_exe().map_err(Failure::environment)?;
    let mut command = Command::new(executable);
    command.arg("run").arg(file).arg("--out").arg(out).args(["--force", "--json", "--runtime", runtime]).args(more);
    let output = command.stderr(Stdio::null()).output().map_err(Failure::environment)?;
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).map_err(Failure::environment)?;
    summary["wall_s"].as_f64().ok_or_else(|| Failure::environment("a flight gave no wall_s"))
}
