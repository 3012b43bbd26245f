//! Why the pilots of a scenario cannot fly it.

use thiserror::Error;

/// Why the pilots of a scenario cannot fly it: a key of the scenario, and what was expected there.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}: {message}", keys.first().map_or("pilot", String::as_str))]
pub struct PilotProblem {
    keys: Vec<String>,
    message: String,
}

impl PilotProblem {
    /// A problem with a key, such as `pilot.0.params.k`. If the scenario does not write it, the tables around it are blamed.
    pub(crate) fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { keys: vec![key.into()], message: message.into() }
    }

    /// The keys that may be to blame, the likeliest first.
    #[must_use]
    pub fn keys(&self) -> &[String] {
        &self.keys
    }

    /// What was found and what was expected.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.message
    }
}
