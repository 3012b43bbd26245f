//! A file in shared memory that names a run's folder. The run's launcher holds its lock. So the files of a run whose folder is gone can
//! be told from those of a run that lives, also where this process cannot see the folder of that run.

use crate::error::BusError;
use crate::run_tag::RunTag;
use crate::shared_memory::{SHARED_MEMORY, require};
use rustix::fs::{FlockOperation, flock};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// Most bytes of a folder's path that are read.
const MAX_PATH: u64 = 4096;

/// The file of a living run. The lock is released however the launcher ends.
#[derive(Debug)]
pub(crate) struct HomeFile {
    _lock: File,
}

impl HomeFile {
    /// For the launcher, before the run has any other file in shared memory.
    pub(crate) fn create(tag: &RunTag, folder: &Path) -> Result<Self, BusError> {
        let (path, text) = (Self::path(&tag.prefix()), folder.as_os_str().as_bytes());
        require(text.len() as u64)?;
        let mut options = File::options();
        let file = options.write(true).create_new(true).mode(0o600).open(&path);
        let mut file = file.map_err(BusError::io("create", &path))?;
        flock(&file, FlockOperation::NonBlockingLockExclusive).map_err(BusError::io("lock", &path))?;
        file.write_all(text).map_err(BusError::io("write", &path))?;
        Ok(Self { _lock: file })
    }

    /// Where the run with this prefix has it.
    pub(crate) fn path(prefix: &str) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{prefix}home"))
    }

    /// Whether the run has neither a folder nor a living launcher. A run that has files and no home is one that has ended.
    pub(crate) fn is_gone(tag: &RunTag) -> bool {
        let path = Self::path(&tag.prefix());
        let file = match File::options().read(true).custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(path) {
            Ok(file) => file,
            Err(error) => return error.kind() == ErrorKind::NotFound,
        };
        let mut folder = Vec::new();
        if (&file).take(MAX_PATH).read_to_end(&mut folder).is_err() {
            return false;
        }
        if folder.is_empty() {
            // Its launcher has just made it, or was killed then.
            return !Path::new("/proc").join(tag.launcher().to_string()).exists();
        }
        let is_there = fs::symlink_metadata(OsStr::from_bytes(&folder)).is_ok();
        !is_there && flock(&file, FlockOperation::NonBlockingLockShared).is_ok()
    }
}
