//! Reads the scenario that the command line names.

use crate::cli::ScenarioArgs;
use crate::exit::Failure;
use skein_scenario::{Scenario, ScenarioSource};

/// Greatest size of a scenario file, bytes.
const MAX_FILE: u64 = 16 << 20;

/// Reads the scenario file, applies the overrides and checks the result.
pub(crate) fn scenario(args: &ScenarioArgs) -> Result<Scenario, Failure> {
    let path = &args.scenario;
    let name = path.display().to_string();
    let expected = "expected a scenario file (TOML)";
    let about = std::fs::metadata(path).map_err(|error| Failure::usage(format!("{name}: {error}; {expected}")))?;
    if !about.is_file() {
        let kind = if about.is_dir() { "a directory" } else { "not a regular file" };
        return Err(Failure::usage(format!("{name}: is {kind}; {expected}")));
    }
    if about.len() > MAX_FILE {
        return Err(Failure::usage(format!("{name}: has {} bytes; {expected} of {MAX_FILE} at most", about.len())));
    }
    let bytes = std::fs::read(path).map_err(|error| Failure::usage(format!("{name}: {error}; {expected}")))?;
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let mut overrides = args.overrides.clone();
    overrides.extend(args.strategy.iter().map(|value| ("strategy".to_owned(), format!("{value:?}"))));
    overrides.extend(args.seed.iter().map(|value| ("seed".to_owned(), value.clone())));
    Scenario::parse_bytes(&bytes, ScenarioSource { name: &name, stem: &stem }, &overrides).map_err(Failure::diagnostic)
}
