//! The two ways of exchanging the same bytes that Skein is measured against, a process a drone: raw shared memory, and
//! Unix datagrams.

use super::cases::Size;
use super::probe::{Measured, Spent, memory_mib};
use crate::bench::Scratch;
use crate::exit::{Exit, Failure};
use clap::Args;
use rustix::process::{Signal, getppid, set_parent_process_death_signal};
use skein_bus::Baseline;
use skein_protocol::slot::Slot;
use skein_runtime::lighten;
use std::os::unix::net::UnixDatagram;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Ticks before anything is timed.
const WARM: u32 = 100;
/// Peers that are not there by then never will be.
const START_LIMIT: Duration = Duration::from_secs(60);

/// What carries the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transport {
    Memory,
    Datagrams,
}

/// Arguments of a peer's process.
#[derive(Debug, Args)]
pub struct FloorArgs {
    /// Descriptor of the floor's segment
    #[arg(long)]
    floor: Option<i32>,
    /// Folder of the sockets
    #[arg(long)]
    sockets: Option<PathBuf>,
    /// Its number
    #[arg(long)]
    id: usize,
    /// Process id of the bench
    #[arg(long)]
    parent: u32,
}

/// A peer's process: answers until it is told to stop, or the bench is gone.
pub fn peer(args: &FloorArgs) -> Result<Exit, Failure> {
    set_parent_process_death_signal(Some(Signal::KILL)).map_err(Failure::environment)?;
    let parent = args.parent as i32;
    let alive = || getppid().is_some_and(|pid| pid.as_raw_nonzero().get() == parent);
    match (&args.floor, &args.sockets) {
        (Some(fd), _) => Baseline::attach(*fd).map_err(Failure::environment)?.serve(args.id, alive),
        (None, Some(folder)) => answer(folder, args.id).map_err(Failure::environment)?,
        (None, None) => return Err(Failure::usage("expected --floor or --sockets")),
    }
    Ok(Exit::Reached)
}

/// A datagram peer: an empty one ends it.
fn answer(folder: &std::path::Path, id: usize) -> std::io::Result<()> {
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

/// Children that are gone when this is.
struct Peers(Vec<Child>);

impl Drop for Peers {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // Whoever has ended by itself is only reaped.
            let _ = (child.kill(), child.wait());
        }
    }
}

impl Peers {
    fn start(size: &Size, of: &[String]) -> Result<Self, Failure> {
        let executable = std::env::current_exe().map_err(Failure::environment)?;
        let mut peers = Self(Vec::new());
        for id in 0..size.drones {
            let mut command = Command::new(&executable);
            command.arg("floor-peer").args(of).args(["--id", &id.to_string()]);
            command.args(["--parent", &std::process::id().to_string()]);
            command.stdin(Stdio::null()).stdout(Stdio::null()).process_group(0);
            lighten(&mut command);
            peers.0.push(command.spawn().map_err(Failure::environment)?);
        }
        Ok(peers)
    }

    fn pids(&self) -> Vec<u32> {
        self.0.iter().map(Child::id).collect()
    }

    /// They were told to: waits for all.
    fn end(mut self) {
        self.0.iter_mut().for_each(|child| _ = child.wait());
        self.0.clear();
    }
}

/// One measurement: this process is the world.
pub(super) fn measure(size: &Size, transport: Transport) -> Result<Measured, Failure> {
    let started = Instant::now();
    match transport {
        Transport::Memory => {
            let floor =
                Baseline::create(size.drones as usize, size.down_len, size.read_len).map_err(Failure::environment)?;
            let peers = Peers::start(size, &["--floor".to_owned(), floor.fd().unwrap_or(-1).to_string()])?;
            while floor.here() < size.drones {
                if started.elapsed() > START_LIMIT {
                    return Err(Failure::environment("the floor's processes did not start"));
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            let mut down = vec![0; size.down_len];
            let tick = |k: u32| {
                down[0] = k as u8;
                std::hint::black_box(floor.tick(k, &down));
                Ok(())
            };
            let measured = time(size, started, &peers, tick)?;
            floor.close();
            peers.end();
            Ok(measured)
        }
        Transport::Datagrams => datagrams(size, started).map_err(Failure::environment),
    }
}

fn datagrams(size: &Size, started: Instant) -> Result<Measured, Box<dyn std::error::Error>> {
    let scratch = Scratch::new().map_err(|_| "no folder for sockets could be made")?;
    let folder = &scratch.0;
    let world = UnixDatagram::bind(folder.join("world"))?;
    world.set_read_timeout(Some(START_LIMIT))?;
    let peers = Peers::start(size, &["--sockets".to_owned(), folder.display().to_string()])
        .map_err(|_| "the datagram peers could not be started")?;
    let mut slot = [0; size_of::<Slot>()];
    for _ in 0..size.drones {
        world.recv(&mut slot)?;
    }
    let addresses: Vec<PathBuf> = (0..size.drones).map(|id| folder.join(id.to_string())).collect();
    let down = vec![0u8; size.read_len.max(1)];
    let tick = |_: u32| -> std::io::Result<()> {
        for address in &addresses {
            world.send_to(&down, address)?;
        }
        addresses.iter().try_for_each(|_| world.recv(&mut slot).map(|_| ()))
    };
    let measured = time(size, started, &peers, tick).map_err(|_| "the exchange of datagrams failed")?;
    for address in &addresses {
        world.send_to(&[], address)?;
    }
    peers.end();
    Ok(measured)
}

fn time(
    size: &Size,
    started: Instant,
    peers: &Peers,
    mut tick: impl FnMut(u32) -> std::io::Result<()>,
) -> Result<Measured, Failure> {
    let startup_s = started.elapsed().as_secs_f64();
    (0..WARM).try_for_each(&mut tick).map_err(Failure::environment)?;
    let (me, pids) = ([std::process::id()], peers.pids());
    let spent = || [Spent::of_all(&me), Spent::of_all(&pids)];
    let (before, window) = (spent(), size.window() as u32);
    let opened = Instant::now();
    (WARM..WARM + window).try_for_each(&mut tick).map_err(Failure::environment)?;
    let window_s = opened.elapsed().as_secs_f64();
    let after = spent();
    let (world, drones) = (after[0].since(before[0]), after[1].since(before[1]));
    let steps = f64::from(window) * f64::from(size.drones);
    let us = |spent: Spent| spent.cpu_ns as f64 / 1000.0 / steps;
    let (rss, pss) = memory_mib(&pids);
    let ticks_per_s = f64::from(window) / window_s;
    Ok(Measured {
        ticks_per_s,
        agent_steps_per_s: ticks_per_s * f64::from(size.drones),
        cpu_us_per_step: Some(us(world) + us(drones)),
        world_us_per_step: Some(us(world)),
        drones_us_per_step: Some(us(drones)),
        switches_per_step: Some((world.switches + drones.switches) as f64 / steps),
        rss_mib: Some(rss),
        pss_mib: Some(pss),
        startup_s: Some(startup_s),
        ..Measured::default()
    })
}
