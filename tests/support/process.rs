//! Inspects and signals processes that a test has started.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// A line of processes.json.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Role {
    pub role: String,
    pub id: Option<u64>,
    pub pid: u32,
}

/// Reads processes.json.
pub(crate) fn read(path: &Path) -> Vec<Role> {
    parse(&std::fs::read(path).unwrap())
}

pub(crate) fn parse(text: &[u8]) -> Vec<Role> {
    let entries: Vec<Value> = serde_json::from_slice(text).unwrap();
    let role = |entry: &Value| Role {
        role: entry["role"].as_str().unwrap().to_owned(),
        id: entry["id"].as_u64(),
        pid: entry["pid"].as_u64().unwrap() as u32,
    };
    entries.iter().map(role).collect()
}

/// The process id of a role. A drone is named by its number as well.
pub(crate) fn pid_of(processes: &[Role], role: &str, id: Option<u64>) -> u32 {
    let found = processes.iter().find(|process| process.role == role && process.id == id);
    found.unwrap_or_else(|| panic!("no {role} {id:?} in {processes:?}")).pid
}

/// Sends a signal, such as `KILL`, to a process that the test has started.
pub(crate) fn signal(name: &str, pid: u32) {
    let script = format!("kill -s {name} {pid}");
    let status = Command::new("sh").args(["-c", &script]).stderr(Stdio::null()).status().unwrap();
    assert!(status.success(), "`{script}` failed: the process is gone");
}

/// Whether the process exists and is no zombie.
pub(crate) fn is_alive(pid: u32) -> bool {
    stat(pid).is_some_and(|fields| fields[0] != "Z" && fields[0] != "X")
}

/// The state of a process: `R`, `S`, `T` (stopped) …
pub(crate) fn state(pid: u32) -> String {
    stat(pid).unwrap_or_else(|| panic!("process {pid} is gone")).swap_remove(0)
}

/// Its process group.
pub(crate) fn group(pid: u32) -> u32 {
    stat(pid).and_then(|fields| fields[2].parse().ok()).unwrap_or_else(|| panic!("process {pid} is gone"))
}

/// Fields of /proc/<pid>/stat after the name: state, parent, process group …
fn stat(pid: u32) -> Option<Vec<String>> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    let (_, fields) = text.rsplit_once(") ")?;
    Some(fields.split(' ').map(str::to_owned).collect())
}

/// The files of a launcher's run in shared memory.
pub(crate) fn shared_files(launcher: u32) -> Vec<String> {
    let prefix = format!("skein_{launcher}_");
    super::names("/dev/shm").into_iter().filter(|name| name.starts_with(&prefix)).collect()
}
