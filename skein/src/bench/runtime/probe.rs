//! What the system says of processes: CPU time, switches, memory, files.

use serde::Serialize;
use std::path::Path;

/// What one flight gave.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Measured {
    pub ticks_per_s: f64,
    pub agent_steps_per_s: f64,
    /// Simulated seconds in a second; `None` without a simulation.
    pub realtime_factor: Option<f64>,
    /// A drone's step, µs.
    pub step_us_p50: Option<f64>,
    pub step_us_p99: Option<f64>,
    pub step_us_max: Option<f64>,
    /// System calls of the barrier in an agent-step: the world's and the drone's.
    pub calls_per_step: Option<f64>,
    /// Context switches in an agent-step, of all processes.
    pub switches_per_step: Option<f64>,
    /// CPU time of an agent-step, µs: all, the world's share, the drones'.
    pub cpu_us_per_step: Option<f64>,
    pub world_us_per_step: Option<f64>,
    pub drones_us_per_step: Option<f64>,
    /// Memory of all processes, MiB: resident, and with shared pages divided.
    pub rss_mib: Option<f64>,
    pub pss_mib: Option<f64>,
    /// Files in shared memory, and descriptors that the world holds.
    pub shm_files: Option<f64>,
    pub world_files: Option<f64>,
    /// From the launch to the first tick, and from the last to the end, s.
    pub startup_s: Option<f64>,
    pub shutdown_s: Option<f64>,
}

impl Measured {
    /// The median of each figure.
    pub fn median(rounds: &[Self]) -> Self {
        let of = |value: fn(&Self) -> Option<f64>| {
            let values: Vec<f64> = rounds.iter().filter_map(value).collect();
            if values.is_empty() { None } else { Some(median(values.into_iter())) }
        };
        Self {
            ticks_per_s: median(rounds.iter().map(|m| m.ticks_per_s)),
            agent_steps_per_s: median(rounds.iter().map(|m| m.agent_steps_per_s)),
            realtime_factor: of(|m| m.realtime_factor),
            step_us_p50: of(|m| m.step_us_p50),
            step_us_p99: of(|m| m.step_us_p99),
            step_us_max: of(|m| m.step_us_max),
            calls_per_step: of(|m| m.calls_per_step),
            switches_per_step: of(|m| m.switches_per_step),
            cpu_us_per_step: of(|m| m.cpu_us_per_step),
            world_us_per_step: of(|m| m.world_us_per_step),
            drones_us_per_step: of(|m| m.drones_us_per_step),
            rss_mib: of(|m| m.rss_mib),
            pss_mib: of(|m| m.pss_mib),
            shm_files: of(|m| m.shm_files),
            world_files: of(|m| m.world_files),
            startup_s: of(|m| m.startup_s),
            shutdown_s: of(|m| m.shutdown_s),
        }
    }
}

/// The middle one; the mean of the two in the middle of an even number. NaN of none.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => (sorted[n / 2 - 1] + sorted[n / 2]) / 2.0,
    }
}

/// CPU time and switches of a process so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub cpu_ns: u64,
    pub switches: u64,
}

impl Spent {
    /// Of one process; nothing if it is gone.
    pub fn of(pid: u32) -> Self {
        let read = |file: &str| std::fs::read_to_string(format!("/proc/{pid}/{file}")).unwrap_or_default();
        let cpu_ns = read("schedstat").split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(0);
        let status = read("status");
        let counts = status.lines().filter(|line| line.contains("voluntary_ctxt_switches"));
        let switches = counts.filter_map(|line| line.split_whitespace().last()?.parse::<u64>().ok()).sum();
        Self { cpu_ns, switches }
    }

    /// Of several together.
    pub fn of_all(pids: &[u32]) -> Self {
        pids.iter().map(|&pid| Self::of(pid)).fold(Self::default(), |all, one| Self {
            cpu_ns: all.cpu_ns + one.cpu_ns,
            switches: all.switches + one.switches,
        })
    }

    /// What was spent since `before`.
    pub fn since(self, before: Self) -> Self {
        Self {
            cpu_ns: self.cpu_ns.saturating_sub(before.cpu_ns),
            switches: self.switches.saturating_sub(before.switches),
        }
    }
}

/// Resident memory of processes, and that with shared pages divided, MiB.
pub(super) fn memory_mib(pids: &[u32]) -> (f64, f64) {
    let of = |pid: &u32| {
        let rollup = std::fs::read_to_string(format!("/proc/{pid}/smaps_rollup")).unwrap_or_default();
        let kib = |name: &str| -> f64 {
            let line = rollup.lines().find(|line| line.starts_with(name));
            line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0.0)
        };
        (kib("Rss:") / 1024.0, kib("Pss:") / 1024.0)
    };
    pids.iter().map(of).fold((0.0, 0.0), |(rss, pss), one| (rss + one.0, pss + one.1))
}

/// Entries of a folder whose names begin so.
pub(super) fn entries(folder: &Path, beginning: &str) -> usize {
    let listed = std::fs::read_dir(folder).into_iter().flatten().flatten();
    listed.filter(|entry| entry.file_name().to_string_lossy().starts_with(beginning)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_and_even_numbers() {
        assert_eq!(median([3.0, 1.0, 2.0].into_iter()), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0].into_iter()), 2.5);
        assert!(median(std::iter::empty()).is_nan());
    }

    #[test]
    fn this_process_has_spent_something_and_holds_memory() {
        let me = std::process::id();
        let before = Spent::of(me);
        let sum = (0..20_000_000u64).fold(0u64, |sum, i| sum.wrapping_mul(31).wrapping_add(std::hint::black_box(i)));
        std::hint::black_box(sum);
        assert!(Spent::of(me).since(before).cpu_ns > 0);
        let (rss, pss) = memory_mib(&[me]);
        assert!(rss >= pss && pss > 0.0);
        assert_eq!(Spent::of(u32::MAX).cpu_ns, 0);
    }
}
