//! Room on the disk for summary.json, taken before the flight.

use crate::error::ReportError;
use crate::files::SUMMARY;
use crate::json_text::json;
use crate::summary::Summary;
use crate::work_folder::WorkFolder;
use rustix::fs::{FallocateFlags, fallocate};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

/// Room on the disk for summary.json. A flight may fill the disk with its record; its summary is written nevertheless.
#[derive(Debug)]
pub struct ReservedSummary {
    folder: WorkFolder,
    file: File,
}

impl ReservedSummary {
    /// Takes `room` bytes.
    pub(crate) fn new(folder: &WorkFolder, room: u64) -> Result<Self, ReportError> {
        let mut file = folder.begin(SUMMARY)?;
        let path = folder.path().join(SUMMARY);
        take_room(&mut file, room).map_err(ReportError::io(&path))?;
        Ok(Self { folder: folder.clone(), file })
    }

    /// Writes summary.json into the room.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn write(mut self, summary: &Summary) -> Result<(), ReportError> {
        let path = self.folder.path().join(SUMMARY);
        let written = json(summary).and_then(|bytes| {
            self.file.seek(SeekFrom::Start(0))?;
            self.file.write_all(&bytes)?;
            self.file.set_len(bytes.len() as u64)
        });
        written.map_err(ReportError::io(&path))?;
        self.folder.keep(SUMMARY)
    }
}

/// Makes the file system assign room to a file. One that cannot is made to by zeros.
fn take_room(file: &mut File, room: u64) -> io::Result<()> {
    use rustix::io::Errno;
    match fallocate(&*file, FallocateFlags::empty(), 0, room) {
        Ok(()) => Ok(()),
        Err(Errno::OPNOTSUPP | Errno::NOSYS) => io::copy(&mut io::Read::take(io::repeat(0), room), file).map(|_| ()),
        Err(error) => Err(error.into()),
    }
}
