//! What a leader that rehearses looks for.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the strategy `congestion-aware` makes least: a weighted sum of the mission's energy and its time. By default the
/// energy alone; `energy_per_kj = 0` with `time_per_s = 1` is the time alone. Ties go to the lower energy, then to the
/// earlier end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Objective {
    /// Weight of a kilojoule, of all drones together until the mission's end.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub energy_per_kj: f64,
    /// Weight of a second until the mission's end.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub time_per_s: f64,
}

impl Default for Objective {
    fn default() -> Self {
        Self { energy_per_kj: 1.0, time_per_s: 0.0 }
    }
}
