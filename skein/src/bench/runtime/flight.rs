//! Skein itself, flown through the product's own path: launcher, world, drones, record.

use super::cases::Size;
use super::probe::{Measured, Spent, entries, memory_mib};
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use skein_bus::{PinMode, WaitMode};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_runtime::{Clock, Launch, PilotKind, ProcessInfo, ProcessRole, RunEnd, inline, supervisor};

use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Watches the record go by.
struct Watch<'a> {
    size: &'a Size,
    opened: Option<Instant>,
    window_s: f64,
    steps_ns: Vec<u32>,
    ended: Option<Instant>,
    processes: &'a Mutex<Processes>,
}

/// Who flies, and what they had spent when they began.
#[derive(Default)]
struct Processes {
    world: Vec<u32>,
    drones: Vec<u32>,
    before: [Spent; 2],
    spent: [Spent; 2],
    memory_mib: (f64, f64),
    files: [usize; 2],
    /// Ticks over which it was spent.
    ticks: u64,
}

impl Processes {
    fn begin(&mut self, processes: &[ProcessInfo]) {
        let pids = |role| processes.iter().filter(|p| p.role == role).map(|p| p.pid).collect::<Vec<u32>>();
        (self.world, self.drones) = (pids(ProcessRole::World), pids(ProcessRole::Drone));
        self.drones.dedup();
        self.before = [Spent::of_all(&self.world), Spent::of_all(&self.drones)];
    }

    fn look(&mut self, tick: u64) {
        let now = [Spent::of_all(&self.world), Spent::of_all(&self.drones)];
        self.spent = [now[0].since(self.before[0]), now[1].since(self.before[1])];
        self.ticks = tick + 1;
    }

    /// What takes long to ask for, and is asked once nothing is timed any more.
    fn look_at_memory(&mut self) {
        let all: Vec<u32> = self.world.iter().chain(&self.drones).copied().collect();
        self.memory_mib = memory_mib(&all);
        let descriptors = self.world.first().map_or(0, |pid| entries(Path::new(&format!("/proc/{pid}/fd")), ""));
        self.files = [entries(Path::new("/dev/shm"), "skein"), descriptors];
    }
}

impl RecordSink for Watch<'_> {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let tick = record.head.tick;
        if tick == self.size.from {
            self.opened = Some(Instant::now());
        }
        if self.opened.is_some() && tick <= self.size.until {
            self.steps_ns.extend(record.rows.iter().map(|row| row.step_ns));
        }
        if tick == self.size.until
            && let (Some(opened), 0.0) = (self.opened, self.window_s)
        {
            self.window_s = opened.elapsed().as_secs_f64();
            let mut processes = self.processes.lock().unwrap_or_else(PoisonError::into_inner);
            processes.look(tick);
            processes.look_at_memory();
        }
        self.ended = Some(Instant::now());
        Ok(())
    }
}

impl Watch<'_> {
    fn measured(mut self, end: &RunEnd) -> Result<Measured, Failure> {
        let trouble = end.failure.clone().or(end.sink_error.clone());
        if let Some(trouble) = trouble {
            return Err(Failure::environment(trouble));
        }
        if self.window_s <= 0.0 {
            // Interrupted: the caller sees the signal.
            return Ok(Measured::default());
        }
        let ticks_per_s = self.size.window() as f64 / self.window_s;
        self.steps_ns.sort_unstable();
        let step_us = |share: f64| {
            let place = ((self.steps_ns.len() as f64 - 1.0) * share) as usize;
            self.steps_ns.get(place).map(|&ns| f64::from(ns) / 1000.0)
        };
        Ok(Measured {
            ticks_per_s,
            agent_steps_per_s: ticks_per_s * f64::from(self.size.drones),
            realtime_factor: Some(ticks_per_s * self.size.scenario.time.dt_s),
            step_us_p50: step_us(0.5).filter(|us| *us > 0.0),
            step_us_p99: step_us(0.99).filter(|us| *us > 0.0),
            step_us_max: step_us(1.0).filter(|us| *us > 0.0),
            startup_s: Some(end.startup_s),
            ..Measured::default()
        })
    }
}

fn watch<'a>(size: &'a Size, processes: &'a Mutex<Processes>) -> Watch<'a> {
    Watch { size, opened: None, window_s: 0.0, steps_ns: Vec::new(), ended: None, processes }
}

/// Function calls in this thread.
pub(super) fn inline(size: &Size, pilot: PilotKind, interrupt: &Interrupt) -> Result<Measured, Failure> {
    let processes = Mutex::new(Processes { world: vec![std::process::id()], ..Processes::default() });
    processes.lock().unwrap_or_else(PoisonError::into_inner).before[0] = Spent::of(std::process::id());
    let mut sink = watch(size, &processes);
    let end =
        inline::run_with(&size.scenario, pilot, &mut sink, || interrupt.signal()).map_err(Failure::environment)?;
    let mut measured = sink.measured(&end)?;
    let processes = processes.into_inner().unwrap_or_else(PoisonError::into_inner);
    let steps = (processes.ticks * u64::from(size.drones)).max(1) as f64;
    measured.cpu_us_per_step = Some(processes.spent[0].cpu_ns as f64 / 1000.0 / steps);
    measured.rss_mib = Some(processes.memory_mib.0);
    Ok(measured)
}

/// A process for the world and one for each drone, or for `per_process` of them.
pub(super) fn processes(
    size: &Size,
    pilot: PilotKind,
    wait: WaitMode,
    per_process: u32,
    interrupt: &Interrupt,
) -> Result<Measured, Failure> {
    let processes = Mutex::new(Processes::default());
    let mut sink = watch(size, &processes);
    let launch = Launch {
        scenario: &size.scenario,
        clock: Clock::Lockstep,
        pin: PinMode::Auto,
        wait,
        pilot,
        per_process,
        executable: std::env::current_exe().map_err(Failure::environment)?,
        on_ready: &mut |who: &[ProcessInfo]| {
            processes.lock().unwrap_or_else(PoisonError::into_inner).begin(who);
            Ok(())
        },
        interrupted: &mut || interrupt.signal(),
    };
    let end = supervisor::run(launch, &mut sink).map_err(Failure::environment)?;
    let shutdown_s = sink.ended.map(|ended| ended.elapsed().as_secs_f64());
    let ticks = size.until + 80;
    let mut measured = sink.measured(&end)?;
    let of = processes.into_inner().unwrap_or_else(PoisonError::into_inner);
    let steps = (of.ticks * u64::from(size.drones)).max(1) as f64;
    let us = |spent: Spent| spent.cpu_ns as f64 / 1000.0 / steps;
    measured.world_us_per_step = Some(us(of.spent[0]));
    measured.drones_us_per_step = Some(us(of.spent[1]));
    measured.cpu_us_per_step = Some(us(of.spent[0]) + us(of.spent[1]));
    measured.switches_per_step = Some((of.spent[0].switches + of.spent[1].switches) as f64 / steps);
    measured.calls_per_step = Some((end.calls[0] + end.calls[1]) as f64 / (ticks * u64::from(size.drones)) as f64);
    (measured.rss_mib, measured.pss_mib) = (Some(of.memory_mib.0), Some(of.memory_mib.1));
    (measured.shm_files, measured.world_files) = (Some(of.files[0] as f64), Some(of.files[1] as f64));
    measured.shutdown_s = shutdown_s;
    Ok(measured)
}
