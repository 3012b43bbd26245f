//! The keys of the energy that a mission takes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the power of a drone is computed from. The default is the paper's model in still air. These keys change no flight, only
/// the energy of it; a leader that looks ahead reckons with the default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EnergyKeys {
    /// Velocity of the air over ground, [x, y]. Power is that of the airspeed. This wind pushes no drone; the fault `wind` does.
    #[schemars(inner(range(min = -100.0, max = 100.0)))]
    pub wind_mps: [f64; 2],
    /// Which thrust takes power.
    pub thrust: Thrust,
}

/// Which thrust takes power.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Thrust {
    /// The thrust that carries the weight, as in the paper: acceleration costs nothing.
    #[default]
    Weight,
    /// The thrust that carries the weight and gives the commanded acceleration. With κ, this thrust over the weight, power is
    /// P(V, κ) of Zeng, Xu and Zhang 2019.
    Acceleration,
}
