//! The keys of the guidance law.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The guidance law and the safety filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Guidance {
    /// Commanded acceleration for a velocity error.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub velocity_gain_per_s: f64,
    /// γ of the safety filter: how fast the distance to the safe distance may shrink.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub filter_gain_per_s: f64,
    /// By which part the filter widens the distances it keeps.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub filter_margin: f64,
    /// The drone with less precedence takes this part of an evasion, the other one the rest.
    #[schemars(range(min = 0.5, max = 1.0))]
    pub precedence_share: f64,
    /// Whether drones that share a route slow down into a single file, a headway apart, before its gate. Without, nothing
    /// but the safety filter keeps them apart, and they pass abreast where there is room.
    pub queue: bool,
}

impl Default for Guidance {
    fn default() -> Self {
        Self {
            velocity_gain_per_s: 2.0,
            filter_gain_per_s: 1.5,
            filter_margin: 0.02,
            precedence_share: 0.9,
            queue: true,
        }
    }
}
