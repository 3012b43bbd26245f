//! The scenario that a launcher hands to its child processes: a file in the folder of the run's domain.

use crate::error::RuntimeError;
use skein_scenario::Scenario;
use std::path::{Path, PathBuf};

/// Writes the resolved scenario into the folder of a domain.
///
/// # Errors
/// [`RuntimeError::System`] if the file cannot be written, [`RuntimeError::ScenarioFile`] if the scenario cannot be
/// expressed as JSON.
pub fn write(domain: &Path, scenario: &Scenario) -> Result<(), RuntimeError> {
    let path = path(domain);
    match serde_json::to_vec(scenario) {
        Ok(json) => std::fs::write(&path, json).map_err(RuntimeError::system(format!("writing {}", path.display()))),
        Err(source) => Err(RuntimeError::ScenarioFile { path, source }),
    }
}

/// Reads the resolved scenario from the folder of a domain.
///
/// # Errors
/// [`RuntimeError::System`] if there is no file to read, [`RuntimeError::ScenarioFile`] if it holds no scenario of this
/// version.
pub fn read(domain: &Path) -> Result<Scenario, RuntimeError> {
    let path = path(domain);
    let json = std::fs::read(&path).map_err(RuntimeError::system(format!("reading {}", path.display())))?;
    serde_json::from_slice(&json).map_err(|source| RuntimeError::ScenarioFile { path, source })
}

fn path(domain: &Path) -> PathBuf {
    domain.join("scenario.json")
}
