//! Gives each test a working folder of its own, and starts the `skein` binary in it under a watchdog.
#![allow(dead_code, reason = "each test binary uses a part of it")]

pub(crate) mod browser;
pub(crate) mod data_page;
pub(crate) mod process;

use process::{Role, is_alive, shared_files};
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::io::Read;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A command that takes longer than this hangs.
const WATCHDOG: Duration = Duration::from_secs(120);
/// Time between two polls.
const POLL: Duration = Duration::from_millis(2);

/// A working folder with a domain that no other test shares.
pub(crate) struct Place(TempDir);

impl Place {
    pub(crate) fn new() -> Self {
        let folder = TempDir::with_prefix("sk").unwrap();
        let runtime = folder.path().join("x");
        fs::create_dir(&runtime).unwrap();
        fs::set_permissions(&runtime, fs::Permissions::from_mode(0o700)).unwrap();
        Self(folder)
    }

    /// A path in it.
    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skein"));
        command.args(args).current_dir(self.0.path()).env("XDG_RUNTIME_DIR", self.join("x")).env_remove("SKEIN_LOG");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    pub(crate) fn start(&self, args: &[&str]) -> Flight {
        let mut child = self.command(args).spawn().unwrap();
        let stdout = drain(child.stdout.take().unwrap());
        let stderr = drain(child.stderr.take().unwrap());
        Flight { child, out: self.join("out"), args: args.join(" "), stdout: Some(stdout), stderr: Some(stderr) }
    }

    /// Runs a command to its end.
    pub(crate) fn run(&self, args: &[&str]) -> Done {
        self.start(args).finish()
    }

    /// Flies a paper scenario and returns its summary.
    pub(crate) fn fly(&self, name: &str, args: &[&str]) -> Value {
        let scenario = paper(name);
        let done = self.run(&[&["run", &scenario, "--json"], args].concat());
        assert_eq!(done.code, Some(0), "{done:?}");
        done.summary()
    }

    /// Starts the flight of a paper scenario into the folder `out`.
    pub(crate) fn take_off(&self, name: &str, args: &[&str]) -> Flight {
        self.start(&[&["run", &paper(name), "--json", "--out", "out"], args].concat())
    }

    /// The runs in the domain's root: those that live, and those that were left behind.
    pub(crate) fn runs_in_domain(&self) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.join("x/skein")) else { return Vec::new() };
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name != "lock").collect()
    }

    /// The command has started nothing and made neither a domain nor a run's folder.
    pub(crate) fn assert_untouched(&self, known: &Done) {
        assert!(!self.join("x/skein").exists(), "a domain was made: {known:?}");
        assert!(!self.join("runs").exists() && !self.join("out").exists(), "a run's folder was made: {known:?}");
    }
}

/// A flight that is killed, as by a test that fails, leaves shared memory behind: it goes with the folder that names it.
impl Drop for Place {
    fn drop(&mut self) {
        let since = Instant::now();
        while !self.runs_in_domain().is_empty() && since.elapsed() < Duration::from_secs(5) {
            // The run counts as alive until the kernel has ended its last process.
            let _ = self.command(&["clean"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
            std::thread::sleep(POLL);
        }
    }
}

/// A command that has ended.
#[derive(Debug)]
pub(crate) struct Done {
    pub args: String,
    pub pid: u32,
    /// `None` if a signal ended it.
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Done {
    /// The one JSON object on stdout.
    pub(crate) fn summary(&self) -> Value {
        assert_eq!(self.stdout.lines().count(), 1, "one object, in one line: {self:?}");
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error} in {self:?}"))
    }
}

/// A running command. Dropping this kills it with all its processes.
pub(crate) struct Flight {
    child: Child,
    out: PathBuf,
    args: String,
    stdout: Option<JoinHandle<String>>,
    stderr: Option<JoinHandle<String>>,
}

impl Flight {
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Waits until all processes are ready. Returns the launcher, the world and the drones by number.
    pub(crate) fn processes(&mut self) -> Vec<Role> {
        let file = self.out.join("processes.json");
        self.wait_for(&file);
        process::read(&file)
    }

    /// Waits until a file of the run's folder exists.
    pub(crate) fn wait_for(&mut self, file: &Path) {
        let since = Instant::now();
        while !file.exists() {
            let ended = self.child.try_wait().unwrap();
            if ended.is_some() || since.elapsed() > WATCHDOG {
                let _ = self.child.kill();
                let said = self.stderr.take().map(|thread| thread.join().unwrap());
                panic!("`{}`: no {} after {:?}; {ended:?}, {said:?}", self.args, file.display(), since.elapsed());
            }
            std::thread::sleep(POLL);
        }
    }

    /// Waits until the recording has reached `t_s`. The writer's buffer delays it by some ticks.
    pub(crate) fn wait_until(&mut self, t_s: f64) {
        let (file, done) = (self.out.join("flight.spool"), self.out.join("summary.json"));
        self.wait_for(&file);
        eventually(&format!("`{}` flies to {t_s} s", self.args), || {
            done.exists() || fs::read(&file).is_ok_and(|spool| recorded_s(&spool) >= t_s)
        });
    }

    /// Waits for its end, and asserts that it has left no process and nothing in shared memory.
    pub(crate) fn finish(mut self) -> Done {
        let done = self.end();
        if let Ok(text) = fs::read(self.out.join("processes.json"))
            && done.args.contains("--out out")
        {
            for role in process::parse(&text) {
                assert!(!is_alive(role.pid), "{role:?} outlived its run: {done:?}");
            }
        }
        assert_eq!(shared_files(done.pid), Vec::<String>::new(), "left in shared memory by {done:?}");
        done
    }

    /// Waits for its end.
    pub(crate) fn end(&mut self) -> Done {
        let since = Instant::now();
        let code = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break status.code();
            }
            if since.elapsed() > WATCHDOG {
                // Its children die with it.
                let _ = (self.child.kill(), self.child.wait());
                panic!("`{}` hangs; it said {:?}", self.args, self.stderr.take().map(|thread| thread.join()));
            }
            std::thread::sleep(POLL);
        };
        let text = |thread: Option<JoinHandle<String>>| thread.map(|t| t.join().unwrap()).unwrap_or_default();
        let (stdout, stderr) = (text(self.stdout.take()), text(self.stderr.take()));
        Done { args: self.args.clone(), pid: self.pid(), code, stdout, stderr }
    }
}

impl Drop for Flight {
    fn drop(&mut self) {
        let _ = (self.child.kill(), self.child.wait());
    }
}

/// The time of the last complete record in a spool, s. A record begins with its length, its tick and its time in ns, each a
/// word of eight bytes.
fn recorded_s(spool: &[u8]) -> f64 {
    let word = |at: usize| Some(u64::from_ne_bytes(spool.get(at..at + 8)?.try_into().ok()?));
    let (mut at, mut now_ns) = (0, 0);
    while let (Some(len), Some(now)) = (word(at), word(at + 16)) {
        at += 8 + len.next_multiple_of(8) as usize;
        now_ns = if at <= spool.len() { now } else { now_ns };
    }
    now_ns as f64 / 1e9
}

fn drain(mut from: impl Read + Send + 'static) -> JoinHandle<String> {
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        from.read_to_end(&mut bytes).unwrap();
        String::from_utf8_lossy(&bytes).into_owned()
    })
}

/// Waits until a condition holds; fails with `what` if it never does.
pub(crate) fn eventually(what: &str, mut holds: impl FnMut() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(since.elapsed() < WATCHDOG, "never true: {what}");
        std::thread::sleep(POLL);
    }
}

/// Path of a scenario of the paper.
pub(crate) fn paper(name: &str) -> String {
    format!("{}/../scenarios/paper/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// A number in a summary, by its JSON pointer.
pub(crate) fn number(summary: &Value, pointer: &str) -> f64 {
    let value = summary.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("{pointer} is no number in {summary}"))
}

/// Asserts that a number differs from the expected one by at most this part of it.
pub(crate) fn assert_near(what: &str, found: f64, wanted: f64, part: f64) {
    assert!((found - wanted).abs() <= wanted * part, "{what}: {found}, wanted {wanted} within {} %", part * 100.0);
}

/// Reads a JSON file.
pub(crate) fn json(path: impl AsRef<Path>) -> Value {
    let path = path.as_ref();
    let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_slice(&bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The faults in events.jsonl of a run's folder.
pub(crate) fn faults(folder: &Path) -> Vec<Value> {
    let text = fs::read_to_string(folder.join("events.jsonl")).unwrap();
    let events = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    events.filter(|event| event["event"] == "fault").collect()
}

/// Names in a folder.
pub(crate) fn names(folder: impl AsRef<Path>) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| lossy(&entry.unwrap().file_name())).collect();
    names.sort();
    names
}

fn lossy(name: &OsStr) -> String {
    name.to_string_lossy().into_owned()
}
