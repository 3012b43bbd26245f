//! The keys of the guidance law.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The guidance law and the safety filter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Guidance {
    /// Commanded acceleration per velocity error.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub velocity_gain_per_s: f64,
    /// γ of the safety filter: how fast a distance may shrink towards the safe distance.
    #[schemars(range(max = 100.0), extend("exclusiveMinimum" = 0.0))]
    pub filter_gain_per_s: f64,
    /// Fraction by which the safety filter widens the distances that it keeps.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub filter_margin: f64,
    /// Share of an evasive manoeuvre that the drone with less precedence takes. The other drone takes the rest.
    #[schemars(range(min = 0.5, max = 1.0))]
    pub precedence_share: f64,
    /// Whether drones that share a route form a single file before its gate, one headway apart. If false, only the safety
    /// filter keeps them apart, and they pass side by side where there is room. So does a swarm of 33 drones or more in any
    /// case, except between two obstacles.
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
