//! `skein bench`: what a tick costs, against function calls and against a naive floor of raw shared memory, in one run and
//! interleaved. Absolute figures are the machine's; the ratios of one round are what carries over.

mod cases;
mod flight;
mod floor;
mod probe;
mod table;

use crate::exit::{Exit, Failure};
use crate::interrupt::Interrupt;
use cases::{Case, Size};
use clap::Args;
pub use floor::{FloorArgs, peer};
use probe::Measured;
pub(super) use probe::median;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `bench runtime`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "Examples:
  skein bench runtime
  skein bench runtime --drones 8,64 --rounds 7 --compare uds --out bench.json")]
pub struct RuntimeArgs {
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "1,8,64,256,1000")]
    pub drones: Vec<u32>,
    /// Rounds; each flies every case once
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
    /// A third of the ticks, three rounds at most
    #[arg(long)]
    pub quick: bool,
    /// Ticks that count, instead of fewer the more drones there are
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub ticks: Option<u64>,
    /// Only these
    #[arg(long, value_enum, value_name = "CASE,…", value_delimiter = ',')]
    pub cases: Vec<Case>,
    /// Another transport to compare with
    #[arg(long, value_enum)]
    pub compare: Option<Compare>,
    /// Draw the cost of an agent-step against the size of the swarm here (SVG)
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Print one JSON object instead of the table
    #[arg(long)]
    pub json: bool,
    /// Write the JSON object here as well
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

impl Default for RuntimeArgs {
    fn default() -> Self {
        let drones = vec![1, 8, 64, 256, 1000];
        Self {
            drones,
            rounds: 7,
            quick: false,
            ticks: None,
            cases: Vec::new(),
            compare: None,
            plot: None,
            json: false,
            out: None,
        }
    }
}

/// Another transport.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Compare {
    /// The same barrier over Unix datagrams
    Uds,
}

/// What one case gave in all rounds.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    drones: u32,
    case: Case,
    #[serde(flatten)]
    median: Measured,
    ticks_per_s_min: f64,
    ticks_per_s_max: f64,
}

/// A ratio of two cases, paired by round.
#[derive(Debug, Serialize)]
pub(super) struct Ratio {
    drones: u32,
    /// `ticks_per_s`, or `cpu_us_per_step`.
    of: &'static str,
    case: Case,
    to: Case,
    median: f64,
    rounds: Vec<f64>,
}

/// All that was measured.
#[derive(Debug, Serialize)]
pub(super) struct Bench {
    cores: usize,
    rounds: u32,
    rows: Vec<Row>,
    ratios: Vec<Ratio>,
}

/// Measures.
pub fn runtime(args: &RuntimeArgs) -> Result<Exit, Failure> {
    let interrupt = Interrupt::watch()?;
    skein_bus::clean().map_err(Failure::environment)?;
    let cores = skein_bus::allowed_cores().map_err(Failure::environment)?;
    let rounds = if args.quick { args.rounds.min(3) } else { args.rounds };
    let mut bench = Bench { cores, rounds, rows: Vec::new(), ratios: Vec::new() };
    for &drones in &args.drones {
        let size = Size::new(drones, args.quick, args.ticks)?;
        let cases = Case::of(drones, args.compare.is_some(), &args.cases);
        if cases.is_empty() {
            return Err(Failure::usage(format!("expected a case that there is with {drones} drones, see --cases")));
        }
        let mut measured: Vec<Vec<Measured>> = vec![Vec::new(); cases.len()];
        for round in 0..rounds as usize {
            // Each round begins with another case, so that none always follows the same one.
            for place in (0..cases.len()).map(|i| (i + round) % cases.len()) {
                eprint!("\r{drones} drones, round {} of {rounds}: {:<24}", round + 1, cases[place].name());
                measured[place].push(cases[place].measure(&size, &interrupt)?);
                if let Some(signal) = interrupt.signal() {
                    eprintln!();
                    return Ok(Exit::Interrupted(signal));
                }
            }
        }
        bench.take(drones, &cases, &measured);
    }
    eprintln!();
    let json = serde_json::to_string_pretty(&bench).map_err(Failure::environment)?;
    let write = |path: &PathBuf, text: &str| {
        std::fs::write(path, text).map_err(|error| Failure::environment(format!("writing {}: {error}", path.display())))
    };
    args.out.iter().try_for_each(|path| write(path, &json))?;
    args.plot.iter().try_for_each(|path| write(path, &table::plot(&bench).map_err(Failure::environment)?))?;
    println!("{}", if args.json { json } else { table::text(&bench) });
    Ok(Exit::Reached)
}

impl Bench {
    fn take(&mut self, drones: u32, cases: &[Case], measured: &[Vec<Measured>]) {
        for (&case, rounds) in cases.iter().zip(measured) {
            let speeds = || rounds.iter().map(|m| m.ticks_per_s);
            self.rows.push(Row {
                drones,
                case,
                median: Measured::median(rounds),
                ticks_per_s_min: speeds().fold(f64::INFINITY, f64::min),
                ticks_per_s_max: speeds().fold(0.0, f64::max),
            });
        }
        let place = |case: Case| cases.iter().position(|&other| other == case);
        let speed = |m: &Measured| m.ticks_per_s;
        let cpu = |m: &Measured| m.cpu_us_per_step.unwrap_or(f64::NAN);
        type Value = fn(&Measured) -> f64;
        let pairs: [(&'static str, Value, Case, Case); 7] = [
            ("ticks_per_s", speed, Case::BlockBeacon, Case::Floor),
            ("ticks_per_s", speed, Case::YieldBeacon, Case::Floor),
            ("cpu_us_per_step", cpu, Case::BlockBeacon, Case::Floor),
            ("ticks_per_s", speed, Case::BlockBeacon, Case::Datagrams),
            ("ticks_per_s", speed, Case::Block, Case::Inline),
            ("ticks_per_s", speed, Case::Yield, Case::Inline),
            ("ticks_per_s", speed, Case::Packed, Case::Block),
        ];
        for (of, value, case, to) in pairs {
            let (Some(a), Some(b)) = (place(case), place(to)) else { continue };
            let rounds: Vec<f64> = measured[a].iter().zip(&measured[b]).map(|(a, b)| value(a) / value(b)).collect();
            self.ratios.push(Ratio { drones, of, case, to, median: probe::median(rounds.iter().copied()), rounds });
        }
    }
}
