//! Reads the scenario that the command line names.

use crate::exit::Failure;
use crate::experiment_file::MAX_FILE;
use crate::missing::missing;
use crate::scenario_args::ScenarioArgs;
use skein_runtime::{PilotRegistry, resolve_commands};
use skein_scenario::{Scenario, ScenarioSource};
use skein_sweep::FileKind;
use std::path::Path;

/// Reads the scenario file, applies the overrides, and checks the result and that these pilots can fly it. `inline`: in this process.
pub(crate) fn scenario(args: &ScenarioArgs, pilots: &PilotRegistry, inline: bool) -> Result<Scenario, Failure> {
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
    // A name needs no quotes; a number would be one without.
    overrides.extend(args.pilot.iter().map(|name| ("pilot.0.name".to_owned(), format!("{name:?}"))));
    if !args.hosts.is_empty() {
        let tables: Vec<_> =
            args.hosts.iter().map(|(name, drones)| format!("{{name = {name:?}, drones = {drones}}}")).collect();
        overrides.push(("host".to_owned(), format!("[{}]", tables.join(", "))));
    }
    let source = ScenarioSource { name: &name, stem: &stem };
    let mut scenario = Scenario::parse_bytes(&bytes, source, &overrides).map_err(Failure::diagnostic)?;
    resolve_commands(&mut scenario, path.parent().unwrap_or(Path::new("")));
    if let Err(problem) = pilots.check(&scenario, inline) {
        let text = String::from_utf8_lossy(&bytes);
        let errors = Scenario::blame(&text, source, &overrides, problem.keys(), problem.message());
        return Err(Failure::diagnostic(errors));
    }
    Ok(scenario)
}
