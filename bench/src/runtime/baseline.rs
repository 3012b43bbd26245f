//! What Skein is measured against: the same bytes per tick between as many processes, by raw shared memory or by Unix
//! datagrams, without anything else that a swarm needs.

use super::measurement::Measurement;
use super::process_stats::{CpuUsage, Memory};
use super::workload::Workload;
use crate::error::BenchError;
use crate::scratch::ScratchFolder;
use clap::Args;
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use skein_bus::Baseline;
use skein_protocol::slot::Slot;
use skein_runtime::{Program, lighten};
use std::os::unix::net::UnixDatagram;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// Ticks before the measurement.
const WARM_UP_TICKS: u32 = 100;
/// Peers that have not started by then never will.
const START_LIMIT: Duration = Duration::from_secs(60);

/// What carries the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transport {
    Memory,
    Datagrams,
}

/// A peer process of the baseline. The program whose command `baseline-peer` runs it is the benchmark's executable.
#[derive(Debug, Args)]
pub struct BaselinePeer {
    /// Descriptor of the shared segment
    #[arg(long)]
    segment: Option<i32>,
    /// Folder of the sockets
    #[arg(long)]
    sockets: Option<PathBuf>,
    /// Number of the peer
    #[arg(long)]
    id: usize,
    /// Process id of the benchmark
    #[arg(long)]
    parent: u32,
}

impl BaselinePeer {
    /// Answers each tick until the benchmark ends it or is gone.
    ///
    /// # Errors
    /// [`BenchError`] if the segment or the socket cannot be opened.
    pub fn run(&self) -> Result<(), BenchError> {
        let die = set_parent_process_death_signal(Some(Signal::KILL));
        die.map_err(BenchError::system("binding a peer to its parent"))?;
        let parent = self.parent as i32;
        let alive = || getppid().is_some_and(|pid| pid.as_raw_nonzero().get() == parent);
        match (&self.segment, &self.sockets) {
            (Some(fd), _) => Baseline::attach(*fd)?.serve(self.id, alive),
            (None, Some(folder)) => {
                answer(folder, self.id).map_err(BenchError::system("answering datagrams"))?;
            }
            (None, None) => return Err(BenchError::NoTransport),
        }
        Ok(())
    }
}

/// Answers each datagram until an empty one comes.
fn answer(folder: &Path, id: usize) -> std::io::Result<()> {
    let socket = UnixDatagram::bind(folder.join(id.to_string()))?;
    socket.connect(folder.join("world"))?;
    let slot = [0u8; size_of::<Slot>()];
    socket.send(&slot)?;
    let mut down = vec![0; 1 << 17];
    while socket.recv(&mut down)? > 0 {
        socket.send(&slot)?;
    }
    Ok(())
}

/// The peer processes. They are killed when this is dropped.
struct Peers(Vec<Child>);

impl Drop for Peers {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // A peer that has ended by itself is only reaped.
            let _ = (child.kill(), child.wait());
        }
    }
}

impl Peers {
    fn start(workload: &Workload, program: &Program, transport: &[String]) -> Result<Self, BenchError> {
        let mut peers = Self(Vec::new());
        for id in 0..workload.drones {
            let mut command = program.command();
            command.arg("baseline-peer").args(transport).args(["--id", &id.to_string()]);
            command.args(["--parent", &std::process::id().to_string()]);
            command.stdin(Stdio::null()).stdout(Stdio::null()).process_group(0);
            lighten(&mut command);
            peers.0.push(command.spawn().map_err(BenchError::system("starting a peer of the baseline"))?);
        }
        Ok(peers)
    }

    fn pids(&self) -> Vec<u32> {
        self.0.iter().map(Child::id).collect()
    }

    /// Waits until all have ended, which they were told to.
    fn end(mut self) {
        for child in &mut self.0 {
            // A peer that cannot be waited for is gone.
            let _ = child.wait();
        }
        self.0.clear();
    }
}

/// Measures the exchange once. This process plays the world.
pub(super) fn measure(workload: &Workload, transport: Transport, program: &Program) -> Result<Measurement, BenchError> {
    match transport {
        Transport::Memory => memory(workload, program),
        Transport::Datagrams => datagrams(workload, program),
    }
}

fn memory(workload: &Workload, program: &Program) -> Result<Measurement, BenchError> {
    let started = Instant::now();
    let baseline = Baseline::create(workload.drones as usize, workload.down_len, workload.read_len)?;
    let segment = ["--segment".to_owned(), baseline.fd().unwrap_or(-1).to_string()];
    let peers = Peers::start(workload, program, &segment)?;
    while baseline.here() < workload.drones {
        if started.elapsed() > START_LIMIT {
            return Err(BenchError::PeersMissing { seconds: START_LIMIT.as_secs() });
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let mut down = vec![0; workload.down_len];
    let tick = |k: u32| {
        down[0] = k as u8;
        std::hint::black_box(baseline.tick(k, &down));
        Ok(())
    };
    let measurement = time(workload, started, &peers, tick).map_err(BenchError::system("the exchange"))?;
    baseline.close();
    peers.end();
    Ok(measurement)
}

fn datagrams(workload: &Workload, program: &Program) -> Result<Measurement, BenchError> {
    const WHAT: &str = "exchanging datagrams";
    let started = Instant::now();
    let scratch = ScratchFolder::new()?;
    let folder = scratch.path();
    let world = UnixDatagram::bind(folder.join("world")).map_err(BenchError::system("binding a socket"))?;
    world.set_read_timeout(Some(START_LIMIT)).map_err(BenchError::system("setting a time limit"))?;
    let peers = Peers::start(workload, program, &["--sockets".to_owned(), folder.display().to_string()])?;
    let mut slot = [0; size_of::<Slot>()];
    for _ in 0..workload.drones {
        world.recv(&mut slot).map_err(BenchError::system("waiting for the datagram peers"))?;
    }
    let addresses: Vec<PathBuf> = (0..workload.drones).map(|id| folder.join(id.to_string())).collect();
    let down = vec![0u8; workload.read_len.max(1)];
    let tick = |_: u32| -> std::io::Result<()> {
        for address in &addresses {
            world.send_to(&down, address)?;
        }
        addresses.iter().try_for_each(|_| world.recv(&mut slot).map(|_| ()))
    };
    let measurement = time(workload, started, &peers, tick).map_err(BenchError::system(WHAT))?;
    for address in &addresses {
        world.send_to(&[], address).map_err(BenchError::system(WHAT))?;
    }
    peers.end();
    Ok(measurement)
}

fn time(
    workload: &Workload,
    started: Instant,
    peers: &Peers,
    mut tick: impl FnMut(u32) -> std::io::Result<()>,
) -> std::io::Result<Measurement> {
    let startup_s = started.elapsed().as_secs_f64();
    (0..WARM_UP_TICKS).try_for_each(&mut tick)?;
    let (me, pids) = ([std::process::id()], peers.pids());
    let usage = || [CpuUsage::of_all(&me), CpuUsage::of_all(&pids)];
    let (before, window) = (usage(), workload.window() as u32);
    let opened = Instant::now();
    (WARM_UP_TICKS..WARM_UP_TICKS + window).try_for_each(&mut tick)?;
    let window_s = opened.elapsed().as_secs_f64();
    let after = usage();
    let (world, drones) = (after[0].since(before[0]), after[1].since(before[1]));
    let steps = f64::from(window) * f64::from(workload.drones);
    let memory = Memory::of_all(&pids);
    let ticks_per_s = f64::from(window) / window_s;
    Ok(Measurement {
        ticks_per_s,
        agent_steps_per_s: ticks_per_s * f64::from(workload.drones),
        cpu_us_per_step: Some(world.us_per_step(steps) + drones.us_per_step(steps)),
        world_us_per_step: Some(world.us_per_step(steps)),
        drones_us_per_step: Some(drones.us_per_step(steps)),
        switches_per_step: Some((world.switches + drones.switches) as f64 / steps),
        rss_mib: Some(memory.rss_mib),
        pss_mib: Some(memory.pss_mib),
        startup_s: Some(startup_s),
        ..Measurement::default()
    })
}
