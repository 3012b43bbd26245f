//! What is hunted in: an experiment, or all seeds of one scenario.

use crate::error::ExperimentError;
use crate::experiment::Experiment;
use crate::file_kind::FileKind;
use std::path::Path;

/// Seeds of a scenario that is hunted in.
const SCENARIO_SEEDS: u32 = 100_000;

/// The experiment in a file. A scenario file counts as the experiment that flies it with many seeds.
///
/// # Errors
/// [`ExperimentError`] if the file cannot be read, or is neither an experiment nor a scenario.
pub fn source(path: &Path) -> Result<Experiment, ExperimentError> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let (Some(name), FileKind::Scenario) = (path.file_name(), FileKind::of(&text)) else {
        return Experiment::read(path);
    };
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let text = format!("scenario = {:?}\nseeds = {SCENARIO_SEEDS}\n", name.to_string_lossy());
    Experiment::parse(&text, &stem, path.parent().unwrap_or(Path::new("")))
}
