//! The world divided by space: what its parts would do, measured, and what that says about swarms that no machine has flown.
//!
//! All parts are simulated one after the other in this thread. Each knows only its own drones and what it is sent of others.

mod cost_model;
mod forecast;
mod loopback;
mod report;

pub use cost_model::{CostModel, PartMeans};
pub use forecast::{Forecast, Habits};
pub use loopback::Wire;
pub use report::{SplitReport, SplitRow};

use crate::context::Context;
use crate::error::BenchError;
use crate::runtime::workload::Workload;
use clap::Args;
use cost_model::PartSums;
use skein_runtime::SplitSwarm;

/// Ticks before the measurement: by then all drones are in formation.
const WARM_UP_TICKS: u64 = 60;
/// Sizes about which the model is asked.
const LARGE: [f64; 3] = [1e4, 1e5, 1e6];
/// Numbers of parts about which it is asked.
const MANY: [f64; 5] = [1.0, 16.0, 64.0, 256.0, 1024.0];
/// A network between machines that is assumed: 10 Gbit/s, 100 µs there and back.
const NETWORK: Wire = Wire { round_trip_us: 100.0, byte_us: 0.0008 };

/// Which swarms are measured, in how many parts.
#[derive(Clone, Debug, Args)]
pub struct SplitBench {
    /// Sizes of the swarm; the cost model is made from every other one and checked on the rest
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "64,128,256,512,1000,2000,4000")]
    pub drones: Vec<u32>,
    /// Numbers of parts
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,2,4,16", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub parts: Vec<u32>,
    /// Ticks to measure [default: fewer for larger swarms]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub ticks: Option<u64>,
}

impl SplitBench {
    /// Flies every size in every number of parts. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError::Digests`] if the parts do not give one digest; [`BenchError`].
    pub fn run(&self, context: &Context<'_>) -> Result<Option<SplitReport>, BenchError> {
        let (mut rows, mut habits) = (Vec::new(), None);
        for &drones in &self.drones {
            // At least a few beacon periods.
            let ticks = self.ticks.unwrap_or((120_000 / u64::from(drones.max(1))).clamp(50, 500));
            let workload = Workload::new(drones, false, Some(ticks))?;
            for &parts in &self.parts {
                let Some(row) = measure(&workload, parts, context)? else { return Ok(None) };
                rows.push(row);
            }
            habits = rows.last().map(|row| row.habits(&workload));
        }
        check_digests(&rows)?;
        let Some(habits) = habits else { return Ok(Some(SplitReport::default())) };
        let learnt = |row: &&SplitRow| self.drones.iter().step_by(2).any(|size| *size == row.drones);
        let parts: Vec<PartMeans> = rows.iter().filter(learnt).flat_map(|row| &row.parts).copied().collect();
        let model = CostModel::fit(&parts);
        for row in &mut rows {
            row.judge(&model, self.drones.iter().step_by(2).any(|size| *size == row.drones));
        }
        let forecasts = |wire: &Wire| {
            let pairs = LARGE.iter().flat_map(|&drones| MANY.iter().map(move |&parts| (drones, parts)));
            pairs.map(|pair| Forecast::new(pair, &habits, &model, wire)).collect::<Vec<Forecast>>()
        };
        let loopback = Wire::loopback()?;
        Ok(Some(SplitReport {
            forecasts: forecasts(&NETWORK),
            rows,
            habits: Some(habits),
            model: Some(model),
            loopback: Some(loopback),
            network: Some(NETWORK),
        }))
    }
}

/// Flies one swarm in so many parts.
fn measure(workload: &Workload, parts: u32, context: &Context<'_>) -> Result<Option<SplitRow>, BenchError> {
    let mut swarm = SplitSwarm::new(&workload.scenario, context.pilots, parts as usize)?;
    let mut sums = vec![PartSums::default(); parts as usize];
    for tick in 0..WARM_UP_TICKS + workload.window() {
        if context.stopped() {
            return Ok(None);
        }
        let done = swarm.tick()?;
        if tick >= WARM_UP_TICKS {
            sums.iter_mut().zip(done).for_each(|(sums, part)| sums.add(part));
        }
    }
    let means = sums.iter().map(|sums| sums.means(workload.drones)).collect();
    Ok(Some(SplitRow::new(workload.drones, workload.window(), swarm.digest(), means)))
}

fn check_digests(rows: &[SplitRow]) -> Result<(), BenchError> {
    for row in rows {
        let first = rows.iter().find(|first| first.drones == row.drones).unwrap_or(row);
        if row.digest != first.digest {
            return Err(BenchError::Digests { drones: row.drones, parts: row.parts.len() });
        }
    }
    Ok(())
}
