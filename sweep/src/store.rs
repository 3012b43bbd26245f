//! A sweep's folder: which experiment it belongs to, and the rows of the runs that are done.

use crate::error::SweepError;
use crate::missions::Missions;
use crate::row::Row;
use crate::shard::Shard;
use serde::{Deserialize, Serialize};
use skein_report::WorkFolder;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::time::SystemTime;

const IDENTITY: &str = "experiment.json";
const PART: &str = ".experiment.json.part";
const ROWS: &str = "rows.jsonl";
const MISSIONS: &str = "missions.json";
/// Greatest size of the file with the identity, bytes.
const IDENTITY_BYTES_MAX: u64 = 1 << 20;
/// Greatest size of the file with the missions, bytes.
const MISSIONS_BYTES_MAX: u64 = 1 << 30;

/// Which experiment a folder belongs to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Identity {
    /// Name and version of the folder's layout.
    pub(crate) schema: String,
    /// Name of the experiment.
    pub(crate) name: String,
    /// Hash of everything that decides what is flown: experiment, scenarios, overrides and program version.
    pub(crate) hash: String,
    /// Number of runs, those of other shards included.
    pub(crate) runs: usize,
    /// The shard that the folder holds; `None`: all runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) shard: Option<Shard>,
}

impl Identity {
    /// Whether both are about the same runs of the same program, in whichever shards.
    pub(crate) fn is_same_sweep(&self, other: &Self) -> bool {
        *self == Self { shard: self.shard, ..other.clone() }
    }
}

/// The folder of a shard, as it is read to be merged.
#[derive(Debug)]
pub(crate) struct ShardFolder {
    pub(crate) identity: Identity,
    pub(crate) missions: Missions,
    pub(crate) rows: Vec<Row>,
}

impl ShardFolder {
    /// Reads a folder. It is refused while a sweep writes to it.
    pub(crate) fn read(path: &Path) -> Result<Self, SweepError> {
        let not_a_shard = || SweepError::NotAShard(path.to_owned());
        let folder = WorkFolder::open(path).map_err(|_| not_a_shard())?;
        folder.claim()?;
        let identity = read_identity(&folder).filter(|identity| identity.shard.is_some()).ok_or_else(not_a_shard)?;
        let missions = folder.read_whole(MISSIONS, MISSIONS_BYTES_MAX).ok();
        let missions = missions.and_then(|bytes| serde_json::from_slice(&bytes).ok()).ok_or_else(not_a_shard)?;
        let mut file = folder.append(ROWS)?;
        let (rows, _) = read(&mut file, &folder.path().join(ROWS), identity.runs)?;
        Ok(Self { identity, missions, rows })
    }
}

/// The folder of a sweep or of a shard, as it is looked at while it may be written to.
#[derive(Debug)]
pub(crate) struct FolderState {
    pub(crate) identity: Identity,
    pub(crate) rows: Vec<Row>,
    /// When the last row was written.
    pub(crate) written: Option<SystemTime>,
}

impl FolderState {
    /// Looks at a folder without a lock: whoever flies its runs is not kept from it.
    pub(crate) fn look(path: &Path) -> Result<Self, SweepError> {
        let not_a_sweep = || SweepError::NoSweep(path.to_owned());
        let folder = WorkFolder::open(path).map_err(|_| not_a_sweep())?;
        let identity = read_identity(&folder).ok_or_else(not_a_sweep)?;
        let path = folder.path().join(ROWS);
        let Ok(mut file) = folder.read(ROWS) else { return Ok(Self { identity, rows: Vec::new(), written: None }) };
        let (rows, _) = read(&mut file, &path, identity.runs)?;
        let written = file.metadata().and_then(|data| data.modified()).ok().filter(|_| !rows.is_empty());
        Ok(Self { identity, rows, written })
    }
}

/// An open folder. It is locked against other processes that write to it.
#[derive(Debug)]
pub(crate) struct Store {
    folder: WorkFolder,
    rows: File,
}

impl Store {
    /// Opens the folder, or makes it. Returns the rows that it already holds. An incomplete last line is dropped, and so are the rows of
    /// runs that were cut short.
    pub(crate) fn open(path: &Path, identity: &Identity) -> Result<(Self, Vec<Row>), SweepError> {
        check_identity(path, identity)?;
        let (folder, _) = WorkFolder::make(path)?;
        // Another sweep may have made it since.
        if !check_identity(path, identity)? {
            folder.write(IDENTITY, &serde_json::to_vec_pretty(identity)?)?;
        }
        let mut file = folder.append(ROWS)?;
        let (mut rows, complete) = read(&mut file, &folder.path().join(ROWS), identity.runs)?;
        file.set_len(complete).map_err(SweepError::io(&folder.path().join(ROWS)))?;
        if rows.iter().any(Row::is_cut_short) {
            rows.retain(|row| !row.is_cut_short());
            write_rows(&folder, &rows)?;
            file = folder.append(ROWS)?;
        }
        Ok((Self { folder, rows: file }, rows))
    }

    /// Keeps the missions beside the rows.
    pub(crate) fn keep_missions(&self, missions: &Missions) -> Result<(), SweepError> {
        Ok(self.folder.write(MISSIONS, &serde_json::to_vec_pretty(missions)?)?)
    }

    /// Replaces the rows by those of the complete sweep in the order of the runs, whichever were done first.
    pub(crate) fn arrange(&self, rows: &[Row]) -> Result<(), SweepError> {
        write_rows(&self.folder, rows)
    }

    /// Appends a row. When this returns, the line is in the file even if the process is killed right after.
    pub(crate) fn keep(&mut self, row: &Row) -> Result<(), SweepError> {
        let mut line = serde_json::to_vec(row)?;
        line.push(b'\n');
        self.rows.write_all(&line).map_err(SweepError::io(&self.folder.path().join(ROWS)))
    }

    /// The sweep's folder.
    pub(crate) fn folder(&self) -> &WorkFolder {
        &self.folder
    }
}

/// Replaces the rows of a folder.
fn write_rows(folder: &WorkFolder, rows: &[Row]) -> Result<(), SweepError> {
    let mut lines = Vec::new();
    for row in rows {
        serde_json::to_writer(&mut lines, row)?;
        lines.push(b'\n');
    }
    Ok(folder.write(ROWS, &lines)?)
}

/// Makes sure that the folder belongs to this experiment, or to none. Returns whether it says so.
fn check_identity(path: &Path, identity: &Identity) -> Result<bool, SweepError> {
    if !path.exists() {
        return Ok(false);
    }
    let not_a_sweep = || SweepError::NotASweep(path.to_owned());
    let folder = WorkFolder::open(path).map_err(|_| not_a_sweep())?;
    let folder_path = path.to_owned();
    match read_identity(&folder) {
        Some(found) if found == *identity => Ok(true),
        Some(found) if found.is_same_sweep(identity) => {
            Err(SweepError::OtherShard { folder: folder_path, found: found.shard, expected: identity.shard })
        }
        Some(Identity { name, .. }) if name == identity.name => Err(SweepError::Changed { folder: folder_path, name }),
        Some(Identity { name, .. }) => Err(SweepError::OtherExperiment { folder: folder_path, name }),
        None if is_empty(&folder)? => Ok(false),
        None => Err(not_a_sweep()),
    }
}

fn read_identity(folder: &WorkFolder) -> Option<Identity> {
    let bytes = folder.read_whole(IDENTITY, IDENTITY_BYTES_MAX).ok()?;
    serde_json::from_slice(&bytes).ok()
}

/// Whether the folder holds nothing, except the file of a sweep that was killed while it made the folder.
fn is_empty(folder: &WorkFolder) -> Result<bool, SweepError> {
    Ok(folder.names()?.iter().all(|name| name == PART))
}

/// The rows of the file, and the number of bytes up to the end of the last complete line.
fn read(file: &mut File, path: &Path, runs: usize) -> Result<(Vec<Row>, u64), SweepError> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0)).map_err(SweepError::io(path))?;
    file.read_to_end(&mut bytes).map_err(SweepError::io(path))?;
    let complete = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
    let lines = bytes[..complete].split(|&byte| byte == b'\n').filter(|line| !line.is_empty());
    let mut rows: Vec<Row> = Vec::new();
    let mut seen = vec![false; runs];
    for (number, line) in lines.enumerate() {
        let broken = |problem: String| SweepError::Row { path: path.to_owned(), line: number + 1, problem };
        let row: Row = serde_json::from_slice(line).map_err(|error| broken(error.to_string()))?;
        let known =
            seen.get_mut(row.job).ok_or_else(|| broken(format!("expected a run below {runs}, found {}", row.job)))?;
        if !std::mem::replace(known, true) {
            rows.push(row);
        }
    }
    Ok((rows, complete as u64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use skein_report::ReportError;

    fn identity(hash: &str) -> Identity {
        Identity { schema: "s".to_owned(), name: "e".to_owned(), hash: hash.to_owned(), runs: 3, shard: None }
    }

    fn row(job: usize) -> Row {
        Row { metrics: vec![Some(0.1), None], ..Row::unflown(job, "invalid", "a\nb") }
    }

    #[test]
    fn a_torn_last_line_is_dropped_and_the_rest_kept() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("deep/out");
        let (mut store, rows) = Store::open(&folder, &identity("1")).unwrap();
        assert_eq!(rows, []);
        store.keep(&row(2)).unwrap();
        store.keep(&row(0)).unwrap();
        store.rows.write_all(b"{\"job\":1,\"outc").unwrap();
        drop(store);
        let (mut store, rows) = Store::open(&folder, &identity("1")).unwrap();
        assert_eq!(rows, [row(2), row(0)]);
        store.keep(&row(1)).unwrap();
        drop(store);
        let (_, rows) = Store::open(&folder, &identity("1")).unwrap();
        assert_eq!(rows, [row(2), row(0), row(1)], "a row that is kept after a torn line has a line of its own");
    }

    #[test]
    fn runs_that_were_cut_short_are_flown_again() {
        let root = tempfile::tempdir().unwrap();
        let (mut store, _) = Store::open(root.path(), &identity("1")).unwrap();
        let aborted = Row { outcome: "aborted".to_owned(), ..row(1) };
        [row(2), aborted, Row::unflown(0, "failed", "no summary")].iter().for_each(|row| store.keep(row).unwrap());
        drop(store);
        let (mut store, rows) = Store::open(root.path(), &identity("1")).unwrap();
        assert_eq!(rows, [row(2)]);
        store.keep(&row(1)).unwrap();
        drop(store);
        let (_, rows) = Store::open(root.path(), &identity("1")).unwrap();
        assert_eq!(rows, [row(2), row(1)]);
    }

    #[test]
    fn the_rows_of_a_complete_sweep_are_in_the_order_of_their_runs() {
        let root = tempfile::tempdir().unwrap();
        let (mut store, _) = Store::open(root.path(), &identity("1")).unwrap();
        [2, 0, 1].into_iter().for_each(|job| store.keep(&row(job)).unwrap());
        store.arrange(&[row(0), row(1), row(2)]).unwrap();
        drop(store);
        let (_, rows) = Store::open(root.path(), &identity("1")).unwrap();
        assert_eq!(rows, [row(0), row(1), row(2)]);
    }

    #[test]
    fn other_folders_and_broken_lines_are_refused() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("out");
        let (store, _) = Store::open(&folder, &identity("1")).unwrap();
        assert!(matches!(Store::open(&folder, &identity("1")), Err(SweepError::Folder(ReportError::InUse(_)))));
        drop(store);
        assert!(matches!(Store::open(&folder, &identity("2")), Err(SweepError::Changed { .. })));
        std::fs::write(folder.join(ROWS), "{}\n").unwrap();
        assert!(matches!(Store::open(&folder, &identity("1")), Err(SweepError::Row { line: 1, .. })));
        std::fs::write(root.path().join("mine.txt"), "").unwrap();
        assert!(matches!(Store::open(root.path(), &identity("1")), Err(SweepError::NotASweep(_))));
    }
}
