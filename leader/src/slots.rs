//! Which drone takes which slot of the formation.

use crate::matching::cheapest_first;
use crate::tps;
use skein_protocol::Vec2;
use skein_protocol::matching::least_cost;
use thiserror::Error;

/// There are fewer slots than drones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{drones} drones need as many slots, found {slots}")]
pub struct TooFewSlots {
    /// Number of drones.
    pub drones: usize,
    /// Number of slots.
    pub slots: usize,
}

/// How slots are assigned to drones (paper, Algorithm 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reformation {
    /// The least sum of squared distances.
    Optimal,
    /// The paper's annealed thin-plate mapping: [`tps::assign`]. Optimal where that has no answer.
    Tps {
        /// λ of the paper's E6, m².
        lambda_m2: f64,
    },
    /// The closest pair of drone and slot first, and so on.
    Greedy,
    /// Each drone takes the slot of its own index.
    Identity,
}

/// The slot of each drone, by index, no slot twice. Positions and slots are in one frame, m, finite. Surplus slots stay
/// empty.
///
/// # Errors
/// [`TooFewSlots`] for fewer slots than drones.
pub fn assign_by(method: Reformation, positions: &[Vec2], slots: &[Vec2]) -> Result<Vec<usize>, TooFewSlots> {
    if slots.len() < positions.len() {
        return Err(TooFewSlots { drones: positions.len(), slots: slots.len() });
    }
    if let Reformation::Tps { lambda_m2 } = method
        && let Some(taken) = tps::assign(positions, slots, lambda_m2)
    {
        return Ok(taken);
    }
    let cost = |drone: usize, slot: usize| (positions[drone] - slots[slot]).norm_squared();
    Ok(assign_by_cost(method, positions.len(), slots.len(), cost))
}

/// The slot of each drone, by index, no slot twice, for slots to which the way leads round obstacles. `way_m`: the length of the way from a
/// position to a slot, m. The thin-plate mapping knows distances only, so the optimal method takes its place. Squares of lengths send the
/// drone that is first at the mouth of a bay to the slot that is deepest in it.
///
/// # Errors
/// [`TooFewSlots`] for fewer slots than drones.
pub fn assign_along(
    method: Reformation,
    positions: &[Vec2],
    slots: &[Vec2],
    way_m: impl Fn(Vec2, Vec2) -> f64,
) -> Result<Vec<usize>, TooFewSlots> {
    let (drones, places) = (positions.len(), slots.len());
    if places < drones {
        return Err(TooFewSlots { drones, slots: places });
    }
    let lengths: Vec<f64> = positions.iter().flat_map(|from| slots.iter().map(|to| way_m(*from, *to))).collect();
    let cost = |drone: usize, slot: usize| lengths[drone * places + slot].powi(2);
    Ok(assign_by_cost(method, drones, places, cost))
}

/// The slot of each drone by the cost of each pair, for at least as many slots as drones. The thin-plate mapping has no such costs.
fn assign_by_cost(method: Reformation, drones: usize, slots: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    match method {
        Reformation::Optimal | Reformation::Tps { .. } => least_cost(drones, slots, cost),
        Reformation::Greedy => cheapest_first(drones, slots, &cost),
        Reformation::Identity => (0..drones).collect(),
    }
}

/// The slot of each drone, by index, no slot twice, so that the sum of squared distances is least (O(drones² · slots)).
/// Positions and slots are in one frame, m, finite. Surplus slots stay empty.
///
/// # Errors
/// [`TooFewSlots`] for fewer slots than drones.
pub fn assign(positions: &[Vec2], slots: &[Vec2]) -> Result<Vec<usize>, TooFewSlots> {
    if slots.len() < positions.len() {
        return Err(TooFewSlots { drones: positions.len(), slots: slots.len() });
    }
    Ok(least_cost(positions.len(), slots.len(), |drone, slot| (positions[drone] - slots[slot]).norm_squared()))
}
