//! A pilot in the manifest and in the summary.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A pilot of a run, and the drones that it flew.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PilotEntry {
    /// Its name.
    pub name: String,
    /// The drones that it flew.
    pub drones: Vec<u32>,
    /// Hash of its program's files, 16 hex digits; null if it is built in.
    pub program: Option<String>,
    /// Its parameters.
    pub params: serde_json::Map<String, serde_json::Value>,
}
