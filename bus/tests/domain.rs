//! Tests of runs that exist side by side, and of the clean-up after dead runs.
#![allow(clippy::unwrap_used)] // the lint exempts test functions, but not their helpers

use skein_bus::domain::{clean_in, living_in};
use skein_bus::{BusError, Cleaned, Domain, Services};
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

const CHILD_ROOT: &str = "SKEIN_BUS_TEST_ROOT";

fn root() -> tempfile::TempDir {
    tempfile::Builder::new().permissions(fs::Permissions::from_mode(0o700)).tempdir().unwrap()
}

fn shared_files(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(prefix)).collect()
}

/// Not a test by itself: the role of a launcher that the parent test kills.
#[test]
fn child_launcher() {
    let Some(root) = std::env::var_os(CHILD_ROOT) else { return };
    let domain = Domain::create_in(Path::new(&root), "child").unwrap();
    let _services = Services::create(&domain, 2, 1, "launcher").unwrap();
    fs::write(domain.path().join("up"), "").unwrap();
    thread::sleep(Duration::from_secs(60));
}

/// Starts a launcher in a child process and kills it. Returns the folder of its run.
fn killed_run(root: &Path) -> PathBuf {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "child_launcher"])
        .env(CHILD_ROOT, root)
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let up = || living_in(root).unwrap().into_iter().find(|run| run.join("up").exists());
    let run = (0..4000).find_map(|_| {
        thread::sleep(Duration::from_millis(5));
        up()
    });
    let run = run.expect("the child did not create its run within 20 s");
    assert_eq!(clean_in(root).unwrap(), Cleaned::default(), "cleaning touched a living run");
    child.kill().unwrap();
    child.wait().unwrap();
    run
}

#[test]
fn a_killed_run_is_cleaned_and_a_living_one_is_not() {
    let root = root();
    let dead = killed_run(root.path());
    let prefix = Domain::join(&dead).unwrap().prefix().to_owned();
    assert!(!shared_files(&prefix).is_empty());

    let alive = Domain::create_in(root.path(), "alive").unwrap();
    let _services = Services::create(&alive, 2, 1, "launcher").unwrap();
    let unrelated = [root.path().join("notes.txt"), root.path().join("1_2_3")];
    fs::write(&unrelated[0], "mine").unwrap();
    fs::create_dir(&unrelated[1]).unwrap();
    let other_run_file = PathBuf::from(format!("/dev/shm/{}x", &prefix[..prefix.len() - 1]));
    fs::write(&other_run_file, "belongs to another run").unwrap();
    let before = shared_files(alive.prefix());

    let cleaned = clean_in(root.path()).unwrap();
    assert_eq!(cleaned.runs, 1);
    assert!(cleaned.files > 0);
    assert_eq!(shared_files(&prefix), [] as [PathBuf; 0]);
    assert!(!dead.exists());
    assert!(alive.path().exists() && unrelated.iter().all(|path| path.exists()) && other_run_file.exists());
    assert_eq!(shared_files(alive.prefix()), before);
    assert_eq!(clean_in(root.path()).unwrap(), Cleaned::default());
    assert_eq!(living_in(root.path()).unwrap(), [alive.path()]);
    fs::remove_file(other_run_file).unwrap();
}

#[test]
fn a_run_that_died_before_it_had_a_lock_is_cleaned() {
    let root = root();
    fs::create_dir(root.path().join("half.12_ab_0")).unwrap();
    assert_eq!(clean_in(root.path()).unwrap(), Cleaned { runs: 1, files: 0 });
}

#[test]
fn an_ended_run_leaves_nothing() {
    let root = root();
    let domain = Domain::create_in(root.path(), "../a label/with$signs").unwrap();
    assert_eq!(domain.path().parent().unwrap(), root.path());
    assert_eq!(fs::metadata(domain.path()).unwrap().permissions().mode() & 0o777, 0o700);
    let prefix = domain.prefix().to_owned();
    assert!(prefix.starts_with("skein"));
    let services = Services::create(&domain, 40, 1, "launcher").unwrap();
    assert!(!shared_files(&prefix).is_empty());
    let joined = Domain::join(domain.path()).unwrap();
    assert_eq!(joined.prefix(), prefix);
    drop(joined);
    assert!(domain.path().exists(), "a process that joined a run must not remove it");
    drop(services);
    assert!(!shared_files(&prefix).is_empty(), "iceoryx2 leaves its management file");
    let path = domain.path().to_owned();
    drop(domain);
    assert!(!path.exists());
    assert_eq!(shared_files(&prefix), [] as [PathBuf; 0]);
}

#[test]
fn runs_can_start_and_clean_at_the_same_time() {
    let root = root();
    thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..20 {
                    let domain = Domain::create_in(root.path(), "busy").unwrap();
                    clean_in(root.path()).unwrap();
                    assert!(domain.path().join("lock").exists(), "a living run was removed");
                }
            });
        }
    });
    assert_eq!(clean_in(root.path()).unwrap(), Cleaned::default());
}

#[test]
fn folders_of_other_users_and_accessible_folders_are_refused() {
    let root = root();
    let refused = |path: &Path, why: &str| {
        let error = Domain::create_in(path, "run").unwrap_err();
        assert!(matches!(error, BusError::Folder { .. }) && error.to_string().contains(why), "{error}");
    };
    let open = root.path().join("open");
    fs::create_dir(&open).unwrap();
    fs::set_permissions(&open, fs::Permissions::from_mode(0o750)).unwrap();
    refused(&open, "expected 700");
    let link = root.path().join("link");
    symlink(root.path(), &link).unwrap();
    refused(&link, "not a folder");
    let deep = root.path().join("d".repeat(100));
    fs::create_dir(&deep).unwrap();
    fs::set_permissions(&deep, fs::Permissions::from_mode(0o700)).unwrap();
    refused(&deep, "XDG_RUNTIME_DIR");
    if rustix::process::geteuid().is_root() {
        let others = root.path().join("others");
        fs::create_dir(&others).unwrap();
        std::os::unix::fs::chown(&others, Some(12345), None).unwrap();
        refused(&others, "user 12345 owns it");
    }
    let error = Domain::join(root.path()).unwrap_err();
    assert!(error.to_string().contains("not a run's"), "{error}");
    assert!(matches!(Domain::join(&root.path().join("none.1_2_3")), Err(BusError::Io { .. })));
}

#[test]
fn the_last_run_removes_the_root_and_later_runs_create_it_again() {
    let parent = root();
    let root = parent.path().join("runs");
    let fly = || {
        for i in 0..200 {
            let first = Domain::create_in(&root, "a").unwrap();
            let second = (i % 3 == 0).then(|| Domain::create_in(&root, "b").unwrap());
            assert!(first.path().is_dir());
            drop(first);
            assert!(second.is_none_or(|second| second.path().is_dir()));
        }
    };
    std::thread::scope(|scope| (0..4).for_each(|_| drop(scope.spawn(fly))));
    assert!(!root.exists(), "no run is left, but the root still exists");
    assert_eq!(clean_in(&root).unwrap().runs, 0);
    assert!(!root.exists());
    assert!(clean_in(&parent.path().join("no/such")).is_err());
}
