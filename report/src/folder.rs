//! The folder of a run, which never replaces anything but a run, and the JSON files in it.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::files::{self, MANIFEST, PLOTS, PROCESSES, SUMMARY};
use crate::json_text::json;
use crate::pilot_entry::PilotEntry;
use crate::reserved_summary::ReservedSummary;
use crate::summary::Summary;
use crate::work_folder::{WorkFolder, part};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

const MANIFEST_SCHEMA: &str = "skein-manifest/1";

/// Describes a run completely: enough to fly it again and to draw it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Name and version of this layout; set by [`Manifest::new`].
    pub schema: String,
    /// The resolved scenario: every key with its value.
    pub scenario: serde_json::Value,
    /// Seed of all random values.
    pub seed: u64,
    /// The strategy by which drones were grouped.
    pub strategy: String,
    /// Version of Skein.
    pub version: String,
    /// Commit of Skein's source, if known.
    pub commit: Option<String>,
    /// Operating system and architecture.
    pub platform: String,
    /// The pilots, with the hashes of their programs.
    #[serde(default)]
    pub pilots: Vec<PilotEntry>,
    /// What is known of the run before it starts.
    pub facts: RunFacts,
}

impl Manifest {
    /// The manifest of a run with these facts, strategy and seed included. `scenario` is the resolved scenario, `version`
    /// and `commit` are those of Skein.
    #[must_use]
    pub fn new(facts: RunFacts, scenario: serde_json::Value, version: &str, commit: Option<String>) -> Self {
        Self {
            schema: MANIFEST_SCHEMA.to_owned(),
            scenario,
            seed: facts.seed,
            strategy: facts.strategy.clone(),
            version: version.to_owned(),
            commit,
            platform: format!("{}-{}", std::env::consts::OS, std::env::consts::ARCH),
            pilots: facts.pilots.clone(),
            facts,
        }
    }
}

/// The role of a process in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Starts and supervises the other processes, and records.
    Launcher,
    /// Simulates physics and the radio channel.
    World,
    /// Flies one drone.
    Drone,
}

/// A process of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProcessEntry {
    /// Its role.
    pub role: Role,
    /// The number of the drone; null for other roles.
    pub id: Option<u32>,
    /// Process id.
    pub pid: u32,
}

/// Greatest size of a JSON file that is read, bytes.
const JSON_BYTES_MAX: u64 = 256 << 20;
/// Room that is kept for the summary: bytes, and bytes for each drone.
const SUMMARY_ROOM: [u64; 2] = [64 << 10, 512];

/// The folder of a run. It is locked from the first write on, see [`WorkFolder`].
#[derive(Clone, Debug)]
pub struct RunFolder {
    work: WorkFolder,
    /// Whether this process has made it.
    new: bool,
}

impl RunFolder {
    /// Creates `<root>/<scenario>-<number>` with the next free number, from 1. Concurrent runs get different folders.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn numbered(root: &Path, scenario: &str) -> Result<Self, ReportError> {
        fs::create_dir_all(root).map_err(ReportError::io(root))?;
        let stem: String =
            scenario.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect();
        let mut number = last_number(root, &stem)?;
        loop {
            number += 1;
            match WorkFolder::make(&root.join(format!("{stem}-{number}"))) {
                Ok((work, true)) => return Ok(Self { work, new: true }),
                // Another run has just taken the number.
                Ok((_, false)) | Err(ReportError::InUse(_) | ReportError::Foreign { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Creates the folder `path`. An existing folder is refused, unless `force` is set and it is empty or a run's.
    /// [`RunFolder::begin`] then replaces the run in it.
    ///
    /// # Errors
    /// [`ReportError::Exists`], [`ReportError::InUse`], [`ReportError::Foreign`], [`ReportError::NotARun`] for a folder
    /// that is neither empty nor of a run, or [`ReportError::Io`].
    pub fn at(path: &Path, force: bool) -> Result<Self, ReportError> {
        if !force && path.symlink_metadata().is_ok() {
            return Err(ReportError::Exists(path.to_owned()));
        }
        if path.exists() && !path.is_dir() {
            return Err(ReportError::NotARun(path.to_owned()));
        }
        let (work, new) = WorkFolder::make(path)?;
        // Another process may have made it since.
        if !new && !force {
            return Err(ReportError::Exists(path.to_owned()));
        }
        let folder = Self { work, new };
        if new || folder.is_empty()? || folder.holds_a_run() {
            Ok(folder)
        } else {
            Err(ReportError::NotARun(path.to_owned()))
        }
    }

    /// Opens the folder of a recorded run.
    ///
    /// # Errors
    /// [`ReportError::NotARun`] if it holds no manifest of a run.
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        let not_a_run = || ReportError::NotARun(path.to_owned());
        let folder = Self { work: WorkFolder::open(path).map_err(|_| not_a_run())?, new: false };
        if folder.holds_a_run() { Ok(folder) } else { Err(not_a_run()) }
    }

    /// Begins the run of this manifest: removes the files of an earlier run, and no other files, and writes manifest.json.
    /// If the process is killed meanwhile, the folder still is a run's.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn begin(&self, manifest: &Manifest) -> Result<(), ReportError> {
        self.clear()?;
        self.write_json(MANIFEST, manifest)
    }

    /// Undoes [`RunFolder::begin`] for a run that did not start. Removes the folder if this process has made it and no
    /// other files are in it.
    pub fn abandon(self) {
        // What cannot be removed does no harm: the next run in this folder replaces it.
        let _ = self.clear().and_then(|()| self.work.remove(MANIFEST));
        if self.new {
            let _ = fs::remove_dir(self.path());
        }
    }

    /// Keeps room on the disk for the summary of a run with so many drones, so that it can be written if the disk is full.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn reserve_summary(&self, drones: u32) -> Result<ReservedSummary, ReportError> {
        let room = SUMMARY_ROOM[0] + SUMMARY_ROOM[1] * u64::from(drones);
        ReservedSummary::new(&self.work, room)
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.work.path()
    }

    /// The files of the folder.
    pub(crate) fn files(&self) -> &WorkFolder {
        &self.work
    }

    /// Reads manifest.json.
    ///
    /// # Errors
    /// [`ReportError::Io`], or [`ReportError::Content`] for a manifest of another version of Skein.
    pub fn read_manifest(&self) -> Result<Manifest, ReportError> {
        self.read_json(MANIFEST, "the manifest of a run by this version of Skein")
    }

    /// Writes processes.json.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn write_processes(&self, processes: &[ProcessEntry]) -> Result<(), ReportError> {
        self.write_json(PROCESSES, &processes)
    }

    /// Writes summary.json.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn write_summary(&self, summary: &Summary) -> Result<(), ReportError> {
        self.write_json(SUMMARY, summary)
    }

    /// Whether the run has a summary.
    #[must_use]
    pub fn has_summary(&self) -> bool {
        self.work.read(SUMMARY).is_ok()
    }

    /// Reads summary.json.
    ///
    /// # Errors
    /// [`ReportError::NoSummary`] if the run has none, [`ReportError::Io`] or [`ReportError::Content`].
    pub fn read_summary(&self) -> Result<Summary, ReportError> {
        match self.read_json(SUMMARY, "the summary of a run by this version of Skein") {
            Err(ReportError::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {
                Err(ReportError::NoSummary(self.path().to_owned()))
            }
            read => read,
        }
    }

    /// Whether manifest.json is that of a run.
    fn holds_a_run(&self) -> bool {
        let Ok(bytes) = self.work.read_whole(MANIFEST, JSON_BYTES_MAX) else { return false };
        let schema = serde_json::from_slice::<serde_json::Value>(&bytes).ok();
        let schema = schema.as_ref().and_then(|manifest| manifest.get("schema")?.as_str());
        schema.is_some_and(|schema| schema.starts_with("skein-manifest/"))
    }

    /// Whether it holds nothing, except provisional files of a run that was killed before it began.
    fn is_empty(&self) -> Result<bool, ReportError> {
        Ok(self.work.names()?.iter().all(|name| files::ALL.iter().any(|file| *name == part(file))))
    }

    fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), ReportError> {
        self.work.write(name, &json(value).map_err(ReportError::io(&self.path().join(name)))?)
    }

    fn read_json<T: DeserializeOwned>(&self, name: &str, expected: &'static str) -> Result<T, ReportError> {
        let bytes = self.work.read_whole(name, JSON_BYTES_MAX)?;
        serde_json::from_slice(&bytes).map_err(|error| ReportError::Content {
            path: self.path().join(name),
            expected,
            found: error.to_string(),
        })
    }

    /// Removes the files of the run, except for its manifest: a folder without it is not a run's.
    fn clear(&self) -> Result<(), ReportError> {
        for name in files::ALL {
            if name != MANIFEST {
                self.work.remove(name)?;
            }
            self.work.remove(&part(name))?;
        }
        let Ok(plots) = self.path().join(PLOTS).symlink_metadata() else { return Ok(()) };
        // If `plots` were a symbolic link, this would remove files outside of the run.
        if plots.is_dir() {
            let plots = self.work.subfolder(PLOTS)?;
            for name in files::PLOT_FILES {
                plots.remove(name)?;
            }
            // It stays if it holds other files.
            let _ = fs::remove_dir(plots.path());
        }
        Ok(())
    }
}

/// The greatest number that a folder `<stem>-<number>` has; 0 if there is none.
fn last_number(root: &Path, stem: &str) -> Result<u64, ReportError> {
    let mut last = 0;
    for entry in fs::read_dir(root).map_err(ReportError::io(root))? {
        let name = entry.map_err(ReportError::io(root))?.file_name();
        let number = name.to_str().and_then(|name| name.strip_prefix(stem)?.strip_prefix('-')?.parse().ok());
        last = last.max(number.unwrap_or(0));
    }
    Ok(last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::facts;
    use std::collections::BTreeSet;

    fn manifest() -> Manifest {
        Manifest::new(facts(3), serde_json::json!({"name": "s1"}), "0.1.0", None)
    }

    #[test]
    fn concurrent_runs_get_different_numbers() {
        let root = tempfile::tempdir().unwrap();
        let take = || (0..20).map(|_| RunFolder::numbered(root.path(), "s1").unwrap()).collect::<Vec<_>>();
        let folders = std::thread::scope(|scope| {
            let threads = [scope.spawn(take), scope.spawn(take)];
            threads.map(|thread| thread.join().unwrap()).concat()
        });
        let names: BTreeSet<_> = folders.iter().map(|f| f.path().file_name().unwrap().to_owned()).collect();
        assert_eq!(names.len(), 40);
        assert!(names.contains(std::ffi::OsStr::new("s1-1")) && names.contains(std::ffi::OsStr::new("s1-40")));
    }

    #[test]
    fn a_scenario_name_cannot_leave_the_root() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::numbered(root.path(), "../a b").unwrap();
        assert_eq!(folder.path(), root.path().join("..-a-b-1"));
    }

    #[test]
    fn an_existing_folder_is_refused_without_force() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("deep").join("run");
        RunFolder::at(&path, false).unwrap().begin(&manifest()).unwrap();
        fs::write(path.join("notes.txt"), "mine").unwrap();
        fs::write(path.join(SUMMARY), "old").unwrap();
        fs::create_dir(path.join(PLOTS)).unwrap();
        fs::write(path.join(PLOTS).join("trace.svg"), "old").unwrap();
        fs::write(path.join(PLOTS).join("own.svg"), "mine").unwrap();
        assert!(matches!(RunFolder::at(&path, false), Err(ReportError::Exists(_))));
        assert!(path.join(MANIFEST).exists());
        RunFolder::at(&path, true).unwrap().begin(&manifest()).unwrap();
        assert!(!path.join(SUMMARY).exists() && !path.join(PLOTS).join("trace.svg").exists());
        assert!(path.join("notes.txt").exists() && path.join(PLOTS).join("own.svg").exists());
    }

    #[test]
    fn force_changes_no_folder_that_is_not_of_a_run() {
        let root = tempfile::tempdir().unwrap();
        for manifest in ["{\"name\": \"web app\"}", "rubbish"] {
            fs::write(root.path().join(MANIFEST), manifest).unwrap();
            fs::write(root.path().join(SUMMARY), "mine").unwrap();
            assert!(matches!(RunFolder::at(root.path(), true), Err(ReportError::NotARun(_))));
            assert!(root.path().join(SUMMARY).exists());
        }
        let file = root.path().join(SUMMARY);
        assert!(matches!(RunFolder::at(&file, true), Err(ReportError::NotARun(_))));
        let empty = root.path().join("empty");
        fs::create_dir(&empty).unwrap();
        assert!(RunFolder::at(&empty, true).is_ok());
    }

    #[test]
    fn a_run_that_does_not_start_leaves_no_folder() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let begin = |force| {
            let folder = RunFolder::at(&path, force).unwrap();
            folder.begin(&manifest()).unwrap();
            folder
        };
        begin(false).abandon();
        assert!(!path.exists());
        let folder = begin(false);
        fs::write(path.join("notes.txt"), "mine").unwrap();
        folder.abandon();
        assert!(path.join("notes.txt").exists() && !path.join(MANIFEST).exists());
    }

    #[test]
    fn a_folder_whose_run_was_killed_at_its_beginning_is_replaced() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        RunFolder::at(&path, false).unwrap();
        fs::write(path.join(part(MANIFEST)), "{").unwrap();
        let folder = RunFolder::at(&path, true).unwrap();
        folder.begin(&manifest()).unwrap();
        folder.clear().unwrap();
        drop(folder);
        assert!(RunFolder::at(&path, true).is_ok(), "the manifest goes last");
    }

    #[test]
    fn two_runs_do_not_share_a_folder() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("run");
        let first = RunFolder::at(&path, false).unwrap();
        first.begin(&manifest()).unwrap();
        assert!(matches!(RunFolder::at(&path, true), Err(ReportError::InUse(_))));
        assert!(matches!(RunFolder::open(&path).unwrap().begin(&manifest()), Err(ReportError::InUse(_))));
        drop(first);
        RunFolder::at(&path, true).unwrap();
    }

    #[test]
    fn written_files_read_back() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        folder.begin(&manifest()).unwrap();
        assert_eq!(RunFolder::open(folder.path()).unwrap().read_manifest().unwrap(), manifest());
        folder.write_processes(&[ProcessEntry { role: Role::Drone, id: Some(3), pid: 7 }]).unwrap();
        let text = fs::read_to_string(folder.path().join(PROCESSES)).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json, serde_json::json!([{"role": "drone", "id": 3, "pid": 7}]));
        fs::write(folder.path().join(SUMMARY), "{}").unwrap();
        let error = folder.read_summary().unwrap_err().to_string();
        assert!(error.contains("summary.json") && error.contains("schema"), "{error}");
    }
}
