//! One mission, flown and recorded in a folder.

use crate::error::ReproduceError;
use crate::flight::Flight;
use skein_protocol::record::Outcome;
use skein_report::{Manifest, Recorder, RunCompletion, RunFacts, RunFolder, Summary};
use skein_runtime::run_facts::run_facts;
use skein_runtime::{PilotRegistry, RuntimeError, inline};
use skein_sweep::Interrupted;
use std::path::Path;

/// A recorded mission.
pub(crate) struct Recording {
    /// What was flown.
    pub(crate) facts: RunFacts,
    /// Its summary.
    pub(crate) summary: Summary,
    /// Where it is recorded.
    pub(crate) folder: RunFolder,
}

impl Recording {
    /// Flies the mission and records it in this folder, which may hold an earlier recording.
    pub(crate) fn make(path: &Path, flight: &Flight, interrupted: &Interrupted<'_>) -> Result<Self, ReproduceError> {
        let scenario = flight.resolve()?;
        let facts = run_facts(&scenario, "inline", "lockstep").map_err(RuntimeError::Shape)?;
        let folder = RunFolder::at(path, true).map_err(ReproduceError::Folder)?;
        let commit = option_env!("SKEIN_COMMIT").map(str::to_owned);
        let resolved = serde_json::to_value(&scenario)?;
        let manifest = Manifest::new(facts.clone(), resolved, env!("CARGO_PKG_VERSION"), commit);
        folder.begin(&manifest)?;
        let mut recorder = Recorder::in_folder(facts.clone(), &folder)?;
        let end = inline::run(&scenario, &PilotRegistry::built_in()?, &mut recorder, interrupted)?;
        let completion = RunCompletion { fallback: Outcome::Aborted, wall_s: None, startup_s: Some(end.startup_s) };
        let (summary, record) = recorder.finish(&completion);
        folder.write_summary(&summary)?;
        let stop = || interrupted().is_some();
        if let Some(record) = record {
            record.write_files(&manifest, &skein_report::Interrupted::when(&stop))?;
            record.remove()?;
        }
        match end.sink_error {
            Some(error) => Err(ReproduceError::Record(error.to_string())),
            None => Ok(Self { facts, summary, folder }),
        }
    }
}
