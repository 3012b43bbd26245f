//! The parts of a tick whose cost grows with the swarm, each measured alone: radio, grouping, sensing, recording.

use crate::context::Context;
use crate::error::BenchError;
use crate::flown_by::flown_by;
use crate::median::median;
use crate::scratch::ScratchFolder;
use clap::Args;
use serde::Serialize;
use skein_leader::split::ArrivalTable;
use skein_protocol::radio::Link;
use skein_protocol::slot::{LinkStats, Slot};
use skein_protocol::{DroneId, SimTime, Vec3};
use skein_runtime::{DroneFactory, PilotRegistry, Program, StepScratch, mission};
use skein_scenario::{Scenario, ScenarioSource};
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Instant;

/// How a part is measured.
#[derive(Clone, Debug, Args)]
pub struct PartBench {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "8,64,256,1000")]
    pub drones: Vec<u32>,
    /// Measurements of each figure; the median is reported
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
}

/// A part of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Deciding which frames a drone receives.
    Radio,
    /// The exact assignment of drones to routes.
    Grouping,
    /// The world's part of a tick: what each drone senses.
    Sense,
    /// Recording a flight.
    Record,
}

/// One measured value.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    /// Size of the swarm.
    pub drones: u32,
    /// What was measured.
    pub what: String,
    /// The median.
    pub value: f64,
    /// Unit of the value; empty for a ratio.
    pub unit: &'static str,
}

impl PartBench {
    /// Measures one part. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError`], for example if no scenario has this many drones.
    pub fn run(&self, part: Part, context: &Context<'_>) -> Result<Option<Vec<Figure>>, BenchError> {
        let mut figures = Vec::new();
        for &drones in &self.drones {
            match part {
                Part::Radio => radio(drones, self.rounds, context.pilots, &mut figures)?,
                Part::Grouping => grouping(drones, self.rounds, &mut figures)?,
                Part::Sense => sense(drones, self.rounds, &mut figures)?,
                Part::Record => record(drones, self.rounds, context.pilots.program(), &mut figures)?,
            }
            if context.stopped() {
                return Ok(None);
            }
        }
        Ok(Some(figures))
    }
}

/// The figures as text, one line each.
#[must_use]
pub fn table(figures: &[Figure]) -> String {
    let line = |Figure { drones, what, value, unit }: &Figure| {
        format!("{drones:>6} drones  {what:<52} {value:>10.3} {unit}").trim_end().to_owned() + "\n"
    };
    figures.iter().map(line).collect()
}

/// Calls `work` several times. Returns the median of the times divided by `parts`, µs.
fn timed(rounds: u32, parts: f64, mut work: impl FnMut()) -> f64 {
    median((0..rounds).map(|_| {
        let started = Instant::now();
        work();
        started.elapsed().as_secs_f64() * 1e6 / parts
    }))
}

fn scenario(drones: u32, more: &str) -> Result<Scenario, BenchError> {
    let head = format!("[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n");
    let rest = "[drone]\nsafe_distance_m = 37\n[mission]\nstop_x_m = 1000000\n[time]\ntimeout_s = 36000\n";
    let text = head + rest + more;
    Ok(Scenario::parse(&text, ScenarioSource { name: "bench", stem: "bench" }, &[])?)
}

/// The cost of deciding about one frame, for each radio preset, and of a drone's tick with and without a radio range.
fn radio(drones: u32, rounds: u32, pilots: &PilotRegistry, figures: &mut Vec<Figure>) -> Result<(), BenchError> {
    const FRAMES: u32 = 100_000;
    for preset in ["ideal", "wifi", "mesh-lossy", "lte", "jammed", "satellite"] {
        let radio = scenario(drones, &format!("[radio]\npreset = {preset:?}\n"))?.radio();
        let link = |sequence| Link { source: DroneId(1), destination: DroneId(0), topic: 1, sequence };
        let (path, aired) = (Vec3::new(40.0, 30.0, 0.0), |sequence| SimTime(i64::from(sequence) * 20_000_000));
        let us = timed(rounds, f64::from(FRAMES), || {
            for n in 0..FRAMES {
                black_box(radio.outcome(link(n), path, aired(n)));
            }
        });
        figures.push(Figure {
            drones,
            what: format!("delivery of one frame, {preset}"),
            value: us * 1000.0,
            unit: "ns",
        });
    }
    for (name, more) in [("unlimited range", ""), ("range of 100 m", "[radio]\nrange_m = 100\n")] {
        let us = tick_us(&scenario(drones, more)?, pilots, rounds)?;
        figures.push(Figure {
            drones,
            what: format!("one drone's tick, trivial pilot, {name}"),
            value: us,
            unit: "µs",
        });
    }
    Ok(())
}

/// The time of one tick of one drone with the trivial pilot, its radio included, µs.
fn tick_us(scenario: &Scenario, pilots: &PilotRegistry, rounds: u32) -> Result<f64, BenchError> {
    const TICKS: u32 = 50;
    let scenario = flown_by(scenario, "beacon");
    let mut world = mission::world(&scenario)?;
    let drones = scenario.formation.drones;
    let (factory, mut scratch) = (DroneFactory::new(&scenario, pilots), StepScratch::default());
    let host = |id| factory.pilot_host(DroneId(id), 1, SimTime::ZERO);
    let mut hosts = (0..drones).map(host).collect::<Result<Vec<_>, _>>()?;
    let (mut slot, mut stats) = (Slot::default(), LinkStats::default());
    Ok(median((0..rounds).map(|_| {
        let mut spent_s = 0.0;
        for _ in 0..TICKS {
            let mut answers = Vec::new();
            let down = world.downlink().view();
            let started = Instant::now();
            for host in &mut hosts {
                let said = host.step(&down, &mut scratch, &mut slot, &mut stats);
                answers.push((slot, said.frames().collect::<Vec<_>>()));
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

/// The exact assignment to two and to four routes, with and without its tie-break.
fn grouping(drones: u32, rounds: u32, figures: &mut Vec<Figure>) -> Result<(), BenchError> {
    for routes in [2usize, 4] {
        let arrival = |i: usize, r: usize| ((i * 7919 + r * 104_729) % 4001) as f64 / 10.0 + 3.0 * r as f64;
        let rows: Vec<Vec<f64>> = (0..drones as usize).map(|i| (0..routes).map(|r| arrival(i, r)).collect()).collect();
        let table = ArrivalTable::new(&rows, &vec![3.5; routes])?;
        let makespan = timed(rounds, 1000.0, || _ = black_box(table.least_makespan_s()));
        let assignment = timed(rounds, 1000.0, || _ = black_box(table.split()));
        figures.push(Figure { drones, what: format!("least makespan, {routes} routes"), value: makespan, unit: "ms" });
        figures.push(Figure {
            drones,
            what: format!("assignment of least path, {routes} routes"),
            value: assignment,
            unit: "ms",
        });
    }
    Ok(())
}

/// The world's part of a tick per drone, without obstacles and with some.
fn sense(drones: u32, rounds: u32, figures: &mut Vec<Figure>) -> Result<(), BenchError> {
    for obstacles in [0usize, 16, 256] {
        let circle = |i: usize| {
            let (x, y) = (200 + 150 * (i % 16), 150 * (i / 16) as i64 - 1200);
            format!("[[obstacle]]\nshape = \"circle\"\ncentre_m = [{x}, {y}]\nradius_m = 10\n")
        };
        let scenario = scenario(drones, &(0..obstacles).map(circle).collect::<String>())?;
        let mut world = mission::world(&scenario)?;
        const TICKS: u32 = 50;
        let us = timed(rounds, f64::from(TICKS * drones), || {
            for _ in 0..TICKS {
                black_box(world.downlink());
                for id in 0..drones {
                    world.take_slot(DroneId(id), &Slot::default());
                }
                world.advance();
            }
        });
        let what = format!("the world's part of an agent-step, {obstacles} obstacles");
        figures.push(Figure { drones, what, value: us, unit: "µs" });
    }
    Ok(())
}

/// The speed of recorded flights over that of unrecorded ones, measured in pairs.
fn record(drones: u32, rounds: u32, program: &Program, figures: &mut Vec<Figure>) -> Result<(), BenchError> {
    let scratch = ScratchFolder::new()?;
    let file = scratch.path().join("record.toml");
    let ticks = (80_000 / drones.max(8)).max(100);
    let mut flown = scenario(drones, "")?;
    flown.time.timeout_s = Some(f64::from(ticks) * flown.time.dt_s);
    let text = flown.to_toml()?;
    std::fs::write(&file, text).map_err(BenchError::file(&file))?;
    for runtime in ["inline", "processes"] {
        let flight = TimedFlight { program, file: &file, out: scratch.path().join("run"), runtime };
        let mut ratios = Vec::new();
        for round in 0..rounds {
            // The order alternates.
            let (with, without) = if round % 2 == 0 {
                let with = flight.wall_s(&[])?;
                (with, flight.wall_s(&["--no-record"])?)
            } else {
                let without = flight.wall_s(&["--no-record"])?;
                (flight.wall_s(&[])?, without)
            };
            ratios.push(without / with);
        }
        let what = format!("ticks/s recorded over unrecorded, {runtime}");
        figures.push(Figure { drones, what, value: median(ratios.into_iter()), unit: "" });
    }
    Ok(())
}

/// A flight in another process, whose wall time is wanted.
struct TimedFlight<'a> {
    program: &'a Program,
    file: &'a Path,
    out: PathBuf,
    runtime: &'a str,
}

impl TimedFlight<'_> {
    /// Flies it with more arguments. Returns the wall time from the first tick to the last, s.
    fn wall_s(&self, more: &[&str]) -> Result<f64, BenchError> {
        let mut command = self.program.command();
        command.arg("run").arg(self.file).arg("--out").arg(&self.out);
        command.args(["--force", "--json", "--runtime", self.runtime]).args(more).stderr(Stdio::null());
        let output = command.output().map_err(BenchError::system("starting a flight"))?;
        let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let flight = || format!("a flight of {} ({})", self.file.display(), self.runtime);
        summary["wall_s"].as_f64().ok_or_else(|| BenchError::NoSummary { flight: flight(), stderr: String::new() })
    }
}
