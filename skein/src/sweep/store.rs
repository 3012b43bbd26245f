//! A sweep's folder: whose it is, and the rows of the runs that are done.

use super::row::Row;
use crate::exit::Failure;
use serde::{Deserialize, Serialize};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const IDENTITY: &str = "experiment.json";
const PART: &str = "experiment.json.part";
const ROWS: &str = "rows.jsonl";

/// Whose sweep a folder holds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Name and version of this layout.
    pub schema: String,
    /// The experiment's name.
    pub name: String,
    /// Of everything that decides what is flown: experiment, scenarios, overrides, version.
    pub hash: String,
    /// Number of runs.
    pub runs: usize,
}

/// An open folder, locked against a second sweep.
pub struct Store {
    folder: PathBuf,
    file: File,
}

impl Store {
    /// Opens or makes the folder; returns the rows that are there already, a torn last line dropped.
    pub fn open(folder: &Path, identity: &Identity) -> Result<(Self, Vec<Row>), Failure> {
        let trouble = |path: &Path, error: std::io::Error| Failure::environment(format!("{}: {error}", path.display()));
        identify(folder, identity)?;
        let path = folder.join(ROWS);
        let file = OpenOptions::new().read(true).append(true).create(true).open(&path);
        let mut file = file.map_err(|error| trouble(&path, error))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Failure::usage(format!("{}: another sweep is at work here", folder.display())));
            }
            Err(TryLockError::Error(error)) => return Err(trouble(&path, error)),
        }
        let (rows, sound) = read(&mut file, identity.runs).map_err(|error| trouble(&path, error))?;
        file.set_len(sound).map_err(|error| trouble(&path, error))?;
        Ok((Self { folder: folder.to_owned(), file }, rows))
    }

    /// Keeps a finished run: its line is in the file when this returns, also if the process is killed right after.
    pub fn keep(&mut self, row: &Row) -> std::io::Result<()> {
        let mut line = serde_json::to_vec(row)?;
        line.push(b'\n');
        self.file.write_all(&line)
    }

    /// A file of the sweep's folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Writes a file of the folder as a whole: there is never half of it.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), Failure> {
        let (path, part) = (self.path(name), self.path(&format!("{name}.part")));
        let folder = path.parent().unwrap_or(&self.folder);
        let written = std::fs::create_dir_all(folder)
            .and_then(|()| std::fs::write(&part, content))
            .and_then(|()| std::fs::rename(&part, &path));
        written.map_err(|error| Failure::environment(format!("{}: {error}", path.display())))
    }
}

/// Makes sure the folder is this experiment's: makes it, or compares.
fn identify(folder: &Path, identity: &Identity) -> Result<(), Failure> {
    let path = folder.join(IDENTITY);
    let shown = folder.display();
    let found = match std::fs::read(&path) {
        Ok(bytes) => serde_json::from_slice::<Identity>(&bytes).ok(),
        Err(_) if !folder.exists() => return create(folder, &path, identity),
        Err(_) => None,
    };
    match found {
        Some(found) if found == *identity => Ok(()),
        Some(found) if found.name == identity.name => Err(Failure::usage(format!(
            "{shown}: holds experiment {:?} from before it, a scenario, an override or this program changed; name another --out",
            found.name
        ))),
        Some(found) => {
            Err(Failure::usage(format!("{shown}: holds another experiment, {:?}; name another --out", found.name)))
        }
        None if is_empty(folder) => create(folder, &path, identity),
        None => Err(Failure::usage(format!("{shown}: exists and is no sweep's folder; name another --out"))),
    }
}

/// Whether nothing is in it, but what a sweep leaves that was killed while it made the folder.
fn is_empty(folder: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    entries.flatten().all(|entry| entry.file_name() == PART)
}

fn create(folder: &Path, path: &Path, identity: &Identity) -> Result<(), Failure> {
    let text = serde_json::to_vec_pretty(identity).map_err(Failure::environment)?;
    let part = folder.join(PART);
    let made = std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(&part, text))
        .and_then(|()| std::fs::rename(&part, path));
    made.map_err(|error| Failure::environment(format!("{}: {error}", folder.display())))
}

/// The rows of a file and the number of sound bytes: what follows the last line's end is torn.
fn read(file: &mut File, runs: usize) -> std::io::Result<(Vec<Row>, u64)> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.read_to_end(&mut bytes)?;
    let sound = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
    let lines = bytes[..sound].split(|&byte| byte == b'\n').filter(|line| !line.is_empty());
    let mut rows: Vec<Row> = Vec::new();
    let mut seen = vec![false; runs];
    for (number, line) in lines.enumerate() {
        let broken = |what: String| std::io::Error::other(format!("line {}: {what}", number + 1));
        let row: Row = serde_json::from_slice(line).map_err(|error| broken(error.to_string()))?;
        let known = seen.get_mut(row.job).ok_or_else(|| broken(format!("no run {}", row.job)))?;
        if !std::mem::replace(known, true) {
            rows.push(row);
        }
    }
    Ok((rows, sound as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(hash: &str) -> Identity {
        Identity { schema: "s".to_owned(), name: "e".to_owned(), hash: hash.to_owned(), runs: 3 }
    }

    fn row(job: usize) -> Row {
        Row { metrics: vec![Some(0.1), None], ..Row::unflown(job, "failed", "a\nb") }
    }

    #[test]
    fn a_torn_last_line_is_dropped_and_the_rest_kept() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("deep/out");
        let (mut store, rows) = Store::open(&folder, &identity("1")).ok().unwrap();
        assert_eq!(rows, []);
        store.keep(&row(2)).unwrap();
        store.keep(&row(0)).unwrap();
        store.file.write_all(b"{\"job\":1,\"outc").unwrap();
        drop(store);
        let (mut store, rows) = Store::open(&folder, &identity("1")).ok().unwrap();
        assert_eq!(rows, [row(2), row(0)]);
        store.keep(&row(1)).unwrap();
        drop(store);
        let (_, rows) = Store::open(&folder, &identity("1")).ok().unwrap();
        assert_eq!(rows, [row(2), row(0), row(1)], "what is kept after a torn line is a line of its own");
    }

    #[test]
    fn other_folders_and_broken_lines_are_refused() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("out");
        let (store, _) = Store::open(&folder, &identity("1")).ok().unwrap();
        assert!(Store::open(&folder, &identity("1")).is_err(), "it is locked");
        drop(store);
        assert_eq!(Store::open(&folder, &identity("2")).err().unwrap().exit, crate::exit::Exit::Usage);
        std::fs::write(folder.join(ROWS), "{}\n").unwrap();
        assert_eq!(Store::open(&folder, &identity("1")).err().unwrap().exit, crate::exit::Exit::Environment);
        std::fs::write(root.path().join("mine.txt"), "").unwrap();
        assert_eq!(Store::open(root.path(), &identity("1")).err().unwrap().exit, crate::exit::Exit::Usage);
    }
}
