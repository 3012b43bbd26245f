//! How large an experiment may be.

/// Greatest number of seeds, and of values of one key.
pub(crate) const MAX_VALUES: u64 = 1_000_000;
/// Greatest number of runs: of cells, times the seeds of each.
pub(crate) const MAX_RUNS: u128 = 10_000_000;
