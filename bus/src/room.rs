//! Space in shared memory. A page is taken when it is first written, and a process that finds no page is ended by SIGBUS. So a
//! run reserves all pages of its files before its first tick: then files of others that fill /dev/shm do not end it.

use crate::domain::Domain;
use crate::error::BusError;
use crate::shared_memory::{free, require, shared_files};
use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::{Errno, retry_on_intr};
use std::fs::{self, File};
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Unit of `st_blocks`, bytes.
const BLOCK: u64 = 512;
/// Free space that a process needs to join a run: its ports, and its part of their connections. Measured: 0.1 MiB.
pub(crate) const JOIN_BYTES: u64 = 1 << 20;

/// The files of a run in shared memory.
#[derive(Clone, Debug)]
pub(crate) struct Room {
    prefix: String,
}

impl Room {
    /// Those of this run.
    pub(crate) fn of(domain: &Domain) -> Self {
        Self { prefix: domain.prefix().to_owned() }
    }

    /// Reserves all pages that the files do not have yet.
    ///
    /// # Errors
    /// [`BusError::NoRoom`]; then nothing is reserved. [`BusError::Io`].
    pub(crate) fn reserve(&self) -> Result<(), BusError> {
        let mut sparse = Vec::new();
        let mut needed = 0;
        for path in shared_files(&self.prefix)? {
            let Some(file) = open(&path)? else { continue };
            let meta = file.metadata().map_err(BusError::io("look at", &path))?;
            let missing = meta.len().next_multiple_of(meta.blksize()).saturating_sub(meta.blocks() * BLOCK);
            if missing > 0 {
                needed += missing;
                sparse.push((path, file, meta.len()));
            }
        }
        require(needed)?;
        for (path, file, len) in sparse {
            match retry_on_intr(|| fallocate(&file, FallocateFlags::empty(), 0, len)) {
                // A file system that cannot reserve is none in which pages can run out.
                Ok(()) | Err(Errno::OPNOTSUPP) => {}
                // Another process was faster.
                Err(Errno::NOSPC) => return Err(BusError::NoRoom { needed, free: free()? }),
                Err(error) => return Err(BusError::io("reserve", &path)(error)),
            }
        }
        Ok(())
    }
}

/// Checks that a process can join a run without taking the last page.
///
/// # Errors
/// [`BusError::NoRoom`], [`BusError::Io`].
pub(crate) fn check_join() -> Result<(), BusError> {
    require(JOIN_BYTES)
}

/// `None` if the file is gone, is a folder, or is one that nobody may write.
fn open(path: &Path) -> Result<Option<File>, BusError> {
    if fs::symlink_metadata(path).is_ok_and(|meta| !meta.is_file()) {
        return Ok(None);
    }
    match File::options().read(true).write(true).open(path) {
        Ok(file) => Ok(Some(file)),
        Err(error) if [ErrorKind::NotFound, ErrorKind::PermissionDenied].contains(&error.kind()) => Ok(None),
        Err(error) => Err(BusError::io("open", path)(error)),
    }
}
