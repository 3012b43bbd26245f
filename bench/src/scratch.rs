//! A temporary folder.

use crate::error::BenchError;
use std::path::{Path, PathBuf};

/// A temporary folder of this process. It is removed when this is dropped.
pub(crate) struct ScratchFolder(PathBuf);

impl ScratchFolder {
    /// Makes the folder.
    pub(crate) fn new() -> Result<Self, BenchError> {
        let folder = std::env::temp_dir().join(format!("skein-bench-{}", std::process::id()));
        std::fs::create_dir_all(&folder).map_err(BenchError::file(&folder))?;
        Ok(Self(folder))
    }

    /// Its path.
    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // What cannot be removed lies where temporary files are cleaned anyway.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
