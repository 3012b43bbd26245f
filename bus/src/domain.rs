//! Where a run keeps its shared files: a folder, a lock that the launcher holds, and a prefix of its own in shared memory.

use crate::error::BusError;
use crate::home_file::HomeFile;
use crate::run_tag::RunTag;
use crate::shared_memory::{SHARED_MEMORY, shared_files};
use crate::strays::Strays;
use iceoryx2::prelude::{Config, FileName, Path as IoxPath, SemanticString};
use rustix::fs::{FlockOperation, flock};
use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io::ErrorKind;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// File that is locked: in the root while runs are made or removed, in a run's folder while its launcher is alive.
const LOCK: &str = "lock";
/// Maximum number of attempts to make the root, which another process may remove at any time.
const MAX_TRIES: u32 = 100;
/// Maximum length of the path of a run's folder, bytes: iceoryx2 appends up to 140 bytes and allows 255.
const MAX_FOLDER: usize = 112;
/// Maximum length of a label, bytes; the rest is cut.
const MAX_LABEL: usize = 24;

/// The domain of a run: a folder, and a prefix in shared memory. No other run sees its services.
#[derive(Debug)]
pub struct Domain {
    path: PathBuf,
    prefix: String,
    config: Config,
    /// Held by the launcher as long as it is alive; the system releases it however the launcher ends.
    lock: Option<File>,
    /// In the launcher.
    _home: Option<HomeFile>,
}

/// What [`clean`] removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaned {
    /// Dead runs of which a folder or a file was left.
    pub runs: usize,
    /// Their files in shared memory.
    pub files: usize,
}

/// The folder of all runs of this user: `$XDG_RUNTIME_DIR/skein`, or `/dev/shm/skein-<uid>` if that variable is not set.
/// It has mode 0700, belongs to this user, and exists while at least one run does. It is in memory because a run makes a
/// dozen files per drone; on a disk, they would dominate the time of a start.
#[must_use]
pub fn root() -> PathBuf {
    let uid = rustix::process::geteuid().as_raw();
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|dir| dir.is_absolute());
    let own = |dir: &PathBuf| fs::metadata(dir).is_ok_and(|meta| meta.is_dir() && meta.uid() == uid);
    match runtime.filter(own) {
        Some(dir) => dir.join("skein"),
        None => Path::new(SHARED_MEMORY).join(format!("skein-{uid}")),
    }
}

/// Removes what dead runs of this user left behind, and nothing else: their folders with their files in shared memory, and files of
/// runs whose folder is gone, if no process uses one of them. Safe while other runs fly and other processes clean.
///
/// # Errors
/// [`BusError::Io`], [`BusError::Folder`].
pub fn clean() -> Result<Cleaned, BusError> {
    let cleaned = clean_in(&root())?;
    let (runs, files) = Strays::find()?.remove()?;
    Ok(Cleaned { runs: cleaned.runs + runs, files: cleaned.files + files })
}

/// As [`clean`], with another root, and only what has a folder there.
///
/// # Errors
/// [`BusError::Io`], [`BusError::Folder`].
pub fn clean_in(root: &Path) -> Result<Cleaned, BusError> {
    let guard = lock_root(root)?;
    let mut cleaned = Cleaned::default();
    for (path, prefix) in runs(root)? {
        // The lock is held until the folder is gone. A run without a lock file died before it had one: a launcher holds the
        // root's lock, which this process holds now, until its run has a lock file.
        let Some(_lock) = take_lock(&path.join(LOCK))? else { continue };
        match remove_run(&path, &prefix) {
            Ok(files) => {
                cleaned.files += files;
                cleaned.runs += 1;
            }
            // A process that was just started outlives its launcher for a moment and makes files. The next cleaning removes them.
            Err(BusError::Io { source, .. }) if source.kind() == ErrorKind::DirectoryNotEmpty => {}
            Err(error) => return Err(error),
        }
    }
    leave(root, guard);
    Ok(cleaned)
}

/// Folders of this user's living runs, for [`Domain::join`].
///
/// # Errors
/// [`BusError::Io`], [`BusError::Folder`].
pub fn living() -> Result<Vec<PathBuf>, BusError> {
    living_in(&root())
}

/// As [`living`], with another root.
///
/// # Errors
/// [`BusError::Io`], [`BusError::Folder`].
pub fn living_in(root: &Path) -> Result<Vec<PathBuf>, BusError> {
    let guard = lock_root(root)?;
    let mut found = Vec::new();
    for (path, _) in runs(root)? {
        if take_lock(&path.join(LOCK))?.is_none() {
            found.push(path);
        }
    }
    leave(root, guard);
    Ok(found)
}

impl Domain {
    /// Makes a folder for a new run and locks it. For the launcher. `label` becomes part of the folder's name, for people.
    ///
    /// # Errors
    /// [`BusError::Io`], [`BusError::Folder`].
    pub fn create(label: &str) -> Result<Self, BusError> {
        Self::create_in(&root(), label)
    }

    /// As [`Domain::create`], with another root.
    ///
    /// # Errors
    /// [`BusError::Io`], [`BusError::Folder`].
    pub fn create_in(root: &Path, label: &str) -> Result<Self, BusError> {
        let guard = lock_root(root)?;
        let label: String = label.chars().filter(|c| c.is_ascii_alphanumeric() || *c == '-').take(MAX_LABEL).collect();
        let tag = RunTag::unique();
        let path = root.join(format!("{label}.{}", tag.text()));
        let (prefix, config) = settings(&path)?;
        DirBuilder::new().mode(0o700).create(&path).map_err(BusError::io("create", &path))?;
        let lock = open_lock(&path.join(LOCK))?;
        flock(&lock, FlockOperation::NonBlockingLockExclusive).map_err(BusError::io("lock", &path))?;
        let mut domain = Self { path, prefix, config, lock: Some(lock), _home: None };
        // If this fails, the folder is removed.
        drop(guard);
        domain._home = Some(HomeFile::create(&tag, &domain.path)?);
        Ok(domain)
    }

    /// Joins the run in this folder. For every process but the launcher. Dropping it removes nothing.
    ///
    /// # Errors
    /// [`BusError::Folder`] if it is not a run's folder of this user.
    pub fn join(path: &Path) -> Result<Self, BusError> {
        check_private(path)?;
        let (prefix, config) = settings(path)?;
        Ok(Self { path: path.to_owned(), prefix, config, lock: None, _home: None })
    }

    /// The run's folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Prefix of the run's names in shared memory.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Takes from other users every right to the run's files in shared memory.
    pub(crate) fn make_private(&self) -> Result<(), BusError> {
        for path in shared_files(&self.prefix)? {
            let meta = fs::symlink_metadata(&path).map_err(BusError::io("look at", &path))?;
            if meta.is_file() && meta.mode() & 0o077 != 0 {
                let private = Permissions::from_mode(meta.mode() & 0o700);
                fs::set_permissions(&path, private).map_err(BusError::io("change the mode of", &path))?;
            }
        }
        Ok(())
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }
}

impl Drop for Domain {
    /// In the launcher: removes the run, whose children are dead by then. The lock is released last.
    fn drop(&mut self) {
        if self.lock.is_none() {
            return;
        }
        // Without the root's lock, this and a cleaning would fail over files that the other has removed.
        let root = self.path.parent().unwrap_or(Path::new("/"));
        let guard = lock_root(root);
        if let Err(error) = remove_run(&self.path, &self.prefix) {
            tracing::warn!(%error, "the run's shared files are left for the next cleaning");
        }
        if let Ok(guard) = guard {
            leave(root, guard);
        }
    }
}

/// The tag in a run folder's name; `None` for a folder that is not a run's.
fn tag_of(path: &Path) -> Option<RunTag> {
    let (_, tag) = path.file_name()?.to_str()?.rsplit_once('.')?;
    RunTag::parse(tag)
}

/// A run's prefix in shared memory and its iceoryx2 configuration, from its folder.
fn settings(path: &Path) -> Result<(String, Config), BusError> {
    let folder = |why: &str| BusError::Folder { path: path.to_owned(), why: why.to_owned() };
    let bytes = path.as_os_str().as_bytes();
    if bytes.len() > MAX_FOLDER {
        let why = format!("its path is longer than {MAX_FOLDER} bytes, set XDG_RUNTIME_DIR to a shorter one");
        return Err(folder(&why));
    }
    let tag = tag_of(path).ok_or_else(|| folder("its name is not a run's, `<label>.<pid>_<time>_<count>`"))?;
    let prefix = tag.prefix();
    let mut config = Config::default();
    let global = &mut config.global;
    global.prefix =
        FileName::new(prefix.as_bytes()).map_err(|_| folder("its name has characters that are not plain"))?;
    global.set_root_path(&IoxPath::new(bytes).map_err(|_| folder("its path has characters that are not plain"))?);
    // These scans would make the start quadratic in the number of drones; `clean_dead_nodes` scans once, before a restart.
    global.service.cleanup_dead_nodes_on_open = false;
    global.node.cleanup_dead_nodes_on_creation = false;
    global.node.cleanup_dead_nodes_on_destruction = false;
    // A thousand processes that start on two cores delay each other by more than the default of one second.
    global.creation_timeout = Duration::from_secs(10);
    Ok((prefix, config))
}

fn private_folder(path: &Path) -> Result<(), BusError> {
    match DirBuilder::new().mode(0o700).create(path) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => Err(BusError::io("create", path)(error)),
        _ => check_private(path),
    }
}

/// Checks that the path is a folder (no link) of this user that other users may not enter.
fn check_private(path: &Path) -> Result<(), BusError> {
    let meta = fs::symlink_metadata(path).map_err(BusError::io("look at", path))?;
    let uid = rustix::process::geteuid().as_raw();
    let why = if !meta.is_dir() {
        "it is not a folder".to_owned()
    } else if meta.uid() != uid {
        format!("user {} owns it, not user {uid}", meta.uid())
    } else if meta.mode() & 0o077 != 0 {
        format!("its mode is {:o}, expected 700: others may enter it", meta.mode() & 0o777)
    } else {
        return Ok(());
    };
    Err(BusError::Folder { path: path.to_owned(), why })
}

/// Keeps a run's files from being removed for as long as the result lives.
///
/// # Errors
/// [`BusError::Folder`] if the run has ended, [`BusError::Io`].
pub(crate) fn hold(path: &Path) -> Result<File, BusError> {
    let root = path.parent().unwrap_or(Path::new("/"));
    let guard = lock_root(root)?;
    if path.join(LOCK).exists() {
        return Ok(guard);
    }
    leave(root, guard);
    Err(BusError::Folder { path: path.to_owned(), why: "the run has ended".to_owned() })
}

fn open_lock(path: &Path) -> Result<File, BusError> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(false).mode(0o600).open(path).map_err(BusError::io("open", path))
}

/// Waits for, and holds, the right to make or remove runs. Makes the root if need be.
fn lock_root(root: &Path) -> Result<File, BusError> {
    let path = root.join(LOCK);
    let mut tries = 0..MAX_TRIES;
    loop {
        let lock = match private_folder(root).and_then(|()| open_lock(&path)) {
            Err(BusError::Io { source, .. }) if source.kind() == ErrorKind::NotFound && tries.next().is_some() => {
                continue;
            }
            other => other?,
        };
        flock(&lock, FlockOperation::LockExclusive).map_err(BusError::io("lock", &path))?;
        let inode = |meta: std::io::Result<fs::Metadata>| meta.map(|meta| (meta.dev(), meta.ino())).ok();
        let held = inode(lock.metadata());
        if held.is_some() && held == inode(fs::symlink_metadata(&path)) {
            return Ok(lock);
        }
    }
}

/// Removes the root if it holds nothing but its lock, so that nothing stays in memory, and releases the lock. A process
/// that waits for the lock finds that the root is gone and makes a new one.
fn leave(root: &Path, lock: File) {
    let only_lock = |entries: fs::ReadDir| entries.flatten().all(|entry| entry.file_name() == LOCK);
    if fs::read_dir(root).is_ok_and(only_lock) {
        // If this fails, the files that stay do no harm.
        let _ = fs::remove_file(root.join(LOCK)).and_then(|()| fs::remove_dir(root));
    }
    drop(lock);
}

/// The lock of a dead run; `None` if its launcher is alive. The caller holds the root's lock.
fn take_lock(path: &Path) -> Result<Option<File>, BusError> {
    let lock = open_lock(path)?;
    match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(Some(lock)),
        Err(rustix::io::Errno::WOULDBLOCK) => Ok(None),
        Err(error) => Err(BusError::io("lock", path)(error)),
    }
}

/// The folders of all runs, and their prefixes.
fn runs(root: &Path) -> Result<Vec<(PathBuf, String)>, BusError> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root).map_err(BusError::io("list", root))? {
        let entry = entry.map_err(BusError::io("list", root))?;
        let path = entry.path();
        if entry.file_type().is_ok_and(|kind| kind.is_dir())
            && let Some(tag) = tag_of(&path)
        {
            found.push((path, tag.prefix()));
        }
    }
    found.sort();
    Ok(found)
}

/// Removes a run's files in shared memory, then its folder. If this is interrupted, the folder still tells the prefix.
fn remove_run(path: &Path, prefix: &str) -> Result<usize, BusError> {
    let mut files = shared_files(prefix)?;
    // Its home goes last: without it, what is left is nobody's.
    files.sort_by_key(|file| *file == HomeFile::path(prefix));
    for file in &files {
        gone(fs::remove_file(file)).map_err(BusError::io("remove", file))?;
    }
    gone(fs::remove_dir_all(path)).map_err(BusError::io("remove", path))?;
    Ok(files.len())
}

/// Success also if the file was already gone.
fn gone(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        other => other,
    }
}
