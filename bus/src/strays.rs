//! Files in shared memory that belong to no run any more. A process that outlives its launcher for a moment makes some, and so does an
//! observer that outlives its run.

use crate::error::BusError;
use crate::home_file::HomeFile;
use crate::run_tag::RunTag;
use crate::shared_memory::shared_files;
use std::collections::BTreeMap;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Files of runs without a folder, by run.
pub(crate) struct Strays(BTreeMap<RunTag, Vec<PathBuf>>);

impl Strays {
    /// Those of this user which no process uses.
    pub(crate) fn find() -> Result<Self, BusError> {
        let mut runs = BTreeMap::<RunTag, Vec<PathBuf>>::new();
        for path in shared_files("skein_")? {
            let tag = path.file_name().and_then(|name| name.to_str()).and_then(RunTag::of_file);
            if let Some(tag) = tag {
                runs.entry(tag).or_default().push(path);
            }
        }
        runs.retain(|tag, _| HomeFile::is_gone(tag));
        if !runs.is_empty() {
            let used = used()?;
            runs.retain(|tag, _| !used.contains(&tag.prefix()));
        }
        Ok(Self(runs))
    }

    /// Removes them. Returns the number of their runs and of files.
    pub(crate) fn remove(self) -> Result<(usize, usize), BusError> {
        let (runs, mut files) = (self.0.len(), 0);
        for path in self.0.into_values().flatten() {
            match fs::remove_file(&path) {
                Ok(()) => files += 1,
                // Another process was faster.
                Err(error) if error.kind() == ErrorKind::NotFound => {}
                Err(error) => return Err(BusError::io("remove", &path)(error)),
            }
        }
        Ok((runs, files))
    }
}

/// What the processes of this user map and have open, as far as it is Skein's.
fn used() -> Result<String, BusError> {
    let proc = Path::new("/proc");
    let mut used = String::new();
    for entry in fs::read_dir(proc).map_err(BusError::io("list", proc))?.flatten() {
        if !entry.file_name().to_str().is_some_and(|name| name.bytes().all(|byte| byte.is_ascii_digit())) {
            continue;
        }
        // A process that ends meanwhile uses nothing. That of another user does not use what only this user may open.
        let maps = fs::read(entry.path().join("maps")).unwrap_or_default();
        let maps = String::from_utf8_lossy(&maps).into_owned();
        let open = fs::read_dir(entry.path().join("fd")).into_iter().flatten().flatten();
        let open = open.filter_map(|fd| fs::read_link(fd.path()).ok()).map(|path| path.to_string_lossy().into_owned());
        for name in maps.lines().map(str::to_owned).chain(open).filter(|name| name.contains("/skein_")) {
            used += &name;
            used.push('\n');
        }
    }
    Ok(used)
}
