//! Why a pilot cannot be made.

use std::error::Error;
use std::fmt;

/// Why a pilot cannot be made: usually a parameter that it cannot use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PilotError {
    key: Option<String>,
    problem: String,
}

impl PilotError {
    /// A problem that is not one of a parameter.
    #[must_use]
    pub fn new(problem: impl Into<String>) -> Self {
        Self { key: None, problem: problem.into() }
    }

    /// A problem with the parameter of this key. `problem` says what was expected, and what was there.
    #[must_use]
    pub fn of_param(key: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { key: Some(key.into()), problem: problem.into() }
    }

    /// The key of the parameter, such as `gains.alignment`.
    #[must_use]
    pub fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }

    /// What was expected, and what was there.
    #[must_use]
    pub fn problem(&self) -> &str {
        &self.problem
    }
}

impl fmt::Display for PilotError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.key {
            Some(key) => write!(f, "params.{key}: {}", self.problem),
            None => f.write_str(&self.problem),
        }
    }
}

impl Error for PilotError {}

impl From<String> for PilotError {
    fn from(problem: String) -> Self {
        Self::new(problem)
    }
}

impl From<&str> for PilotError {
    fn from(problem: &str) -> Self {
        Self::new(problem)
    }
}
