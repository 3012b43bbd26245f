//! The folder of a run, which never replaces anything but a run, and the JSON files in it.

use crate::error::ReportError;
use crate::facts::RunFacts;
use crate::files::{self, MANIFEST, PLOTS, PROCESSES, SUMMARY};
use crate::summary::Summary;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

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

/// The folder of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder(PathBuf);

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
            let path = root.join(format!("{stem}-{number}"));
            match fs::create_dir(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                made => return made.map(|()| Self(path.clone())).map_err(ReportError::io(&path)),
            }
        }
    }

    /// Creates the folder `path`. An existing folder is refused; with `force`, the files of the run in it are removed
    /// first, and no other files.
    ///
    /// # Errors
    /// [`ReportError::Exists`], [`ReportError::NotARun`] for a folder that is neither empty nor of a run, or
    /// [`ReportError::Io`].
    pub fn at(path: &Path, force: bool) -> Result<Self, ReportError> {
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            fs::create_dir_all(parent).map_err(ReportError::io(parent))?;
        }
        match fs::create_dir(path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            made => return made.map(|()| Self(path.to_owned())).map_err(ReportError::io(path)),
        }
        if !force {
            return Err(ReportError::Exists(path.to_owned()));
        }
        if !path.is_dir() {
            return Err(ReportError::NotARun(path.to_owned()));
        }
        let empty = fs::read_dir(path).map_err(ReportError::io(path))?.next().is_none();
        let folder = if empty { Self(path.to_owned()) } else { Self::open(path)? };
        folder.clear()?;
        Ok(folder)
    }

    /// Opens the folder of a recorded run.
    ///
    /// # Errors
    /// [`ReportError::NotARun`] if it holds no manifest of a run.
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        let schema = fs::read(path.join(MANIFEST)).ok().and_then(|bytes| {
            let manifest: serde_json::Value = serde_json::from_slice(&bytes).ok()?;
            manifest.get("schema")?.as_str().map(str::to_owned)
        });
        match schema {
            Some(schema) if schema.starts_with("skein-manifest/") => Ok(Self(path.to_owned())),
            _ => Err(ReportError::NotARun(path.to_owned())),
        }
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Writes manifest.json.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn write_manifest(&self, manifest: &Manifest) -> Result<(), ReportError> {
        self.write_json(MANIFEST, manifest)
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

    /// Reads summary.json.
    ///
    /// # Errors
    /// [`ReportError::Io`] or [`ReportError::Content`].
    pub fn read_summary(&self) -> Result<Summary, ReportError> {
        self.read_json(SUMMARY, "the summary of a run by this version of Skein")
    }

    /// Path of the folder for plots, which is created if it is missing.
    pub(crate) fn plots(&self) -> Result<PathBuf, ReportError> {
        let path = self.0.join(PLOTS);
        fs::create_dir_all(&path).map_err(ReportError::io(&path))?;
        Ok(path)
    }

    /// Writes a file under another name and renames it, so that a reader finds the whole file or none.
    fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), ReportError> {
        let (path, beside) = (self.0.join(name), self.0.join(format!(".{name}.part")));
        let mut bytes = serde_json::to_vec_pretty(value).map_err(|error| ReportError::io(&path)(error.into()))?;
        bytes.push(b'\n');
        fs::write(&beside, bytes).map_err(ReportError::io(&beside))?;
        fs::rename(&beside, &path).map_err(ReportError::io(&path))
    }

    fn read_json<T: DeserializeOwned>(&self, name: &str, expected: &'static str) -> Result<T, ReportError> {
        let path = self.0.join(name);
        let bytes = fs::read(&path).map_err(ReportError::io(&path))?;
        serde_json::from_slice(&bytes).map_err(|error| ReportError::Content {
            path,
            expected,
            found: error.to_string(),
        })
    }

    /// Removes the files of the run.
    fn clear(&self) -> Result<(), ReportError> {
        let plots = self.0.join(PLOTS);
        // If `plots` were a symbolic link, this would remove files outside of the run.
        let own_plots = fs::symlink_metadata(&plots).is_ok_and(|meta| meta.is_dir());
        let plot_files = files::PLOT_FILES.iter().filter(|_| own_plots).map(|name| plots.join(name));
        for path in files::ALL.iter().map(|name| self.0.join(name)).chain(plot_files) {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(ReportError::io(&path)(error)),
                _ => {}
            }
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
        RunFolder::at(&path, false).unwrap().write_manifest(&manifest()).unwrap();
        fs::write(path.join("notes.txt"), "mine").unwrap();
        fs::create_dir(path.join(PLOTS)).unwrap();
        fs::write(path.join(PLOTS).join("trace.svg"), "old").unwrap();
        fs::write(path.join(PLOTS).join("own.svg"), "mine").unwrap();
        assert!(matches!(RunFolder::at(&path, false), Err(ReportError::Exists(_))));
        assert!(path.join(MANIFEST).exists());
        RunFolder::at(&path, true).unwrap();
        assert!(!path.join(MANIFEST).exists() && !path.join(PLOTS).join("trace.svg").exists());
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
    fn written_files_read_back() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::at(&root.path().join("run"), false).unwrap();
        folder.write_manifest(&manifest()).unwrap();
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
