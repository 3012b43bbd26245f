//! Reads the scenario that the command line names.

use crate::cli::ScenarioArgs;
use crate::exit::Failure;
use crate::missing::missing;
use skein_scenario::{Scenario, ScenarioSource};
use skein_sweep::FileKind;
use std::path::Path;

/// Greatest size of a scenario file, bytes.
const MAX_FILE: u64 = 16 << 20;

/// Reads the scenario file, applies the overrides and checks the result.
pub(crate) fn scenario(args: &ScenarioArgs) -> Result<Scenario, Failure> {
    let path = &args.scenario;
    let name = path.display().to_string();
    let expected = "expected a scenario file (TOML)";
    if let Some(text) = missing(path, expected) {
        return Err(Failure::usage(text));
    }
    let about = std::fs::metadata(path).map_err(|error| Failure::usage(format!("{name}: {error}; {expected}")))?;
    if !about.is_file() {
        let kind = if about.is_dir() { "a directory" } else { "not a regular file" };
        return Err(Failure::usage(format!("{name}: is {kind}; {expected}")));
    }
    if about.len() > MAX_FILE {
        return Err(Failure::usage(format!("{name}: has {} bytes; {expected} of {MAX_FILE} at most", about.len())));
    }
    let bytes = std::fs::read(path).map_err(|error| Failure::usage(format!("{name}: {error}; {expected}")))?;
    if str::from_utf8(&bytes).is_ok_and(|text| FileKind::of(text) == FileKind::Experiment) {
        return Err(Failure::usage(format!("{name} is an experiment, not a scenario; `skein sweep {name}` flies it")));
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut overrides = args.overrides.clone();
    overrides.extend(args.strategy.iter().map(|value| ("strategy".to_owned(), format!("{value:?}"))));
    overrides.extend(args.seed.iter().map(|value| ("seed".to_owned(), value.clone())));
    Scenario::parse_bytes(&bytes, ScenarioSource { name: &name, stem: &stem }, &overrides).map_err(Failure::diagnostic)
}

/// Refuses a path that does not exist, and a scenario in place of an experiment.
pub(crate) fn check_experiment(path: &Path) -> Result<(), Failure> {
    if let Some(text) = missing(path, "expected an experiment file (TOML)") {
        return Err(Failure::usage(text));
    }
    let text = std::fs::metadata(path).ok().filter(|about| about.is_file() && about.len() <= MAX_FILE);
    let text = text.and_then(|_| std::fs::read_to_string(path).ok());
    if text.is_some_and(|text| FileKind::of(&text) == FileKind::Scenario) {
        let name = path.display();
        return Err(Failure::usage(format!("{name} is a scenario, not an experiment; `skein run {name}` flies it")));
    }
    Ok(())
}
