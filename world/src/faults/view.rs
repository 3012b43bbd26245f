//! The truth at the beginning of a tick, as far as faults depend on it.

use crate::drones::DroneTable;
use crate::stages::Stages;

/// What faults look at.
#[derive(Clone, Copy)]
pub(crate) struct FaultView<'a> {
    /// The drones, with their answers of the tick before.
    pub(crate) drones: &'a DroneTable,
    /// The obstacle sets.
    pub(crate) stages: &'a Stages,
}
