//! How far a sweep is whose runs are flown in several folders.

use crate::error::SweepError;
use crate::shard::Shard;
use crate::store::{FolderState, Identity};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// How far one folder is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FolderProgress {
    /// The folder.
    pub folder: PathBuf,
    /// The shard that it holds; `None`: all runs.
    pub shard: Option<Shard>,
    /// Runs that are done.
    pub done: usize,
    /// Its runs.
    pub runs: usize,
    /// Time since its last run was done, s; `None` before that.
    pub idle_s: Option<f64>,
}

/// How far a sweep is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweepProgress {
    /// Name of the experiment.
    pub experiment: String,
    /// Runs that are done in any folder.
    pub done: usize,
    /// All runs of the sweep.
    pub runs: usize,
    /// Number of runs by their outcome.
    pub outcomes: BTreeMap<String, usize>,
    /// The folders, by their shards.
    pub folders: Vec<FolderProgress>,
    /// Shards of which there is no folder.
    pub absent: Vec<Shard>,
}

impl SweepProgress {
    /// Looks at folders of one sweep, which may be written to meanwhile. `now` is the time for [`FolderProgress::idle_s`].
    ///
    /// # Errors
    /// [`SweepError::NoShards`], [`SweepError::NoSweep`], [`SweepError::OtherSweep`], and what reading a folder gives.
    pub fn read(folders: &[PathBuf], now: SystemTime) -> Result<Self, SweepError> {
        let mut sweep: Option<(Identity, &Path)> = None;
        let (mut outcomes, mut listed) = (BTreeMap::new(), Vec::new());
        let mut seen = Vec::new();
        for path in folders {
            let FolderState { identity, rows, written } = FolderState::look(path)?;
            seen.resize(identity.runs, false);
            for row in rows.iter().filter(|row| !std::mem::replace(&mut seen[row.job], true)) {
                *outcomes.entry(row.outcome.clone()).or_default() += 1;
            }
            listed.push(FolderProgress {
                folder: path.clone(),
                shard: identity.shard,
                done: rows.len(),
                runs: identity.shard.map_or(identity.runs, |shard| shard.len(identity.runs)),
                idle_s: written.map(|at| now.duration_since(at).unwrap_or_default().as_secs_f64()),
            });
            match &sweep {
                Some((first, first_path)) if !first.is_same_sweep(&identity) => {
                    return Err(SweepError::OtherSweep { first: first_path.to_path_buf(), second: path.clone() });
                }
                Some(_) => {}
                None => sweep = Some((identity, path)),
            }
        }
        let Some((first, _)) = sweep else { return Err(SweepError::NoShards) };
        listed.sort_by_key(|folder| folder.shard);
        let all = first.shard.map(Shard::all).unwrap_or_default();
        let absent = all.into_iter().filter(|shard| !listed.iter().any(|folder| folder.shard == Some(*shard)));
        Ok(Self {
            experiment: first.name,
            done: seen.iter().filter(|seen| **seen).count(),
            runs: first.runs,
            outcomes,
            absent: absent.collect(),
            folders: listed,
        })
    }

    /// Whether all runs are done.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.done == self.runs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::Row;
    use crate::store::Store;

    fn shard(root: &Path, name: &str, shard: &str, done: &[usize]) -> PathBuf {
        let folder = root.join(name);
        let identity = Identity {
            schema: "s".to_owned(),
            name: "e".to_owned(),
            hash: "1".to_owned(),
            runs: 8,
            shard: Some(shard.parse().unwrap()),
        };
        let (mut store, _) = Store::open(&folder, &identity).unwrap();
        done.iter().for_each(|&job| store.keep(&Row::unflown(job, "invalid", "why")).unwrap());
        folder
    }

    #[test]
    fn the_runs_of_all_folders_are_counted_once() {
        let root = tempfile::tempdir().unwrap();
        let folders = [shard(root.path(), "b", "2/3", &[1, 4]), shard(root.path(), "a", "1/3", &[])];
        let found = SweepProgress::read(&folders, SystemTime::now()).unwrap();
        assert_eq!((found.done, found.runs, found.is_complete()), (2, 8, false));
        let counts: Vec<_> = found.folders.iter().map(|folder| (folder.done, folder.runs)).collect();
        assert_eq!(counts, [(0, 3), (2, 3)], "sorted by shard");
        assert_eq!(found.absent, ["3/3".parse().unwrap()]);
        assert_eq!(found.outcomes.get("invalid"), Some(&2));
        assert!(found.folders[0].idle_s.is_none() && found.folders[1].idle_s.is_some_and(|idle_s| idle_s < 60.0));
        let last = shard(root.path(), "c", "3/3", &[2, 5]);
        let all = [folders[0].clone(), shard(root.path(), "d", "1/3", &[0, 3, 6, 1]), last, folders[0].clone()];
        let found = SweepProgress::read(&all, SystemTime::now()).unwrap();
        assert_eq!((found.done, found.absent.len()), (7, 0), "run 1 is in two folders");
    }

    #[test]
    fn a_folder_is_looked_at_while_it_is_written_to() {
        let root = tempfile::tempdir().unwrap();
        let folder = shard(root.path(), "a", "1/1", &[0]);
        let identity = FolderState::look(&folder).unwrap().identity;
        let _writer = Store::open(&folder, &identity).unwrap();
        assert_eq!(SweepProgress::read(std::slice::from_ref(&folder), SystemTime::now()).unwrap().done, 1);
        let none = SweepProgress::read(&[root.path().to_owned()], SystemTime::now());
        assert!(matches!(none, Err(SweepError::NoSweep(_))));
    }
}
