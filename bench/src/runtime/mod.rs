//! The cost of a tick, measured against function calls and against a baseline of raw shared memory, interleaved in one
//! run. Absolute figures belong to the machine; the ratios within a round carry over to others.

mod baseline;
mod case;
mod flight;
mod measurement;
pub(crate) mod process_stats;
mod report;
pub(crate) mod workload;

pub use baseline::BaselinePeer;
pub use case::Case;
pub use measurement::Measurement;
pub use report::{CaseRow, Ratio, RuntimeReport};

use crate::context::Context;
use crate::error::BenchError;
use clap::{Args, ValueEnum};
use workload::Workload;

/// Rounds of a quick benchmark.
const QUICK_ROUNDS: u32 = 3;

/// Which swarms are measured, and how long.
#[derive(Clone, Debug, Args)]
pub struct RuntimeBench {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,8,64,256,1000")]
    pub drones: Vec<u32>,
    /// Rounds; each measures every case once
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
    /// Measure a third of the ticks, in three rounds at most
    #[arg(long)]
    pub quick: bool,
    /// Ticks to measure [default: fewer for larger swarms]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub ticks: Option<u64>,
    /// Measure only these cases
    #[arg(long, value_enum, value_name = "CASE,…", value_delimiter = ',')]
    pub cases: Vec<Case>,
    /// Also measure another transport
    #[arg(long, value_enum)]
    pub compare: Option<Compare>,
}

impl Default for RuntimeBench {
    fn default() -> Self {
        Self {
            drones: vec![1, 8, 64, 256, 1000],
            rounds: 7,
            quick: false,
            ticks: None,
            cases: Vec::new(),
            compare: None,
        }
    }
}

/// Another transport.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Compare {
    /// The same exchange over Unix datagrams
    Uds,
}

/// What is being measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Size of the swarm.
    pub drones: u32,
    /// Round, from 1.
    pub round: u32,
    /// All rounds.
    pub rounds: u32,
    /// Case.
    pub case: Case,
}

impl RuntimeBench {
    /// Measures every size and case; `progress` is called before each measurement. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn run(
        &self,
        context: &Context<'_>,
        mut progress: impl FnMut(Progress),
    ) -> Result<Option<RuntimeReport>, BenchError> {
        skein_bus::clean()?;
        let rounds = if self.quick { self.rounds.min(QUICK_ROUNDS) } else { self.rounds };
        let mut report = RuntimeReport::new(skein_bus::allowed_cores()?, rounds);
        for &drones in &self.drones {
            let workload = Workload::new(drones, self.quick, self.ticks)?;
            let cases = Case::of(drones, self.compare.is_some(), &self.cases);
            if cases.is_empty() {
                return Err(BenchError::NoCase { drones });
            }
            let mut measured: Vec<Vec<Measurement>> = vec![Vec::new(); cases.len()];
            for round in 0..rounds {
                // Each round begins with another case, so that no case always follows the same one.
                for place in (0..cases.len()).map(|i| (i + round as usize) % cases.len()) {
                    progress(Progress { drones, round: round + 1, rounds, case: cases[place] });
                    let measurement = cases[place].measure(&workload, context);
                    if context.stopped() {
                        return Ok(None);
                    }
                    measured[place].push(measurement?);
                }
            }
            report.add(drones, &cases, &measured);
        }
        Ok(Some(report))
    }
}
