//! Space in shared memory that a run keeps for a process that is started in flight, such as a restarted drone. Files of others may
//! fill all the rest.

use crate::domain::Domain;
use crate::error::BusError;
use crate::payload::WireFrame;
use crate::room::JOIN_BYTES;
use crate::services::{UPLINK_FRAMES, uplink_buffer};
use crate::shared_memory::{SHARED_MEMORY, free};
use rustix::fs::{FallocateFlags, fallocate};
use rustix::io::{Errno, retry_on_intr};
use std::fs::File;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// What the ports of a process take, if it sends for one drone, rounded up. Measured: 0.1 MiB.
const PORTS_BYTES: u64 = 128 << 10;

/// A file that holds the pages. It has the run's prefix and goes with the run.
#[derive(Debug)]
pub struct SpareRoom {
    file: File,
    path: PathBuf,
    bytes: u64,
}

impl SpareRoom {
    /// Keeps what so many restarts take, one after the other. Each takes its part even if the drone has left as much, because others may
    /// fill that first. `senders` is as in [`Services::create`](crate::Services::create). For the launcher, before the first tick.
    ///
    /// # Errors
    /// [`BusError::NoRoom`], [`BusError::Io`].
    pub fn keep(domain: &Domain, senders: usize, restarts: usize) -> Result<Self, BusError> {
        let path = Path::new(SHARED_MEMORY).join(format!("{}spare", domain.prefix()));
        let mut options = File::options();
        let file = options.write(true).create_new(true).mode(0o600).open(&path);
        let file = file.map_err(BusError::io("create", &path))?;
        // The greater buffers of a process that sends for several drones.
        let frames = (uplink_buffer(senders) - uplink_buffer(1)) * UPLINK_FRAMES;
        let share = PORTS_BYTES + (frames * size_of::<WireFrame>()) as u64;
        let spare = Self { file, path, bytes: JOIN_BYTES + share * restarts as u64 };
        spare.take(spare.bytes)?;
        Ok(spare)
    }

    /// Gives the space to a process that starts now.
    ///
    /// # Errors
    /// [`BusError::Io`].
    pub fn give(&self) -> Result<(), BusError> {
        self.file.set_len(0).map_err(BusError::io("empty", &self.path))
    }

    /// Keeps what the started process has left.
    ///
    /// # Errors
    /// [`BusError::NoRoom`] if that is too little for another process, [`BusError::Io`].
    pub fn keep_rest(&self) -> Result<(), BusError> {
        let rest = self.bytes.min(free()?);
        if rest < JOIN_BYTES {
            return Err(BusError::NoRoom { needed: JOIN_BYTES, free: rest });
        }
        self.take(rest)
    }

    fn take(&self, bytes: u64) -> Result<(), BusError> {
        match retry_on_intr(|| fallocate(&self.file, FallocateFlags::empty(), 0, bytes)) {
            // A file system that cannot reserve is none in which pages can run out.
            Ok(()) | Err(Errno::OPNOTSUPP) => Ok(()),
            Err(Errno::NOSPC) => Err(BusError::NoRoom { needed: bytes, free: free()? }),
            Err(error) => Err(BusError::io("reserve", &self.path)(error)),
        }
    }
}
