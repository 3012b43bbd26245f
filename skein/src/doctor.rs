//! `skein doctor`: shows which limits of this machine restrict a swarm, and how many drones fit.

use crate::exit::{Exit, Failure};
use crate::output::{print, print_line};
use clap::Args;
use rustix::process::{Resource, getrlimit};
use serde_json::json;
use std::fs;
use std::io::Read;

/// Arguments of `doctor`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  skein doctor
  skein doctor --json")]
pub(crate) struct DoctorArgs {
    /// Print one JSON object
    #[arg(long)]
    pub(crate) json: bool,
}

/// Memory per drone without shared memory, bytes: 2.3 to 2.9 MiB in its own process (proportional set size) and 0.35 MiB in
/// the world's, measured with 8, 64 and 200 drones by `skein bench runtime`.
const DRONE_BYTES: u64 = 7 << 19;
/// Shared memory that a run reserves, bytes: for the run, and for each drone. Measured in flight: 9.0 MiB for 8 drones, 45.0 MiB for
/// 64 and 114.4 MiB for 200 (`df -B1 /dev/shm`).
const RUN_SHARED: u64 = 4 << 20;
const DRONE_SHARED: u64 = 700 << 10;
/// What to do about too little shared memory.
const SHARED_HINT: &str = "`skein clean`; mount -o remount,size=";
/// Descriptors per drone in the world process, which has the most. Measured: 4.1.
const DRONE_FILES: u64 = 5;
/// Further descriptors of a process.
const OTHER_FILES: u64 = 64;
/// Processes of a run besides the drones: launcher and world.
const OTHER_PROCESSES: u64 = 2;
/// Threads of a run besides the first ones of its processes: the one that writes the record. The limits count threads.
const OTHER_THREADS: u64 = 1;

/// Room for the status of a process, bytes, so that one call reads it.
const STATUS_BYTES: usize = 4096;

/// A limit of the machine.
struct Limit {
    name: &'static str,
    /// What the machine has.
    has: String,
    /// Number of drones that it allows; `None` if it limits the speed only.
    drones: Option<u64>,
    /// What to do about it.
    hint: &'static str,
}

/// Prints the limits and the number of drones that fit.
pub(crate) fn doctor(args: &DoctorArgs) -> Result<Exit, Failure> {
    let limits = [files(), processes(), memory(), shared_memory()?, cores()?, governor()];
    let fits = limits.iter().filter_map(|limit| limit.drones).min().unwrap_or(0);
    if args.json {
        let lines: Vec<_> = limits
            .iter()
            .map(|limit| json!({ "limit": limit.name, "has": limit.has, "drones": limit.drones, "hint": limit.hint }))
            .collect();
        print_line(json!({ "drones": fits, "limits": lines }))?;
    } else {
        let tight = limits.iter().find(|limit| limit.drones == Some(fits));
        let first = tight.map_or(String::new(), |limit| format!(", limited by {}: {}", limit.name, limit.hint));
        let mut text = format!("about {fits} drones fit{first}\n\n");
        for limit in &limits {
            let drones = limit.drones.map_or("-".to_owned(), |drones| drones.to_string());
            text += &format!("  {:<15}{:<42}{drones:>9}  {}\n", limit.name, limit.has, limit.hint);
        }
        print(text)?;
    }
    Ok(Exit::Reached)
}

/// Refuses a swarm that does not fit on this machine with `per_process` drones per process.
pub(crate) fn check_room(drones: u32, per_process: u32) -> Result<(), Failure> {
    let pack = u64::from(per_process);
    let (needed, [free, _]) = (RUN_SHARED + u64::from(drones) * DRONE_SHARED, shared_bytes()?);
    if needed > free {
        let why = format!(
            "{drones} drones do not fit into shared memory: about {needed} bytes are needed in /dev/shm, {free} are free; see {SHARED_HINT}"
        );
        return Err(Failure::environment(why));
    }
    for (limit, pack) in [(files(), pack), (processes(), pack), (memory(), 1)] {
        let fits = limit.drones.unwrap_or(u64::MAX).saturating_mul(pack);
        if u64::from(drones) > fits {
            let Limit { name, has, hint, .. } = limit;
            let share = if pack > 1 { "" } else { ", or put several drones into a process (--drones-per-process)" };
            let why = format!("{drones} drones do not fit, {fits} do: {name} ({has}); see {hint}{share}");
            return Err(Failure::environment(why));
        }
    }
    Ok(())
}

fn files() -> Limit {
    let limit = getrlimit(Resource::Nofile);
    let most = limit.maximum.unwrap_or(u64::MAX);
    let show = |value: Option<u64>| value.map_or("unlimited".to_owned(), |value| value.to_string());
    Limit {
        name: "open files",
        has: format!("{} per process, raised to {}", show(limit.current), show(limit.maximum)),
        drones: Some(most.saturating_sub(OTHER_FILES) / DRONE_FILES),
        hint: "`ulimit -Hn`, LimitNOFILE=",
    }
}

fn number(path: &str) -> Option<u64> {
    fs::read_to_string(path).ok()?.trim().parse().ok()
}

fn processes() -> Limit {
    // This process becomes the launcher, and is among those in use.
    let others = OTHER_PROCESSES + OTHER_THREADS - 1;
    let all = number("/proc/sys/kernel/pid_max");
    let group = number("/sys/fs/cgroup/pids.max");
    let threads = threads_of_machine();
    let bounds =
        [group.map(|most| (most, number("/sys/fs/cgroup/pids.current").unwrap_or(0))), all.map(|most| (most, threads))];
    let room = |(most, taken): &(u64, u64)| most.saturating_sub(*taken);
    let others_least = bounds.into_iter().flatten().min_by_key(room).unwrap_or((u64::MAX, 0));
    // A user has at most the threads of the machine. They are counted only if the user's limit could be the least.
    let of_user = getrlimit(Resource::Nproc).current.filter(|&most| room(&(most, threads)) < room(&others_least));
    let of_user = of_user.map(|most| (most, threads_of_user()));
    let (least, taken) = of_user.into_iter().chain([others_least]).min_by_key(room).unwrap_or(others_least);
    Limit {
        name: "processes",
        has: format!("{least}, {taken} of them in use"),
        drones: Some(room(&(least, taken)).saturating_sub(others)),
        hint: "`ulimit -u`, pids.max of the control group",
    }
}

/// Number of threads of this user.
fn threads_of_user() -> u64 {
    use std::os::unix::fs::MetadataExt;
    let user = rustix::process::getuid().as_raw();
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    let own = processes.filter(|process| {
        let name = process.file_name();
        name.to_string_lossy().parse::<u32>().is_ok() && process.metadata().is_ok_and(|meta| meta.uid() == user)
    });
    own.map(|process| {
        let mut status = String::with_capacity(STATUS_BYTES);
        let read = fs::File::open(process.path().join("status")).and_then(|mut file| file.read_to_string(&mut status));
        let threads = status.lines().find_map(|line| line.strip_prefix("Threads:")?.trim().parse::<u64>().ok());
        read.ok().and(threads).unwrap_or(0)
    })
    .sum()
}

/// Number of threads of all users.
fn threads_of_machine() -> u64 {
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let threads = load.split(' ').nth(3).and_then(|field| field.split('/').nth(1)?.parse().ok());
    threads.unwrap_or(0)
}

fn memory() -> Limit {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let field = |name: &str| -> u64 {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
        let kib = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok());
        kib.unwrap_or(0) << 10
    };
    let (free, all) = (field("MemAvailable"), field("MemTotal"));
    let group = number("/sys/fs/cgroup/memory.max");
    let free = group.map_or(free, |most| free.min(most));
    Limit {
        name: "memory",
        has: format!("{} MiB free of {} MiB", free >> 20, all >> 20),
        drones: Some(free / (DRONE_BYTES + DRONE_SHARED)),
        hint: "close other programs",
    }
}

/// Bytes of shared memory that are free, and all.
fn shared_bytes() -> Result<[u64; 2], Failure> {
    let about = rustix::fs::statvfs("/dev/shm").map_err(|error| Failure::environment(format!("/dev/shm: {error}")))?;
    Ok([about.f_bavail, about.f_blocks].map(|blocks| blocks * about.f_frsize))
}

fn shared_memory() -> Result<Limit, Failure> {
    let [free, all] = shared_bytes()?;
    Ok(Limit {
        name: "shared memory",
        has: format!("{} MiB free of {} MiB in /dev/shm", free >> 20, all >> 20),
        drones: Some(free.saturating_sub(RUN_SHARED) / DRONE_SHARED),
        hint: SHARED_HINT,
    })
}

fn cores() -> Result<Limit, Failure> {
    let cores = skein_bus::allowed_cores().map_err(Failure::environment)?;
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().unwrap_or("?");
    Ok(Limit {
        name: "cores",
        has: format!("{cores} allowed, load {load}"),
        drones: None,
        hint: "more drones than cores: slower, same result",
    })
}

fn governor() -> Limit {
    let governor = fs::read_to_string("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    let has = governor.map_or("unknown (virtual machines have none)".to_owned(), |text| text.trim().to_owned());
    let hint = if has == "powersave" { "cpupower frequency-set -g performance" } else { "performance is fastest" };
    Limit { name: "governor", has, drones: None, hint }
}
