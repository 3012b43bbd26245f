//! Flights of Skein itself by the product's own path: launcher, world, drones, record.

use super::measurement::Measurement;
use super::process_stats::{CpuUsage, Memory, entries};
use super::workload::Workload;
use crate::context::Context;
use crate::error::BenchError;
use crate::flown_by::flown_by;
use skein_bus::{PinMode, WaitMode};
use skein_protocol::record::{RecordSink, RecordView, SinkError};
use skein_runtime::{Clock, Launch, PATIENCE, ProcessInfo, ProcessRole, RunEnd, inline, supervisor};
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// How a swarm of processes flies.
pub(super) struct Processes {
    pub(super) pilot: &'static str,
    pub(super) wait: WaitMode,
    pub(super) per_process: u32,
}

/// A record sink that times the measured window.
struct WindowTimer<'a> {
    workload: &'a Workload,
    opened: Option<Instant>,
    window_s: f64,
    steps_ns: Vec<u32>,
    last_record: Option<Instant>,
    usage: &'a Mutex<ProcessUsage>,
}

/// The processes of a flight, and what they used up to the end of the measured window.
#[derive(Default)]
struct ProcessUsage {
    world: Vec<u32>,
    drones: Vec<u32>,
    world_before: CpuUsage,
    drones_before: CpuUsage,
    world_used: CpuUsage,
    drones_used: CpuUsage,
    memory: Memory,
    shm_files: usize,
    world_files: usize,
    /// Ticks flown meanwhile.
    ticks: u64,
}

impl ProcessUsage {
    fn begin(&mut self, processes: &[ProcessInfo]) {
        let pids = |role| processes.iter().filter(|p| p.role == role).map(|p| p.pid).collect::<Vec<u32>>();
        (self.world, self.drones) = (pids(ProcessRole::World), pids(ProcessRole::Drone));
        self.drones.dedup();
        (self.world_before, self.drones_before) = (CpuUsage::of_all(&self.world), CpuUsage::of_all(&self.drones));
    }

    fn take_cpu(&mut self, tick: u64) {
        self.world_used = CpuUsage::of_all(&self.world).since(self.world_before);
        self.drones_used = CpuUsage::of_all(&self.drones).since(self.drones_before);
        self.ticks = tick + 1;
    }

    /// Takes what needs long to be read. Nothing is timed any more.
    fn take_memory(&mut self) {
        let all: Vec<u32> = self.world.iter().chain(&self.drones).copied().collect();
        self.memory = Memory::of_all(&all);
        self.world_files = self.world.first().map_or(0, |pid| entries(Path::new(&format!("/proc/{pid}/fd")), ""));
        self.shm_files = entries(Path::new("/dev/shm"), "skein");
    }

    fn steps(&self, workload: &Workload) -> f64 {
        (self.ticks * u64::from(workload.drones)).max(1) as f64
    }
}

impl RecordSink for WindowTimer<'_> {
    fn take(&mut self, record: RecordView<'_>) -> Result<(), SinkError> {
        let tick = record.head.tick;
        if tick == self.workload.from {
            self.opened = Some(Instant::now());
        }
        if self.opened.is_some() && tick <= self.workload.until {
            self.steps_ns.extend(record.rows.iter().map(|row| row.step_ns));
        }
        if tick == self.workload.until
            && let (Some(opened), 0.0) = (self.opened, self.window_s)
        {
            self.window_s = opened.elapsed().as_secs_f64();
            let mut usage = lock(self.usage);
            usage.take_cpu(tick);
            usage.take_memory();
        }
        self.last_record = Some(Instant::now());
        Ok(())
    }
}

impl<'a> WindowTimer<'a> {
    fn new(workload: &'a Workload, usage: &'a Mutex<ProcessUsage>) -> Self {
        Self { workload, opened: None, window_s: 0.0, steps_ns: Vec::new(), last_record: None, usage }
    }

    fn measurement(mut self, end: &RunEnd) -> Result<Measurement, BenchError> {
        let failure = end.failure.as_ref().map(ToString::to_string);
        if let Some(failure) = failure.or(end.sink_error.as_ref().map(ToString::to_string)) {
            return Err(BenchError::Flight(failure));
        }
        if self.window_s <= 0.0 {
            // Interrupted: the caller sees the signal.
            return Ok(Measurement::default());
        }
        let ticks_per_s = self.workload.window() as f64 / self.window_s;
        self.steps_ns.sort_unstable();
        let step_us = |share: f64| {
            let place = ((self.steps_ns.len() as f64 - 1.0) * share) as usize;
            self.steps_ns.get(place).map(|&ns| f64::from(ns) / 1000.0)
        };
        Ok(Measurement {
            ticks_per_s,
            agent_steps_per_s: ticks_per_s * f64::from(self.workload.drones),
            realtime_factor: Some(ticks_per_s * self.workload.scenario.time.dt_s),
            step_us_p50: step_us(0.5).filter(|us| *us > 0.0),
            step_us_p99: step_us(0.99).filter(|us| *us > 0.0),
            step_us_max: step_us(1.0).filter(|us| *us > 0.0),
            startup_s: Some(end.startup_s),
            ..Measurement::default()
        })
    }
}

fn lock(usage: &Mutex<ProcessUsage>) -> MutexGuard<'_, ProcessUsage> {
    usage.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Measures a flight by function calls in this thread.
pub(super) fn inline(workload: &Workload, pilot: &str, context: &Context<'_>) -> Result<Measurement, BenchError> {
    let me = std::process::id();
    let begun = ProcessUsage { world: vec![me], world_before: CpuUsage::of(me), ..ProcessUsage::default() };
    let usage = Mutex::new(begun);
    let mut timer = WindowTimer::new(workload, &usage);
    let scenario = flown_by(&workload.scenario, pilot);
    let end = inline::run(&scenario, context.pilots, &mut timer, context.interrupted)?;
    let mut measurement = timer.measurement(&end)?;
    let usage = usage.into_inner().unwrap_or_else(PoisonError::into_inner);
    measurement.cpu_us_per_step = Some(usage.world_used.us_per_step(usage.steps(workload)));
    measurement.rss_mib = Some(usage.memory.rss_mib);
    Ok(measurement)
}

/// Measures a flight by processes: one for the world, and one for each drone or for several.
pub(super) fn processes(
    workload: &Workload,
    processes: &Processes,
    context: &Context<'_>,
) -> Result<Measurement, BenchError> {
    let usage = Mutex::new(ProcessUsage::default());
    let mut timer = WindowTimer::new(workload, &usage);
    let scenario = flown_by(&workload.scenario, processes.pilot);
    let launch = Launch {
        scenario: &scenario,
        clock: Clock::Lockstep,
        pin: PinMode::Auto,
        wait: processes.wait,
        patience: PATIENCE,
        per_process: processes.per_process,
        program: context.pilots.program(),
        hosts: &[],
        on_ready: &mut |started: &[ProcessInfo]| {
            lock(&usage).begin(started);
            Ok(())
        },
        interrupted: &mut || (context.interrupted)(),
    };
    let end = supervisor::run(launch, &mut timer)?;
    let shutdown_s = timer.last_record.map(|last| last.elapsed().as_secs_f64());
    let mut measurement = timer.measurement(&end)?;
    let usage = usage.into_inner().unwrap_or_else(PoisonError::into_inner);
    let steps = usage.steps(workload);
    let (world_us, drones_us) = (usage.world_used.us_per_step(steps), usage.drones_used.us_per_step(steps));
    measurement.world_us_per_step = Some(world_us);
    measurement.drones_us_per_step = Some(drones_us);
    measurement.cpu_us_per_step = Some(world_us + drones_us);
    measurement.switches_per_step = Some((usage.world_used.switches + usage.drones_used.switches) as f64 / steps);
    let all_steps = (workload.all_ticks() * u64::from(workload.drones)) as f64;
    measurement.calls_per_step = Some((end.calls[0] + end.calls[1]) as f64 / all_steps);
    measurement.rss_mib = Some(usage.memory.rss_mib);
    measurement.pss_mib = Some(usage.memory.pss_mib);
    measurement.shm_files = Some(usage.shm_files as f64);
    measurement.world_files = Some(usage.world_files as f64);
    measurement.shutdown_s = shutdown_s;
    Ok(measurement)
}
