//! The parameters of a pilot.

use crate::pilot_error::PilotError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The parameters of a pilot: the table `params` of the scenario. The pilot checks them. An error names the key and what was
/// expected.
///
/// ```
/// use skein_pilot::{Params, PilotError};
/// use serde::Deserialize;
///
/// #[derive(Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Gains {
///     cohesion: f64,
///     #[serde(default)]
///     alignment: f64,
/// }
///
/// let params: Params = serde_json::from_str(r#"{ "cohesion": 1, "range_m": "far" }"#)?;
/// assert_eq!(params.get_f64("cohesion", 0.5)?, 1.0);
/// assert_eq!(params.get_f64("alignment", 0.5)?, 0.5);
/// let error = params.get_f64("range_m", 50.0).unwrap_err();
/// assert_eq!(error.to_string(), "params.range_m: expected a number, but found \"far\"");
/// assert!(params.parse::<Gains>().is_err(), "range_m is not a field");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Params(Map<String, Value>);

impl From<Map<String, Value>> for Params {
    fn from(table: Map<String, Value>) -> Self {
        Self(table)
    }
}

impl Params {
    /// The value of a key; `None` if the table does not have it.
    #[must_use]
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.0.get(key)
    }

    /// The keys, in the order of the scenario.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// A number, whole or not.
    ///
    /// # Errors
    /// [`PilotError`] if the key has another value.
    pub fn get_f64(&self, key: &str, default: f64) -> Result<f64, PilotError> {
        self.read(key, "a number", Value::as_f64).map(|value| value.unwrap_or(default))
    }

    /// A whole number that is not negative.
    ///
    /// # Errors
    /// [`PilotError`] if the key has another value.
    pub fn get_u64(&self, key: &str, default: u64) -> Result<u64, PilotError> {
        self.read(key, "a whole number from 0", Value::as_u64).map(|value| value.unwrap_or(default))
    }

    /// True or false.
    ///
    /// # Errors
    /// [`PilotError`] if the key has another value.
    pub fn get_bool(&self, key: &str, default: bool) -> Result<bool, PilotError> {
        self.read(key, "true or false", Value::as_bool).map(|value| value.unwrap_or(default))
    }

    /// A text.
    ///
    /// # Errors
    /// [`PilotError`] if the key has another value.
    pub fn get_str<'a>(&'a self, key: &str, default: &'a str) -> Result<&'a str, PilotError> {
        self.read(key, "a text", Value::as_str).map(|value| value.unwrap_or(default))
    }

    /// All of them, as a type of the pilot's own. With `#[serde(deny_unknown_fields)]`, a key that it does not know is an error,
    /// and so a misspelt one is found.
    ///
    /// # Errors
    /// [`PilotError`] if the table does not have this form.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, PilotError> {
        serde_path_to_error::deserialize(Value::Object(self.0.clone())).map_err(|error| {
            let path = error.path().to_string();
            let problem = error.into_inner().to_string();
            if path == "." {
                PilotError::new(format!("params: {problem}"))
            } else {
                PilotError::of_param(path, problem)
            }
        })
    }

    fn read<'a, T>(
        &'a self,
        key: &str,
        expected: &str,
        read: impl FnOnce(&'a Value) -> Option<T>,
    ) -> Result<Option<T>, PilotError> {
        let Some(value) = self.0.get(key) else { return Ok(None) };
        let wrong = || PilotError::of_param(key, format!("expected {expected}, but found {value}"));
        read(value).map(Some).ok_or_else(wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "only its form is of interest")]
    struct Own {
        gains: Gains,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "only its form is of interest")]
    struct Gains {
        k: f64,
    }

    fn error_of(json: &str) -> PilotError {
        serde_json::from_str::<Params>(json).unwrap().parse::<Own>().unwrap_err()
    }

    #[test]
    fn an_error_names_the_key_and_what_was_expected() {
        assert_eq!(error_of(r#"{"gains": {"k": "much"}}"#).key(), Some("gains.k"));
        let unknown = error_of(r#"{"gains": {"k": 1.0, "kk": 2.0}}"#);
        assert_eq!(unknown.to_string(), "params.gains.kk: unknown field `kk`, expected `k`");
        assert_eq!(error_of("{}").to_string(), "params: missing field `gains`");
    }
}
