//! What pilots cost: the same mission is flown with one pilot after the other, interleaved in rounds.

use crate::context::Context;
use crate::error::BenchError;
use crate::flown_by::flown_by;
use crate::median::median;
use clap::Args;
use serde::Serialize;
use skein_bus::{PinMode, WaitMode};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_runtime::{Clock, Launch, PATIENCE, ProcessInfo, inline, supervisor};
use skein_scenario::{PilotKeys, Scenario, ScenarioSource};
use std::time::Instant;

/// Which pilots are measured, and how.
#[derive(Clone, Debug, Args)]
pub struct PilotBench {
    /// Pilots to fly: built-in ones and those of the program; the others are compared with the first
    #[arg(value_name = "NAME,…", value_delimiter = ',', required = true)]
    pub names: Vec<String>,
    /// Size of the swarm in the default mission, which is 120 s in the open
    #[arg(long, value_name = "N", default_value_t = 8)]
    pub drones: u32,
    /// Give each drone a process; otherwise all fly in one thread
    #[arg(long)]
    pub processes: bool,
    /// Flights with each pilot; ratios are taken within a round
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
}

/// What was measured of one pilot. Each value is the median of the rounds.
#[derive(Clone, Debug, Serialize)]
pub struct PilotRow {
    /// The pilot.
    pub pilot: String,
    /// Ticks of a flight.
    pub ticks: u64,
    /// Steps of drones per second of wall time, the world's part of a tick included.
    pub drone_steps_per_s: f64,
    /// Simulated time per wall time.
    pub realtime_factor: f64,
    /// Drone-steps per second divided by those of the first pilot in the same round.
    pub ratio: f64,
    /// Least and greatest ratio of the rounds.
    pub ratio_range: [f64; 2],
}

impl PilotBench {
    /// Flies the mission, or the default one, with each pilot in each round. A table `[[pilot]]` of the mission that names the
    /// pilot gives it its parameters. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError`], for example if there is no such pilot.
    pub fn run(&self, mission: Option<&Scenario>, context: &Context<'_>) -> Result<Option<Vec<PilotRow>>, BenchError> {
        let mission = mission.map_or_else(|| in_the_open(self.drones), |mission| Ok(mission.clone()))?;
        let flights: Vec<Scenario> = self.names.iter().map(|name| with_params(&mission, name)).collect();
        for flight in &flights {
            context.pilots.check(flight, !self.processes).map_err(skein_runtime::RuntimeError::from)?;
        }
        let mut measured = vec![Vec::new(); flights.len()];
        for _ in 0..self.rounds {
            for (flight, measured) in flights.iter().zip(&mut measured) {
                let counted = self.fly(flight, context)?;
                if context.stopped() {
                    return Ok(None);
                }
                measured.push(counted);
            }
        }
        Ok(Some(self.names.iter().zip(&measured).map(|(name, of)| row(name, of, &measured[0])).collect()))
    }

    fn fly(&self, scenario: &Scenario, context: &Context<'_>) -> Result<StepCounter, BenchError> {
        let mut counter = StepCounter::default();
        let end = if self.processes {
            let launch = Launch {
                scenario,
                clock: Clock::Lockstep,
                pin: PinMode::Auto,
                wait: WaitMode::Block,
                patience: PATIENCE,
                per_process: 1,
                program: context.pilots.program(),
                hosts: &[],
                on_ready: &mut |_: &[ProcessInfo]| Ok(()),
                interrupted: &mut || (context.interrupted)(),
            };
            supervisor::run(launch, &mut counter)?
        } else {
            inline::run(scenario, context.pilots, &mut counter, context.interrupted)?
        };
        match end.failure {
            Some(failure) => Err(BenchError::Flight(failure)),
            None => Ok(counter),
        }
    }
}

/// The rows as text, one line each.
#[must_use]
pub fn table(rows: &[PilotRow]) -> String {
    let line = |row: &PilotRow| {
        let PilotRow { pilot, ticks, drone_steps_per_s, realtime_factor, ratio, ratio_range: [least, most] } = row;
        let steps = drone_steps_per_s / 1e3;
        format!(
            "{pilot:<16} {ticks:>7} ticks {steps:>9.0} thousand drone-steps/s {realtime_factor:>8.1} × real time   \
             ratio {ratio:.3} ({least:.3} to {most:.3})\n"
        )
    };
    rows.iter().map(line).collect()
}

/// Counts the steps between the first and the last tick, and times them.
#[derive(Clone, Debug, Default)]
struct StepCounter {
    first: Option<Instant>,
    ticks: u64,
    steps: u64,
    /// Simulated time of the first and of the last tick, s.
    simulated_s: [f64; 2],
    wall_s: f64,
}

impl StepCounter {
    fn steps_per_s(&self) -> f64 {
        self.steps as f64 / self.wall_s.max(1e-9)
    }

    fn realtime_factor(&self) -> f64 {
        (self.simulated_s[1] - self.simulated_s[0]) / self.wall_s.max(1e-9)
    }
}

impl RecordSink for StepCounter {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        self.ticks += 1;
        self.simulated_s[1] = record.head.now.secs();
        match self.first {
            None => (self.first, self.simulated_s[0]) = (Some(Instant::now()), record.head.now.secs()),
            Some(first) => {
                self.steps += record.rows.iter().filter(|row| row.alive()).count() as u64;
                self.wall_s = first.elapsed().as_secs_f64();
            }
        }
        Ok(())
    }
}

fn row(name: &str, of: &[StepCounter], first: &[StepCounter]) -> PilotRow {
    let ratios: Vec<f64> = of.iter().zip(first).map(|(of, first)| of.steps_per_s() / first.steps_per_s()).collect();
    let (least, most) =
        (ratios.iter().copied().fold(f64::INFINITY, f64::min), ratios.iter().copied().fold(0.0, f64::max));
    PilotRow {
        pilot: name.to_owned(),
        ticks: of.first().map_or(0, |counter| counter.ticks),
        drone_steps_per_s: median(of.iter().map(StepCounter::steps_per_s)),
        realtime_factor: median(of.iter().map(StepCounter::realtime_factor)),
        ratio: median(ratios.into_iter()),
        ratio_range: [least, most],
    }
}

/// The mission with this pilot for all drones.
fn with_params(mission: &Scenario, name: &str) -> Scenario {
    let table = mission.pilots.iter().find(|table| table.name.as_deref() == Some(name) && table.command.is_none());
    let mut scenario = flown_by(mission, name);
    if let (Some(table), [own]) = (table, &mut scenario.pilots[..]) {
        *own = PilotKeys { drones: None, ..table.clone() };
    }
    scenario
}

fn in_the_open(drones: u32) -> Result<Scenario, BenchError> {
    let text = format!(
        "[formation]\nshape = \"grid\"\ndrones = {drones}\nspacing_m = 65\n[drone]\nsafe_distance_m = 37\n\
         [mission]\nend = \"time\"\nduration_s = 120\n"
    );
    Ok(Scenario::parse(&text, ScenarioSource { name: "bench", stem: "bench" }, &[])?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_runtime::PilotRegistry;

    #[test]
    fn each_pilot_is_compared_with_the_first() {
        let pilots = PilotRegistry::built_in().unwrap();
        let context = Context { pilots: &pilots, interrupted: &|| None };
        let names = ["cruise", "paper"].map(str::to_owned).to_vec();
        let bench = PilotBench { names, drones: 3, processes: false, rounds: 2 };
        let rows = bench.run(None, &context).unwrap().unwrap();
        assert_eq!((rows[0].pilot.as_str(), rows[0].ratio, rows[0].ticks), ("cruise", 1.0, 6001));
        let [steps, factor] = [rows[0].drone_steps_per_s, rows[0].realtime_factor];
        assert!((steps / (3.0 * 50.0 * factor) - 1.0).abs() < 1e-3, "three drones step 50 times a second: {rows:?}");
        assert!(rows[1].ratio > 0.0 && rows[1].ratio < 1.0, "{rows:?}");
        let wrong = PilotBench { names: vec!["cruize".to_owned()], ..bench }.run(None, &context).unwrap_err();
        assert!(wrong.is_usage() && wrong.to_string().contains("did you mean `cruise`?"), "{wrong}");
    }
}
