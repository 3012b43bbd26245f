//! Which scenario a command flies.

use crate::options::key_value;
use clap::Args;
use std::path::{Path, PathBuf};

/// A scenario and its changes.
#[derive(Debug, Args)]
pub(crate) struct ScenarioArgs {
    /// Scenario file (TOML)
    pub(crate) scenario: PathBuf,
    /// How drones choose routes: congestion-aware-paper, congestion-aware, shortest-path or
    /// fixed:L/R (number of drones to the left and to the right)
    #[arg(long, value_name = "STRATEGY")]
    pub(crate) strategy: Option<String>,
    /// Seed of everything random
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<String>,
    /// Pilot of the drones that no table of the scenario names: paper, cruise or one of the program's own; the same as
    /// --set pilot.0.name=NAME
    #[arg(long, value_name = "NAME")]
    pub(crate) pilot: Option<String>,
    /// Override a scenario key, such as radio.delay_s=0.1; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub(crate) overrides: Vec<(String, String)>,
}

impl ScenarioArgs {
    /// A file as it is.
    pub(crate) fn of_file(scenario: &Path) -> Self {
        Self { scenario: scenario.to_owned(), strategy: None, seed: None, pilot: None, overrides: Vec::new() }
    }
}
