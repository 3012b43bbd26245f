//! Refuses what is not an experiment file.

use crate::exit::Failure;
use crate::missing::missing;
use skein_sweep::FileKind;
use std::path::Path;

/// Greatest size of a scenario or experiment file, bytes.
pub(crate) const MAX_FILE: u64 = 16 << 20;

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
