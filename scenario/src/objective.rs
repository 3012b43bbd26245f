//! What a leader minimises when it chooses a grouping by look-ahead.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the strategy `congestion-aware` minimises: a weighted sum of the mission's energy and time. The default minimises
/// the energy. `energy_per_kj = 0` with `time_per_s = 1` minimises the time. Between equal sums, the lower energy wins,
/// then the earlier end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Objective {
    /// Weight of one kilojoule of the energy that all drones use until the mission's end.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub energy_per_kj: f64,
    /// Weight of one second until the mission's end.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub time_per_s: f64,
}

impl Default for Objective {
    fn default() -> Self {
        Self { energy_per_kj: 1.0, time_per_s: 0.0 }
    }
}
