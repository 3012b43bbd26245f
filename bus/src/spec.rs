//! What a control segment is made for.

use crate::error::BusError;

/// Maximum number of drones, of cores, and of drones per process.
const MAX_COUNT: usize = 1 << 16;

/// How processes wait for each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WaitMode {
    /// They sleep on a futex.
    #[default]
    Block,
    /// They give up the core and look again: faster for few drones on an idle machine, very slow on a busy one. Before the first tick they
    /// sleep on a futex, so that all can start.
    Yield,
}

/// What a control segment is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ControlSpec {
    /// Number of drones, from 1.
    pub drones: usize,
    /// Number of tick words, from 1: the number of cores that drones are pinned to, or 1 if they are not pinned.
    pub cores: usize,
    /// Drones per process, from 1. A process has the drones from a multiple of this number on; they share a tick word.
    pub per_process: usize,
    /// How processes wait.
    pub wait: WaitMode,
}

impl ControlSpec {
    /// # Errors
    /// [`BusError::Control`] if a number is 0 or too large.
    pub(crate) fn check(&self) -> Result<(), BusError> {
        let Self { drones, cores, per_process, .. } = *self;
        if [drones, cores, per_process].iter().all(|count| (1..=MAX_COUNT).contains(count)) {
            return Ok(());
        }
        let counts = format!("{drones}, {cores} and {per_process}");
        Err(BusError::Control(format!("expected 1 to {MAX_COUNT} drones, cores and drones per process, not {counts}")))
    }

    /// Number of the tick word that a drone waits on.
    pub(crate) fn core_of(&self, drone: usize) -> usize {
        drone / self.per_process % self.cores
    }
}
