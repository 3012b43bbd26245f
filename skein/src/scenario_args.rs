//! Which scenario a command flies.

use crate::options::{key_value, name_and_count};
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
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    pub(crate) seed: Option<String>,
    /// Pilot of the drones that no table of the scenario names: paper, cruise or one of the program's own; the same as
    /// --set pilot.0.name=NAME
    #[arg(long, value_name = "NAME")]
    pub(crate) pilot: Option<String>,
    /// Machines that fly drones, and how many: the first one flies the drones from number 0 on. It replaces all [[host]] tables
    #[arg(long, value_name = "NAME=COUNT", value_delimiter = ',', value_parser = name_and_count)]
    pub(crate) hosts: Vec<(String, u32)>,
    /// Override a scenario key, such as radio.delay_s=0.1; repeatable
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", value_parser = key_value)]
    pub(crate) overrides: Vec<(String, String)>,
}

impl ScenarioArgs {
    /// A file as it is.
    pub(crate) fn of_file(scenario: &Path) -> Self {
        Self {
            scenario: scenario.to_owned(),
            strategy: None,
            seed: None,
            pilot: None,
            hosts: Vec::new(),
            overrides: Vec::new(),
        }
    }
}
