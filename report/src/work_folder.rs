//! A folder whose files this program writes. Files of other users are never overwritten through it.

use crate::error::ReportError;
use rustix::fs::{AtFlags, Dir, FlockOperation, Mode, OFlags, flock, fstat, mkdirat, open, openat, renameat, unlinkat};
use rustix::io::Errno;
use std::ffi::CStr;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Mode of new files before the umask.
const FILE_MODE: Mode = Mode::from_raw_mode(0o666);
/// Mode of new folders before the umask.
const FOLDER_MODE: Mode = Mode::from_raw_mode(0o777);
/// Flags that open a folder.
const FOLDER: OFlags = OFlags::RDONLY.union(OFlags::DIRECTORY).union(OFlags::CLOEXEC);

/// A folder that is open. Files are found through its descriptor, so that it does not matter if its path changes.
///
/// Any user may read. The first write claims the folder: it must belong to this user, and it is locked until the last copy
/// of this value is dropped, or the process ends in whatever way. A new file replaces what had its name and is never
/// written through a link. A file system that cannot lock folders, such as some network file systems, gives no lock.
#[derive(Clone, Debug)]
pub struct WorkFolder {
    path: PathBuf,
    folder: Arc<OwnedFd>,
}

impl WorkFolder {
    /// Opens a folder that exists.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn open(path: &Path) -> Result<Self, ReportError> {
        Self::open_with(path, FOLDER)
    }

    /// Makes a folder with its parents, and claims it. Returns whether it is new.
    ///
    /// # Errors
    /// [`ReportError::Io`]; those of [`WorkFolder::claim`].
    pub fn make(path: &Path) -> Result<(Self, bool), ReportError> {
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            fs::create_dir_all(parent).map_err(ReportError::io(parent))?;
        }
        let (folder, new) = match fs::create_dir(path) {
            Ok(()) => (Self::open_with(path, FOLDER | OFlags::NOFOLLOW)?, true),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                check_link(path)?;
                (Self::open(path)?, false)
            }
            Err(error) => return Err(ReportError::io(path)(error)),
        };
        folder.claim()?;
        Ok((folder, new))
    }

    /// Path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes sure that the folder belongs to this user, and that no other process writes to it.
    ///
    /// # Errors
    /// [`ReportError::Foreign`], [`ReportError::InUse`], [`ReportError::Io`].
    pub fn claim(&self) -> Result<(), ReportError> {
        let owner = fstat(&self.folder).map_err(|error| self.error(error))?.st_uid;
        if owner != rustix::process::geteuid().as_raw() {
            return Err(ReportError::Foreign { path: self.path.clone(), owner });
        }
        match flock(&self.folder, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK) => Err(ReportError::InUse(self.path.clone())),
            // The others: this file system has no locks for folders.
            Ok(()) | Err(_) => Ok(()),
        }
    }

    /// Makes a new, empty file, which may be read as well. It replaces a file of this name.
    ///
    /// # Errors
    /// [`ReportError::Io`]; those of [`WorkFolder::claim`].
    pub fn create(&self, name: &str) -> Result<File, ReportError> {
        self.remove(name)?;
        let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
        openat(&self.folder, name, flags, FILE_MODE).map(File::from).map_err(|error| self.file_error(name, error))
    }

    /// Opens a file for reading and appending, and makes it if it does not exist. It must be a regular file and no link.
    ///
    /// # Errors
    /// [`ReportError::Io`]; those of [`WorkFolder::claim`].
    pub fn append(&self, name: &str) -> Result<File, ReportError> {
        self.claim()?;
        let flags =
            OFlags::RDWR | OFlags::APPEND | OFlags::CREATE | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        self.regular(name, flags)
    }

    /// Makes a new file under a provisional name. [`WorkFolder::keep`] gives it its own name once it is complete.
    ///
    /// # Errors
    /// As [`WorkFolder::create`].
    pub fn begin(&self, name: &str) -> Result<File, ReportError> {
        self.create(&part(name))
    }

    /// Gives a file of [`WorkFolder::begin`] its own name. A reader finds the whole file, or the one before it, or none.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn keep(&self, name: &str) -> Result<(), ReportError> {
        renameat(&self.folder, part(name), &self.folder, name).map_err(|error| self.file_error(name, error))
    }

    /// Removes a file of [`WorkFolder::begin`] that cannot be completed.
    pub fn give_up(&self, name: &str) {
        // If this fails, too, the next file of this name replaces it.
        let _ = unlinkat(&self.folder, part(name), AtFlags::empty());
    }

    /// Writes a whole file. A reader finds the whole file, or the one before it, or none.
    ///
    /// # Errors
    /// As [`WorkFolder::create`].
    pub fn write(&self, name: &str, content: &[u8]) -> Result<(), ReportError> {
        let written = self.begin(name)?.write_all(content).map_err(ReportError::io(&self.path.join(name)));
        if written.is_err() {
            self.give_up(name);
        }
        written.and_then(|()| self.keep(name))
    }

    /// Removes a file, if there is one.
    ///
    /// # Errors
    /// [`ReportError::Io`]; those of [`WorkFolder::claim`].
    pub fn remove(&self, name: &str) -> Result<(), ReportError> {
        self.claim()?;
        match unlinkat(&self.folder, name, AtFlags::empty()) {
            Ok(()) | Err(Errno::NOENT) => Ok(()),
            Err(error) => Err(self.file_error(name, error)),
        }
    }

    /// Opens a file for reading. Only a regular file is opened: reading of anything else might never end.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn read(&self, name: &str) -> Result<File, ReportError> {
        self.regular(name, OFlags::RDONLY | OFlags::NONBLOCK | OFlags::CLOEXEC)
    }

    /// The content of a file of at most `most` bytes.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn read_whole(&self, name: &str, most: u64) -> Result<Vec<u8>, ReportError> {
        let mut bytes = Vec::new();
        let read = self.read(name)?.take(most + 1).read_to_end(&mut bytes);
        let checked = read.and_then(|_| match bytes.len() as u64 > most {
            true => Err(io::Error::new(ErrorKind::FileTooLarge, format!("expected at most {most} bytes"))),
            false => Ok(bytes),
        });
        checked.map_err(ReportError::io(&self.path.join(name)))
    }

    /// A folder in this one, which is made if it does not exist.
    ///
    /// # Errors
    /// [`ReportError::Io`]; those of [`WorkFolder::claim`].
    pub fn subfolder(&self, name: &str) -> Result<Self, ReportError> {
        self.claim()?;
        match mkdirat(&self.folder, name, FOLDER_MODE) {
            Ok(()) | Err(Errno::EXIST) => {}
            Err(error) => return Err(self.file_error(name, error)),
        }
        let opened = openat(&self.folder, name, FOLDER | OFlags::NOFOLLOW, Mode::empty());
        let folder = Arc::new(opened.map_err(|error| self.file_error(name, error))?);
        Ok(Self { path: self.path.join(name), folder })
    }

    /// The names in the folder.
    ///
    /// # Errors
    /// [`ReportError::Io`].
    pub fn names(&self) -> Result<Vec<String>, ReportError> {
        let mut names = Vec::new();
        for entry in Dir::read_from(&self.folder).map_err(|error| self.error(error))? {
            let name = entry.map_err(|error| self.error(error))?.file_name().to_owned();
            if !is_own_or_parent(&name) {
                names.push(name.to_string_lossy().into_owned());
            }
        }
        Ok(names)
    }

    fn open_with(path: &Path, flags: OFlags) -> Result<Self, ReportError> {
        let opened = open(path, flags, Mode::empty()).map_err(|error| ReportError::io(path)(error.into()))?;
        Ok(Self { path: path.to_owned(), folder: Arc::new(opened) })
    }

    /// Opens a file if it is a regular one.
    fn regular(&self, name: &str, flags: OFlags) -> Result<File, ReportError> {
        let opened = openat(&self.folder, name, flags, FILE_MODE).map(File::from).map_err(io::Error::from);
        let regular = opened.and_then(|file| match file.metadata()?.is_file() {
            true => Ok(file),
            false => Err(io::Error::new(ErrorKind::InvalidInput, "expected a regular file")),
        });
        regular.map_err(ReportError::io(&self.path.join(name)))
    }

    fn error(&self, error: Errno) -> ReportError {
        ReportError::io(&self.path)(error.into())
    }

    fn file_error(&self, name: &str, error: Errno) -> ReportError {
        ReportError::io(&self.path.join(name))(error.into())
    }
}

/// The provisional name of a file.
pub(crate) fn part(name: &str) -> String {
    format!(".{name}.part")
}

fn is_own_or_parent(name: &CStr) -> bool {
    name == c"." || name == c".."
}

/// Refuses a symbolic link of another user: it may lead to any folder of this one.
fn check_link(path: &Path) -> Result<(), ReportError> {
    let meta = fs::symlink_metadata(path).map_err(ReportError::io(path))?;
    if meta.is_symlink() && meta.uid() != rustix::process::geteuid().as_raw() {
        return Err(ReportError::Foreign { path: path.to_owned(), owner: meta.uid() });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn no_file_is_written_through_a_link() {
        let root = tempfile::tempdir().unwrap();
        let mine = root.path().join("mine.txt");
        fs::write(&mine, "mine").unwrap();
        let path = root.path().join("run");
        let (folder, new) = WorkFolder::make(&path).unwrap();
        assert!(new);
        for name in ["a", ".a.part", "b"] {
            symlink(&mine, path.join(name)).unwrap();
        }
        folder.write("a", b"ours").unwrap();
        folder.create("b").unwrap().write_all(b"ours").unwrap();
        symlink(root.path(), path.join("plots")).unwrap();
        assert!(folder.subfolder("plots").is_err());
        assert_eq!(fs::read_to_string(&mine).unwrap(), "mine");
        for name in ["a", "b"] {
            assert_eq!(fs::read_to_string(path.join(name)).unwrap(), "ours");
            assert!(!fs::symlink_metadata(path.join(name)).unwrap().is_symlink());
        }
        let mut names = folder.names().unwrap();
        names.sort();
        assert_eq!(names, ["a", "b", "plots"]);
    }

    #[test]
    fn a_folder_has_one_writer_at_a_time() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("deep/run");
        let (first, _) = WorkFolder::make(&path).unwrap();
        assert!(matches!(WorkFolder::make(&path), Err(ReportError::InUse(_))));
        let reader = WorkFolder::open(&path).unwrap();
        assert!(matches!(reader.write("a", b""), Err(ReportError::InUse(_))));
        drop(first);
        reader.write("a", b"").unwrap();
        assert!(matches!(WorkFolder::make(&path), Err(ReportError::InUse(_))));
    }

    #[test]
    fn only_regular_files_of_a_moderate_size_are_read() {
        let root = tempfile::tempdir().unwrap();
        let folder = WorkFolder::open(root.path()).unwrap();
        rustix::fs::mkfifoat(rustix::fs::CWD, root.path().join("fifo"), Mode::from_raw_mode(0o600)).unwrap();
        symlink("/dev/zero", root.path().join("zero")).unwrap();
        fs::write(root.path().join("big"), [0; 9]).unwrap();
        for name in ["fifo", "zero", "big", "missing"] {
            let error = folder.read_whole(name, 8).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        assert_eq!(folder.read_whole("big", 9).unwrap().len(), 9);
    }
}
