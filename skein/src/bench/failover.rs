//! `skein bench failover`: leaders killed over and over, and how soon everybody follows another one, by the world's truth.

mod flight;
mod outcome;
mod witness;

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use clap::{Args, ValueEnum};
use flight::{ChannelSetting, fly};
use outcome::{Row, table};
use serde_json::json;
use std::io::Write;
use std::path::PathBuf;

/// Kills for each line of the table with `--quick`.
const QUICK_KILLS: u32 = 10;

/// Arguments of `bench failover`.
#[derive(Debug, Args)]
#[command(
    after_help = "Eight drones cruise, heartbeats at 50 Hz. Again and again the leader is killed, and comes back a little \
later. Lockstep is flown in this process, realtime in real processes that get SIGKILL.

Examples:
  skein bench failover --quick
  skein bench failover --clock realtime --loss 0,0.5 --delay 0 --json --out failover.json"
)]
pub struct FailoverArgs {
    /// Leaders killed for each clock, loss and delay [default: 200]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    kills: Option<u32>,
    /// Ten kills, no delay
    #[arg(long, conflicts_with = "delays_s")]
    quick: bool,
    /// By which clock [default: both]
    #[arg(long, value_enum)]
    clock: Option<ClockChoice>,
    /// Share of frames that are lost
    #[arg(long = "loss", value_name = "P,…", value_delimiter = ',', default_values_t = [0.0, 0.1, 0.5])]
    losses: Vec<f64>,
    /// How long a frame is on the air besides its tick, s
    #[arg(long = "delay", value_name = "S,…", value_delimiter = ',', default_values_t = [0.0, 0.1])]
    delays_s: Vec<f64>,
    /// Seed of everything random
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Write the JSON object to this file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// What paces the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClockChoice {
    /// Each tick waits for everybody; flown in this process.
    Lockstep,
    /// By the wall clock; a process each.
    Realtime,
}

/// Kills leaders, and tells how soon they are replaced.
pub fn failover(args: &FailoverArgs) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    let delays_s: &[f64] = if args.quick { &[0.0] } else { &args.delays_s };
    let kills = args.kills.unwrap_or(if args.quick { QUICK_KILLS } else { 200 });
    let clocks = args.clock.map_or(vec![ClockChoice::Lockstep, ClockChoice::Realtime], |clock| vec![clock]);
    let mut rows = Vec::new();
    for clock in clocks {
        for &delay_s in delays_s {
            for &loss in &args.losses {
                let air = ChannelSetting { clock, loss, delay_s, kills, seed: args.seed };
                rows.push(fly(&air, &interrupt)?);
                if let Some(signal) = interrupt.signal() {
                    return Ok(Exit::Interrupted(signal));
                }
            }
        }
    }
    tell(args, &rows)?;
    Ok(if rows.iter().any(Row::is_unsafe) { Exit::Unsafe } else { Exit::Reached })
}

fn tell(args: &FailoverArgs, rows: &[Row]) -> Result<(), Failure> {
    let all = json!({
        "schema": "skein-bench-failover/1", "drones": flight::DRONES, "heartbeat_s": flight::HEARTBEAT_S,
        "leader_timeout_s": flight::TIMEOUT_S, "dt_s": flight::DT_S, "seed": args.seed, "rows": rows,
    });
    if let Some(path) = &args.out {
        let text = serde_json::to_string_pretty(&all).map_err(Failure::environment)?;
        std::fs::write(path, text + "\n")
            .map_err(|error| Failure::environment(format!("writing {}: {error}", path.display())))?;
    }
    let text = if args.json { format!("{all}\n") } else { table(rows) };
    // A closed pipe is the reader's choice.
    let _ = std::io::stdout().lock().write_all(text.as_bytes());
    Ok(())
}
