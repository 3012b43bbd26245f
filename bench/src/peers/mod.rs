//! Skein against RVO2, a library for collision avoidance, in the same run on one core.
//!
//! Both fly the same grid in formation. RVO2 computes collision avoidance alone, of agents that know each other's positions and
//! velocities exactly. Skein's drones also send, receive and decode messages, hold a leader, follow a plan and are checked by the world.

mod rvo2;

use crate::context::Context;
use crate::error::BenchError;
use crate::median::median;
use crate::runtime::process_stats::CpuUsage;
use crate::runtime::workload::Workload;
use clap::Args;
use serde::Serialize;
use skein_bus::{PinMode, pin_to_core};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_runtime::inline;
use std::fmt::Write;
use std::path::PathBuf;

/// Which swarms are compared, and how.
#[derive(Clone, Debug, Args)]
pub struct PeerBench {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "8,64,256,1000")]
    pub drones: Vec<u32>,
    /// Rounds; each measures both once, one after the other
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
    /// Core to run on, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub core: usize,
    /// Python with the module pyrvo
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    pub python: PathBuf,
}

/// What was measured for one size of the swarm. Each value is the median of the rounds.
#[derive(Clone, Debug, Serialize)]
pub struct PeerRow {
    /// Size of the swarm.
    pub drones: u32,
    /// Ticks that were measured.
    pub ticks: u64,
    /// Agent-steps of Skein per second of CPU time, world and messages included.
    pub skein_steps_per_s: f64,
    /// Agent-steps of RVO2 per second of CPU time.
    pub rvo2_steps_per_s: f64,
    /// The first divided by the second, in the same round.
    pub ratio: f64,
    /// Least and greatest ratio of the rounds.
    pub ratio_range: [f64; 2],
}

impl PeerBench {
    /// Measures all sizes on one core. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError::NoPeer`] if Python or its module cannot be used; [`BenchError`].
    pub fn run(&self, context: &Context<'_>) -> Result<Option<Vec<PeerRow>>, BenchError> {
        // What this process starts later stays on the core, too.
        pin_to_core(self.core, PinMode::Auto)?;
        rvo2::check(&self.python)?;
        let mut rows = Vec::new();
        for &drones in &self.drones {
            let workload = Workload::new(drones, false, None)?;
            let mut measured = Vec::new();
            for _ in 0..self.rounds {
                let skein = skein_steps_per_s(&workload, context)?;
                if context.stopped() {
                    return Ok(None);
                }
                measured.push([skein, rvo2::steps_per_s(&self.python, &workload)?]);
            }
            rows.push(PeerRow::new(&workload, &measured));
        }
        Ok(Some(rows))
    }
}

impl PeerRow {
    fn new(workload: &Workload, measured: &[[f64; 2]]) -> Self {
        let ratios = || measured.iter().map(|[skein, rvo2]| skein / rvo2);
        Self {
            drones: workload.drones,
            ticks: workload.window(),
            skein_steps_per_s: median(measured.iter().map(|[skein, _]| *skein)),
            rvo2_steps_per_s: median(measured.iter().map(|[_, rvo2]| *rvo2)),
            ratio: median(ratios()),
            ratio_range: [ratios().fold(f64::INFINITY, f64::min), ratios().fold(0.0, f64::max)],
        }
    }
}

/// The rows as a text table.
#[must_use]
pub fn table(rows: &[PeerRow]) -> String {
    let mut out = format!(
        "{:>7}{:>8}{:>26}{:>26}{:>10}\n",
        "drones", "ticks", "Skein, steps/CPU s", "RVO2, steps/CPU s", "ratio"
    );
    for row in rows {
        let PeerRow { drones, ticks, skein_steps_per_s, rvo2_steps_per_s, ratio, ratio_range: [least, most] } = row;
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{drones:>7}{ticks:>8}{skein_steps_per_s:>26.0}{rvo2_steps_per_s:>26.0}{ratio:>10.2} ({least:.2} to {most:.2})"
        );
    }
    out
}

/// Flies the grid inline, in this thread.
fn skein_steps_per_s(workload: &Workload, context: &Context<'_>) -> Result<f64, BenchError> {
    let mut meter = WindowMeter { workload, begun: None, used: None };
    let end = inline::run(&workload.scenario, context.pilots, &mut meter, context.interrupted)?;
    if let Some(failure) = end.failure {
        return Err(BenchError::Flight(failure));
    }
    let steps = workload.window() as f64 * f64::from(workload.drones);
    // Without a value the flight was interrupted, which the caller sees.
    Ok(meter.used.map_or(f64::NAN, |used| 1e6 / used.us_per_step(steps)))
}

/// Measures the CPU time of a window of ticks.
struct WindowMeter<'a> {
    workload: &'a Workload,
    begun: Option<CpuUsage>,
    used: Option<CpuUsage>,
}

impl RecordSink for WindowMeter<'_> {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let now = || CpuUsage::of(std::process::id());
        match record.head.tick {
            tick if tick == self.workload.from => self.begun = Some(now()),
            tick if tick == self.workload.until && self.used.is_none() => {
                self.used = self.begun.map(|begun| now().since(begun));
            }
            _ => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_those_of_a_round() {
        let workload = Workload::new(8, true, Some(10)).unwrap();
        let row = PeerRow::new(&workload, &[[2.0, 1.0], [30.0, 10.0], [1.0, 1.0]]);
        assert_eq!((row.ratio, row.ratio_range, row.ticks), (2.0, [1.0, 3.0], 10));
        assert!(table(&[row]).contains("2.00 (1.00 to 3.00)"));
    }

    #[test]
    fn without_the_module_the_message_says_what_to_install() {
        let error = rvo2::check(&PathBuf::from("/bin/false")).unwrap_err().to_string();
        assert!(error.contains("pip install pyrvo"), "{error}");
        let error = rvo2::check(&PathBuf::from("/no/such/python")).unwrap_err().to_string();
        assert!(error.contains("/no/such/python"), "{error}");
    }

    #[test]
    fn skein_is_measured() {
        let pilots = skein_runtime::PilotRegistry::built_in().unwrap();
        let context = Context { pilots: &pilots, interrupted: &|| None };
        let workload = Workload::new(8, true, Some(400)).unwrap();
        let steps_per_s = skein_steps_per_s(&workload, &context).unwrap();
        assert!(steps_per_s > 100.0 && steps_per_s.is_finite(), "{steps_per_s}");
    }
}
