//! Failover: leaders are killed again and again. Measures the time until all drones follow another leader, by the world's
//! record.

mod flight;
mod monitor;
mod row;
mod setting;

pub use row::FailoverRow;
pub use setting::ClockChoice;

use crate::context::Context;
use crate::error::BenchError;
use clap::Args;
use flight::fly;
use serde::Serialize;
use setting::Setting;

/// Kills per mission of a quick benchmark.
const QUICK_KILLS: u32 = 10;
/// Kills per mission otherwise.
const KILLS: u32 = 200;

/// Which missions are flown.
#[derive(Clone, Debug, Args)]
pub struct FailoverBench {
    /// Leaders to kill for each clock, loss and delay [default: 200]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub kills: Option<u32>,
    /// Ten kills each, without delay
    #[arg(long, conflicts_with = "delays_s")]
    pub quick: bool,
    /// What paces the ticks [default: both, one after the other]
    #[arg(long, value_enum)]
    pub clock: Option<ClockChoice>,
    /// Shares of frames that are lost
    #[arg(long = "loss", value_name = "P,…", value_delimiter = ',', default_values_t = [0.0, 0.1, 0.5])]
    pub losses: Vec<f64>,
    /// Transmission delays of a frame, s
    #[arg(long = "delay", value_name = "S,…", value_delimiter = ',', default_values_t = [0.0, 0.1])]
    pub delays_s: Vec<f64>,
    /// Times between two heartbeats of a leader, s; a leader is missed after three, and a tick takes half of one
    #[arg(long = "heartbeat", value_name = "S,…", value_delimiter = ',', default_values_t = [setting::HEARTBEAT_S], value_parser = period)]
    pub heartbeats_s: Vec<f64>,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// The results of all missions, as they stand in the JSON object.
#[derive(Clone, Debug, Serialize)]
pub struct FailoverReport {
    /// Name and version of the layout.
    pub schema: &'static str,
    /// Size of the swarm.
    pub drones: u32,
    /// Time between two heartbeats of a leader, s: that of the first row. Each row has its own.
    pub heartbeat_s: f64,
    /// Time of silence after which a leader is missed, s: that of the first row.
    pub leader_timeout_s: f64,
    /// Length of a tick, s: that of the first row.
    pub dt_s: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// One row for each heartbeat, clock, delay and loss.
    pub rows: Vec<FailoverRow>,
}

impl FailoverReport {
    /// Whether an invariant was broken in any mission.
    #[must_use]
    pub fn is_unsafe(&self) -> bool {
        self.rows.iter().any(FailoverRow::is_unsafe)
    }

    /// The rows as a text table.
    #[must_use]
    pub fn table(&self) -> String {
        row::table(&self.rows)
    }
}

impl FailoverBench {
    /// Flies all missions. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError`], for example if a loss is above 1.
    pub fn run(&self, context: &Context<'_>) -> Result<Option<FailoverReport>, BenchError> {
        let delays_s: &[f64] = if self.quick { &[0.0] } else { &self.delays_s };
        let kills = self.kills.unwrap_or(if self.quick { QUICK_KILLS } else { KILLS });
        let clocks = self.clock.map_or(vec![ClockChoice::Lockstep, ClockChoice::Realtime], |clock| vec![clock]);
        let setting = |heartbeat_s: f64| Setting {
            clock: ClockChoice::Lockstep,
            heartbeat_s,
            loss: 0.0,
            delay_s: 0.0,
            kills,
            seed: self.seed,
        };
        let mut rows = Vec::new();
        for &heartbeat_s in &self.heartbeats_s {
            for &clock in &clocks {
                for (&delay_s, &loss) in delays_s.iter().flat_map(|d| self.losses.iter().map(move |l| (d, l))) {
                    rows.push(fly(&Setting { clock, loss, delay_s, ..setting(heartbeat_s) }, context)?);
                    if context.stopped() {
                        return Ok(None);
                    }
                }
            }
        }
        let first = setting(self.heartbeats_s.first().copied().unwrap_or(setting::HEARTBEAT_S));
        Ok(Some(FailoverReport {
            schema: "skein-bench-failover/1",
            drones: setting::DRONES,
            heartbeat_s: first.heartbeat_s,
            leader_timeout_s: first.timeout_s(),
            dt_s: first.dt_s(),
            seed: self.seed,
            rows,
        }))
    }
}

fn period(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|period_s| (0.002..=1.0).contains(period_s));
    number.ok_or_else(|| format!("expected seconds from 0.002 to 1, found {text:?}"))
}
