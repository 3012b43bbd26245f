//! A rule between keys that a scenario breaks.

use crate::node::number;

/// The keys that the rule is about, and what was found and expected.
pub(crate) struct BrokenRule {
    /// Paths such as `drone.speed_mps`. The first one is blamed.
    pub(crate) keys: Vec<String>,
    /// What was found and what was expected.
    pub(crate) message: String,
}

/// A value with its unit, for a message.
pub(crate) fn quantity(value: f64, unit: &str) -> String {
    format!("{} {unit}", number(value))
}
