//! Swarms in real time: how late ticks open, and how many drones answer too late.

use crate::context::Context;
use crate::error::BenchError;
use crate::scratch::ScratchFolder;
use clap::Args;
use serde::Serialize;
use skein_runtime::Program;
use std::path::Path;

/// Flights by the wall clock, one for each size of the swarm and each tick rate.
#[derive(Clone, Debug, Args)]
pub struct ClockBench {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "8,64")]
    pub drones: Vec<u32>,
    /// Tick rates, 1/s
    #[arg(long, value_name = "HZ,…", value_delimiter = ',', default_value = "50,100,400")]
    pub rates: Vec<u32>,
    /// Length of each flight, s
    #[arg(long, default_value_t = 20.0)]
    pub seconds: f64,
    /// Freeze one drone for the second half of each flight: no other drone may be late because of it
    #[arg(long)]
    pub freeze: bool,
}

/// The measurement of one flight.
#[derive(Clone, Debug, Serialize)]
pub struct ClockRow {
    /// Size of the swarm.
    pub drones: u32,
    /// Tick rate, 1/s.
    pub rate_hz: u32,
    /// Ticks flown.
    pub ticks: u64,
    /// Ticks that a drone did not answer in time, added up over the drones.
    pub late_answers: u64,
    /// Share of late answers in all answers.
    pub late_share: f64,
    /// Median lateness of a tick's opening, µs.
    pub lateness_us_p50: f64,
    /// 99th percentile of the lateness, µs.
    pub lateness_us_p99: f64,
    /// Greatest lateness, µs.
    pub lateness_us_max: f64,
}

impl ClockBench {
    /// Flies one mission after the other. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError`] if a flight gives no summary.
    pub fn run(&self, context: &Context<'_>) -> Result<Option<Vec<ClockRow>>, BenchError> {
        let folder = ScratchFolder::new()?;
        let mut rows = Vec::new();
        for &drones in &self.drones {
            for &rate_hz in &self.rates {
                let row = self.fly(drones, rate_hz, context.pilots.program(), folder.path());
                if context.stopped() {
                    return Ok(None);
                }
                rows.push(row?);
            }
        }
        Ok(Some(rows))
    }

    fn scenario(&self, drones: u32, rate_hz: u32) -> String {
        let mut text = format!(
            "[time]\ndt_s = {}\ntimeout_s = {}\n[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n\
             [drone]\nsafe_distance_m = 37\n[mission]\nstop_x_m = 1000000\n",
            1.0 / f64::from(rate_hz),
            self.seconds
        );
        if self.freeze {
            text += &format!("[[fault]]\nkind = \"freeze\"\ndrone = 1\nat_s = {0}\nfor_s = {0}\n", self.seconds / 2.0);
        }
        text
    }

    fn fly(&self, drones: u32, rate_hz: u32, program: &Program, folder: &Path) -> Result<ClockRow, BenchError> {
        let file = folder.join("clock.toml");
        std::fs::write(&file, self.scenario(drones, rate_hz)).map_err(BenchError::file(&file))?;
        let mut command = program.command();
        command.arg("run").arg(&file).args(["--clock", "realtime", "--json", "--no-record", "--force", "--out"]);
        let output = command.arg(folder.join("run")).output().map_err(BenchError::system("starting a flight"))?;
        let summary: serde_json::Value = serde_json::from_slice(&output.stdout).map_err(|_| BenchError::NoSummary {
            flight: format!("the flight of {drones} drones at {rate_hz} ticks/s"),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        })?;
        let number = |name: &str| summary.pointer(name).and_then(serde_json::Value::as_f64).unwrap_or(f64::NAN);
        let (ticks, late) = (number("/ticks"), number("/deadline_misses"));
        Ok(ClockRow {
            drones,
            rate_hz,
            ticks: ticks as u64,
            late_answers: late as u64,
            late_share: late / ticks / f64::from(drones),
            lateness_us_p50: number("/lateness_us/p50"),
            lateness_us_p99: number("/lateness_us/p99"),
            lateness_us_max: number("/lateness_us/max"),
        })
    }
}

/// The rows as a text table.
#[must_use]
pub fn table(rows: &[ClockRow]) -> String {
    let mut text =
        "drones  ticks/s   ticks  late answers       share  ticks late by p50       p99       max\n".to_owned();
    for row in rows {
        let ClockRow { drones, rate_hz, ticks, late_answers, late_share, .. } = row;
        let share = format!("{:.4} %", 100.0 * late_share);
        let [p50, p99, max] =
            [row.lateness_us_p50, row.lateness_us_p99, row.lateness_us_max].map(|us| format!("{us:.0} µs"));
        text += &format!(
            "{drones:>6}  {rate_hz:>7}  {ticks:>6}  {late_answers:>12}  {share:>10}  {p50:>17}  {p99:>8}  {max:>8}\n"
        );
    }
    text
}
