//! Starts hosts and runs in a working folder of their own.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// What takes longer than this hangs.
pub(crate) const WATCHDOG: Duration = Duration::from_secs(120);

/// The program under test.
fn hosts_program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_skein-hosts"))
}

/// An application with the built-in pilots and `thinker`.
pub(crate) fn swarm() -> PathBuf {
    let path = hosts_program().with_file_name("examples").join("swarm");
    assert!(
        path.is_file(),
        "expected {}: `cargo test -p skein-hosts` and `cargo test --workspace` build it",
        path.display()
    );
    path
}

/// A working folder with a domain that no other test shares.
pub(crate) struct Place(TempDir);

impl Place {
    pub(crate) fn new() -> Self {
        let folder = TempDir::with_prefix("sk").unwrap();
        let runtime = folder.path().join("x");
        std::fs::create_dir(&runtime).unwrap();
        std::fs::set_permissions(&runtime, std::fs::Permissions::from_mode(0o700)).unwrap();
        Self(folder)
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Puts an executable script into this place's search path.
    pub(crate) fn script(&self, name: &str, text: &str) {
        let folder = self.path().join("bin");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Writes a scenario: eight drones past an obstacle as in S2, and these keys.
    pub(crate) fn scenario(&self, more: &str) -> String {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let text = std::fs::read_to_string(root.join("scenarios/paper/s2-right.toml")).unwrap();
        let path = self.path().join("mission.toml");
        std::fs::write(&path, format!("{text}\n{more}\n")).unwrap();
        path.to_string_lossy().into_owned()
    }

    pub(crate) fn command(&self, args: &[&str]) -> Command {
        self.command_by(&[], args)
    }

    fn command_by(&self, by: &[&str], args: &[&str]) -> Command {
        let folder = hosts_program().parent().unwrap();
        let path =
            format!("{}:{}:{}", folder.display(), self.path().join("bin").display(), std::env::var("PATH").unwrap());
        let program = swarm();
        let words = [by, &[program.to_str().unwrap()]].concat();
        let mut command = Command::new(words[0]);
        command
            .args(&words[1..])
            .args(args)
            .current_dir(self.path())
            .env("XDG_RUNTIME_DIR", self.path().join("x"))
            .env("PATH", path);
        command.env_remove("SKEIN_LOG").stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Starts a host and waits until it offers its drones.
    pub(crate) fn host(&self, name: &str, endpoint: &str, more: &[&str]) -> Host {
        self.host_by(&[], name, endpoint, more)
    }

    /// As [`Place::host`], by a program that becomes the host.
    pub(crate) fn host_by(&self, by: &[&str], name: &str, endpoint: &str, more: &[&str]) -> Host {
        let args = [&["host", "--name", name, "--listen", endpoint], more].concat();
        Self::offer(self.command_by(by, &args), name, endpoint)
    }

    /// A host that flies drones with another program.
    pub(crate) fn host_of(&self, program: &str, name: &str, endpoint: &str) -> Host {
        let mut command = Command::new(hosts_program());
        command.args(["host", "--name", name, "--listen", endpoint, "--program", &format!("[{program:?}]")]);
        command.env("XDG_RUNTIME_DIR", self.path().join("x")).stdout(Stdio::piped());
        Self::offer(command, name, endpoint)
    }

    /// Shares this place's swarms, and waits until they can be looked at.
    pub(crate) fn share(&self, endpoint: &str, more: &[&str]) -> Host {
        let command = self.command(&[&["share", "--listen", endpoint], more].concat());
        Self::start(command, "shares the swarms of this machine", endpoint)
    }

    fn offer(command: Command, name: &str, endpoint: &str) -> Host {
        Self::start(command, &format!("host {name} offers"), endpoint)
    }

    /// Starts what serves at an endpoint, and waits until it says so.
    fn start(mut command: Command, says: &str, endpoint: &str) -> Host {
        let mut child = command.stderr(Stdio::inherit()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert!(line.contains(says), "{line:?}");
        Host { child, endpoint: endpoint.to_owned() }
    }

    /// Two hosts, `a` and `b`, on this machine, and the endpoints of both.
    pub(crate) fn two_hosts(&self) -> ([Host; 2], String) {
        let hosts = ["a", "b"].map(|name| self.host(name, &free_endpoint(), &["--drones", "8"]));
        let endpoints = format!("{},{}", hosts[0].endpoint, hosts[1].endpoint);
        (hosts, endpoints)
    }

    /// Flies a mission to its end and returns its summary.
    pub(crate) fn fly(&self, scenario: &str, args: &[&str]) -> Value {
        let done = self.run(&[&["run", scenario, "--json", "--no-record"], args].concat());
        assert!(matches!(done.status.code(), Some(0 | 1)), "{done:?}");
        serde_json::from_slice(&done.stdout).unwrap_or_else(|error| panic!("{error}: {done:?}"))
    }

    /// Runs a command to its end.
    pub(crate) fn run(&self, args: &[&str]) -> Output {
        let mut child = self.command(args).spawn().unwrap();
        let (mut out, mut err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        let read = |from: &mut dyn Read| {
            let mut bytes = Vec::new();
            from.read_to_end(&mut bytes).unwrap();
            bytes
        };
        let reader = std::thread::spawn(move || read(&mut err));
        let stdout = read(&mut out);
        let stderr = reader.join().unwrap();
        Output { status: wait(&mut child), stdout, stderr }
    }
}

/// A host that is killed leaves shared memory behind: it goes with the folder that names it.
impl Drop for Place {
    fn drop(&mut self) {
        let cleaned = self.command(&["clean"]).stdout(Stdio::null()).stderr(Stdio::null()).status();
        assert!(std::thread::panicking() || cleaned.is_ok_and(|status| status.success()), "`clean` failed");
    }
}

/// A host or a share. Dropping it ends it.
pub(crate) struct Host {
    child: Child,
    pub(crate) endpoint: String,
}

impl Host {
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Kills it at once, as when its machine fails.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// The ids of the processes that it has started and that live.
    pub(crate) fn drones(&self) -> Vec<u32> {
        children_of(self.pid())
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        let _ = (self.child.kill(), self.child.wait());
    }
}

/// The processes whose parent this is, zombies left out.
pub(crate) fn children_of(parent: u32) -> Vec<u32> {
    let all = std::fs::read_dir("/proc").unwrap().filter_map(|entry| entry.unwrap().file_name().to_str()?.parse().ok());
    all.filter(|&pid: &u32| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
        let behind = stat.rsplit(')').next().unwrap_or_default();
        let mut words = behind.split_whitespace();
        let state = words.next();
        state.is_some_and(|state| state != "Z") && words.next() == Some(&parent.to_string())
    })
    .collect()
}

/// Waits until something holds.
pub(crate) fn wait_until(what: &str, limit: Duration, mut holds: impl FnMut() -> bool) {
    let since = Instant::now();
    while !holds() {
        assert!(since.elapsed() < limit, "{what}: not after {limit:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Waits for a process to end.
pub(crate) fn wait(child: &mut Child) -> std::process::ExitStatus {
    let since = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if since.elapsed() > WATCHDOG {
            child.kill().unwrap();
            panic!("the process hangs");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// An endpoint on this machine that no one uses.
pub(crate) fn free_endpoint() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    format!("tcp/127.0.0.1:{port}")
}
