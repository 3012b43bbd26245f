//! Elections: all drones start at once, over a simulated radio that is one hop wide or many. Measures the time until one drone
//! leads, the frames that this takes, and how many led in vain.

mod course;
mod row;
mod swarm;
mod topology;
mod trial;

pub use row::ElectionRow;
pub use topology::Topology;

use crate::context::Context;
use crate::error::BenchError;
use clap::{Args, ValueEnum};
use serde::Serialize;
use skein_scenario::{Scenario, ScenarioSource};
use trial::Trial;

/// Which elections are held.
#[derive(Clone, Debug, Args)]
pub struct ElectionBench {
    /// Who hears whom [default: all, one after the other]
    #[arg(long = "topology", value_name = "NAME,…", value_delimiter = ',', value_enum)]
    pub topologies: Vec<Topology>,
    /// Sizes of the swarm
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [10, 30, 100], value_parser = clap::value_parser!(u32).range(2..=1000))]
    pub drones: Vec<u32>,
    /// Shares of frames that each receiver loses
    #[arg(long = "loss", value_name = "P,…", value_delimiter = ',', default_values_t = [0.0, 0.25, 0.5, 0.75], value_parser = share)]
    pub losses: Vec<f64>,
    /// Shares of the drones that die within the first five seconds
    #[arg(long, value_name = "P,…", value_delimiter = ',', default_values_t = [0.0, 0.1], value_parser = share)]
    pub failing: Vec<f64>,
    /// Elections with each setting
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..))]
    pub seeds: u64,
    /// Simulated time after which an election is given up, s
    #[arg(long, value_name = "S", default_value_t = 120.0)]
    pub limit_s: f64,
}

/// All elections, as they stand in the JSON object.
#[derive(Clone, Debug, Serialize)]
pub struct ElectionReport {
    /// Name and version of the layout.
    pub schema: &'static str,
    /// Simulated time after which an election is given up, s.
    pub limit_s: f64,
    /// One row for each setting.
    pub rows: Vec<ElectionRow>,
}

impl ElectionReport {
    /// The rows as a text table.
    #[must_use]
    pub fn table(&self) -> String {
        row::table(&self.rows)
    }
}

impl ElectionBench {
    /// Holds all elections. `None` if interrupted.
    ///
    /// # Errors
    /// [`BenchError`] if a swarm cannot be this large.
    pub fn run(&self, context: &Context<'_>) -> Result<Option<ElectionReport>, BenchError> {
        let all = Topology::value_variants();
        let topologies = if self.topologies.is_empty() { all } else { &self.topologies };
        let mut rows = Vec::new();
        for &topology in topologies {
            for &drones in &self.drones {
                let scenario = scenario(drones)?;
                for (&failing, &loss) in self.failing.iter().flat_map(|f| self.losses.iter().map(move |l| (f, l))) {
                    let setting = Trial { topology, drones, loss, failing, seed: 0 };
                    let stopped = || context.stopped();
                    let of =
                        (1..=self.seeds).map(|seed| Trial { seed, ..setting }.run(&scenario, self.limit_s, &stopped));
                    let Some(of) = of.collect::<Option<Vec<_>>>() else { return Ok(None) };
                    rows.push(ElectionRow::new(setting, &of));
                }
            }
        }
        Ok(Some(ElectionReport { schema: "skein-bench-election/1", limit_s: self.limit_s, rows }))
    }
}

/// Drones of the default scenario: its periods and time-outs, an open field, no end.
fn scenario(drones: u32) -> Result<Scenario, BenchError> {
    let text = format!("[formation]\ndrones = {drones}\n[mission]\nend = \"hold\"\nstop_x_m = 1e6\n");
    Ok(Scenario::parse(&text, ScenarioSource { name: "bench election", stem: "election" }, &[])?)
}

fn share(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|share| (0.0..1.0).contains(share));
    number.ok_or_else(|| format!("expected a number from 0 to less than 1, found {text:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_runtime::PilotRegistry;

    fn bench() -> ElectionBench {
        ElectionBench {
            topologies: vec![],
            drones: vec![10],
            losses: vec![0.0, 0.5],
            failing: vec![0.0, 0.2],
            seeds: 2,
            limit_s: 60.0,
        }
    }

    fn rows(bench: &ElectionBench) -> Vec<serde_json::Value> {
        let pilots = PilotRegistry::built_in().unwrap();
        let report = bench.run(&Context { pilots: &pilots, interrupted: &|| None }).unwrap().unwrap();
        assert_eq!(report.table().lines().count(), report.rows.len() + 1);
        report.rows.iter().map(|row| serde_json::to_value(row).unwrap()).collect()
    }

    #[test]
    fn each_topology_elects_one_leader_and_the_same_seeds_give_the_same_rows() {
        let first = rows(&bench());
        assert_eq!(first.len(), 5 * 2 * 2);
        for row in &first {
            assert_eq!((&row["seeds"], &row["elected"]), (&2.into(), &2.into()), "{row}");
            assert!(row["p50_s"].as_f64().unwrap() > 0.0 && row["frames_per_drone"].as_f64().unwrap() > 1.0, "{row}");
        }
        let ideal = &first[0];
        assert_eq!(
            (&ideal["topology"], &ideal["false_leaders"], &ideal["later_terms"]),
            (&"one-hop".into(), &0.0.into(), &0.0.into())
        );
        assert_eq!(rows(&bench()), first);
    }

    #[test]
    fn an_election_that_takes_too_long_is_given_up() {
        let row = &rows(&ElectionBench { limit_s: 0.1, topologies: vec![Topology::Line], ..bench() })[0];
        assert_eq!((&row["elected"], &row["p50_s"]), (&0.into(), &serde_json::Value::Null));
    }

    #[test]
    fn shares_are_checked() {
        assert_eq!((share("0.75"), share("0")), (Ok(0.75), Ok(0.0)));
        assert!(share("1").is_err() && share("-0.1").is_err() && share("x").is_err());
    }
}
