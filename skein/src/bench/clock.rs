//! Swarms by the wall clock: how late ticks open, and how many answers come too late.

use super::Scratch;
use crate::exit::{Exit, Failure};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Arguments of `bench clock`.
#[derive(Clone, Debug, Args)]
pub struct ClockArgs {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "8,64")]
    pub drones: Vec<u32>,
    /// Ticks a second
    #[arg(long, value_name = "HZ,…", value_delimiter = ',', default_value = "50,100,400")]
    pub rates: Vec<u32>,
    /// Length of each flight, s
    #[arg(long, default_value_t = 20.0)]
    pub seconds: f64,
    /// Freeze one drone from the middle on: nobody else may be late for that
    #[arg(long)]
    pub freeze: bool,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Serialize)]
struct Row {
    drones: u32,
    rate_hz: u32,
    ticks: u64,
    late_answers: u64,
    late_share: f64,
    lateness_us_p50: f64,
    lateness_us_p99: f64,
    lateness_us_max: f64,
}

/// Flies them one after the other.
pub fn clock(args: &ClockArgs) -> Result<Exit, Failure> {
    let folder = Scratch::new()?;
    let mut rows = Vec::new();
    for &drones in &args.drones {
        for &rate in &args.rates {
            rows.push(fly(args, drones, rate, &folder.0)?);
        }
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&rows).map_err(Failure::environment)?);
        return Ok(Exit::Reached);
    }
    println!("drones  ticks/s   ticks  late answers      of all  opened late by p50       p99       max");
    for row in &rows {
        let Row { drones, rate_hz, ticks, late_answers, late_share, .. } = row;
        let share = format!("{:.4} %", 100.0 * late_share);
        let late = [row.lateness_us_p50, row.lateness_us_p99, row.lateness_us_max].map(|us| format!("{us:.0} µs"));
        println!(
            "{drones:>6}  {rate_hz:>7}  {ticks:>6}  {late_answers:>12}  {share:>10}  {:>18}  {:>8}  {:>8}",
            late[0], late[1], late[2]
        );
    }
    Ok(Exit::Reached)
}

fn fly(args: &ClockArgs, drones: u32, rate: u32, folder: &Path) -> Result<Row, Failure> {
    let file: PathBuf = folder.join("clock.toml");
    let mut text = format!(
        "[time]\ndt_s = {}\ntimeout_s = {}\n[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n\
         [drone]\nsafe_distance_m = 37\n[mission]\nstop_x_m = 1000000\n",
        1.0 / f64::from(rate),
        args.seconds
    );
    if args.freeze {
        text += &format!("[[fault]]\nkind = \"freeze\"\ndrone = 1\nat_s = {0}\nfor_s = {0}\n", args.seconds / 2.0);
    }
    std::fs::write(&file, text).map_err(Failure::environment)?;
    let mut command = Command::new(std::env::current_exe().map_err(Failure::environment)?);
    command.arg("run").arg(&file).args(["--clock", "realtime", "--json", "--no-record", "--force", "--out"]);
    let output = command.arg(folder.join("run")).output().map_err(Failure::environment)?;
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).map_err(|_| {
        let said = String::from_utf8_lossy(&output.stderr);
        Failure::environment(format!("the flight of {drones} at {rate}/s gave no summary: {said}"))
    })?;
    let number = |name: &str| summary.pointer(name).and_then(serde_json::Value::as_f64).unwrap_or(f64::NAN);
    let (ticks, late) = (number("/ticks"), number("/deadline_misses"));
    Ok(Row {
        drones,
        rate_hz: rate,
        ticks: ticks as u64,
        late_answers: late as u64,
        late_share: late / ticks / f64::from(drones),
        lateness_us_p50: number("/lateness_us/p50"),
        lateness_us_p99: number("/lateness_us/p99"),
        lateness_us_max: number("/lateness_us/max"),
    })
}
