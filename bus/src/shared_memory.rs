//! The file system of POSIX shared memory: which files a run has in it, and how much of it is free.

use crate::error::BusError;
use rustix::fs::statvfs;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Where POSIX shared memory has its files.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// The files of this user in shared memory whose names begin with `prefix`.
pub(crate) fn shared_files(prefix: &str) -> Result<Vec<PathBuf>, BusError> {
    let shared = Path::new(SHARED_MEMORY);
    let uid = rustix::process::geteuid().as_raw();
    let mut files = Vec::new();
    for entry in fs::read_dir(shared).map_err(BusError::io("list", shared))? {
        let entry = entry.map_err(BusError::io("list", shared))?;
        let begins = entry.file_name().as_bytes().starts_with(prefix.as_bytes());
        if begins && entry.metadata().is_ok_and(|meta| meta.uid() == uid) {
            files.push(entry.path());
        }
    }
    Ok(files)
}

/// Checks that so many bytes are free.
///
/// # Errors
/// [`BusError::NoRoom`], [`BusError::Io`].
pub(crate) fn require(needed: u64) -> Result<(), BusError> {
    let free = free()?;
    if needed > free { Err(BusError::NoRoom { needed, free }) } else { Ok(()) }
}

/// Number of free bytes.
pub(crate) fn free() -> Result<u64, BusError> {
    let shared = Path::new(SHARED_MEMORY);
    let about = statvfs(shared).map_err(BusError::io("look at", shared))?;
    // A file system without a limit has no blocks at all.
    Ok(if about.f_blocks == 0 { u64::MAX } else { about.f_bavail * about.f_frsize })
}
