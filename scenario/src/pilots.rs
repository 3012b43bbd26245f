//! The keys of `[[pilot]]`: who flies which drones.

use crate::limits::MAX_DRONES;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};
use std::path::Path;

/// The built-in pilot that flies where no table says otherwise.
pub const DEFAULT_PILOT: &str = "paper";

/// A table of values that Skein does not check.
pub type FreeTable = Map<String, Json>;

/// A pilot, and the drones that it flies. Drones that no table names fly with the built-in pilot `paper`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PilotKeys {
    /// Name of the pilot: `paper`, `cruise`, or one that the program registers. The default is `paper`; with `command`, the only
    /// pilot of that program.
    #[schemars(length(min = 1, max = 64))]
    pub name: Option<String>,
    /// A program of its own that flies these drones, with its first arguments, such as `["python3", "boids.py"]`. Words that
    /// name a file in the scenario's folder mean that file; the first word does so only if it contains a `/`. It needs a process
    /// per drone, or per few drones: it cannot fly inline.
    #[schemars(length(min = 1, max = 64))]
    pub command: Option<Vec<String>>,
    /// The drones that it flies, by number. The default is all drones that no other table names.
    #[schemars(length(min = 1, max = MAX_DRONES), inner(range(min = 0, max = MAX_DRONES - 1)))]
    pub drones: Option<Vec<u32>>,
    /// Its parameters. The pilot checks them.
    #[schemars(extend("format" = "free"))]
    #[serde(skip_serializing_if = "Map::is_empty")]
    pub params: FreeTable,
    /// Topics of its messages that a rule of the radio names. Other topics need not be listed.
    #[schemars(length(min = 0, max = 64))]
    pub topics: Vec<String>,
}

impl PilotKeys {
    /// The name to show: `name`, or the name of the program's last file without its ending, or `paper`.
    #[must_use]
    pub fn shown_name(&self) -> &str {
        let of_command = || {
            let stems = self.command.iter().flatten().rev().filter(|word| !word.starts_with('-'));
            stems.filter_map(|word| Path::new(word).file_stem()?.to_str()).next()
        };
        self.name.as_deref().or_else(of_command).unwrap_or(DEFAULT_PILOT)
    }
}
