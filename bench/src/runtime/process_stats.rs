//! What the system says about processes: CPU time, context switches, memory, files.

use std::path::Path;

/// CPU time and context switches of processes since they started.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CpuUsage {
    pub(crate) cpu_ns: u64,
    pub(crate) switches: u64,
}

impl CpuUsage {
    /// Of all threads that one process has now; zero if it is gone. What Linux says of a process itself is about its first
    /// thread.
    pub(crate) fn of(pid: u32) -> Self {
        let threads = std::fs::read_dir(format!("/proc/{pid}/task")).into_iter().flatten().flatten();
        Self::sum(threads.map(|thread| Self::of_thread(&thread.path())))
    }

    fn of_thread(path: &Path) -> Self {
        let read = |file: &str| std::fs::read_to_string(path.join(file)).unwrap_or_default();
        let cpu_ns = read("schedstat").split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(0);
        let status = read("status");
        let counts = status.lines().filter(|line| line.contains("voluntary_ctxt_switches"));
        let switches = counts.filter_map(|line| line.split_whitespace().last()?.parse::<u64>().ok()).sum();
        Self { cpu_ns, switches }
    }

    fn sum(parts: impl Iterator<Item = Self>) -> Self {
        parts.fold(Self::default(), |all, one| Self {
            cpu_ns: all.cpu_ns + one.cpu_ns,
            switches: all.switches + one.switches,
        })
    }

    /// Of several processes together.
    pub(crate) fn of_all(pids: &[u32]) -> Self {
        Self::sum(pids.iter().map(|&pid| Self::of(pid)))
    }

    /// The difference to an earlier value.
    pub(crate) fn since(self, before: Self) -> Self {
        Self {
            cpu_ns: self.cpu_ns.saturating_sub(before.cpu_ns),
            switches: self.switches.saturating_sub(before.switches),
        }
    }

    /// CPU time per agent-step, µs.
    pub(crate) fn us_per_step(self, steps: f64) -> f64 {
        self.cpu_ns as f64 / 1000.0 / steps
    }
}

/// Memory of processes, MiB.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory {
    /// Resident set size.
    pub(crate) rss_mib: f64,
    /// Proportional set size: shared pages are divided among the processes that share them.
    pub(crate) pss_mib: f64,
}

impl Memory {
    /// Of several processes together.
    pub(crate) fn of_all(pids: &[u32]) -> Self {
        let mut all = Self::default();
        for pid in pids {
            let rollup = std::fs::read_to_string(format!("/proc/{pid}/smaps_rollup")).unwrap_or_default();
            let kib = |name: &str| -> f64 {
                let line = rollup.lines().find(|line| line.starts_with(name));
                line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0.0)
            };
            all.rss_mib += kib("Rss:") / 1024.0;
            all.pss_mib += kib("Pss:") / 1024.0;
        }
        all
    }
}

/// Number of entries of a folder whose names begin with `prefix`.
pub(crate) fn entries(folder: &Path, prefix: &str) -> usize {
    let listed = std::fs::read_dir(folder).into_iter().flatten().flatten();
    listed.filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_process_uses_cpu_time_and_memory() {
        let (me, this_thread) = (std::process::id(), Path::new("/proc/thread-self"));
        let before = CpuUsage::of_thread(this_thread);
        let sum = (0..20_000_000u64).fold(0u64, |sum, i| sum.wrapping_mul(31).wrapping_add(std::hint::black_box(i)));
        std::hint::black_box(sum);
        let after = CpuUsage::of_thread(this_thread);
        assert!(after.since(before).cpu_ns > 1_000_000);
        // The other tests of this process run in threads that end at any time. Only what this thread has used is certain to be in the sum.
        assert!(CpuUsage::of(me).cpu_ns >= after.cpu_ns, "the thread of this test counts");
        let Memory { rss_mib, pss_mib } = Memory::of_all(&[me]);
        assert!(rss_mib >= pss_mib && pss_mib > 0.0);
        assert_eq!(CpuUsage::of(u32::MAX).cpu_ns, 0);
    }
}
