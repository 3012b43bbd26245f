//! Which drone takes which slot of the target shape.

use crate::tps;
use skein_protocol::Vec2;
use thiserror::Error;

/// There is no slot for everybody.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("{drones} drones need as many slots, found {slots}")]
pub struct TooFewSlots {
    /// Number of drones.
    pub drones: usize,
    /// Number of slots.
    pub slots: usize,
}

/// How slots are given to drones (paper, Algorithm 5).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reformation {
    /// Least sum of squared distances.
    Optimal,
    /// The paper's annealed thin-plate mapping; optimal where that one has no answer: see [`tps::assign`].
    Tps {
        /// λ of the paper's E6, m².
        lambda_m2: f64,
    },
    /// The closest pair of drone and slot first.
    Greedy,
    /// Each drone the slot of its own index.
    Identity,
}

/// The slot of each drone, by index, no slot twice. Positions and slots in one frame, m, finite. Surplus slots stay
/// empty.
///
/// # Errors
/// [`TooFewSlots`].
pub fn assign_by(method: Reformation, positions: &[Vec2], slots: &[Vec2]) -> Result<Vec<usize>, TooFewSlots> {
    if slots.len() < positions.len() {
        return Err(TooFewSlots { drones: positions.len(), slots: slots.len() });
    }
    match method {
        Reformation::Optimal => assign(positions, slots),
        Reformation::Tps { lambda_m2 } => {
            tps::assign(positions, slots, lambda_m2).map_or_else(|| assign(positions, slots), Ok)
        }
        Reformation::Greedy => {
            let cost = |drone: usize, slot: usize| (positions[drone] - slots[slot]).norm_squared();
            Ok(cheapest_first(positions.len(), slots.len(), &cost))
        }
        Reformation::Identity => Ok((0..positions.len()).collect()),
    }
}

/// Takes the cheapest pair of what is left, again and again; ties: the lower drone, then the lower slot. At least as
/// many slots as drones.
pub(crate) fn cheapest_first(drones: usize, slots: usize, cost: &impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let mut free: Vec<usize> = (0..slots).collect();
    let best = |drone: usize, free: &[usize]| {
        let offers = free.iter().map(|&slot| (cost(drone, slot), slot));
        offers.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0))
    };
    let mut waiting: Vec<(usize, (f64, usize))> = (0..drones).map(|drone| (drone, best(drone, &free))).collect();
    let mut taken = vec![0; drones];
    while let Some(next) = (0..waiting.len()).min_by(|&a, &b| waiting[a].1.0.total_cmp(&waiting[b].1.0)) {
        let (drone, (_, slot)) = waiting.remove(next);
        taken[drone] = slot;
        free.retain(|&other| other != slot);
        for (other, offer) in waiting.iter_mut().filter(|(_, offer)| offer.1 == slot) {
            *offer = best(*other, &free);
        }
    }
    taken
}

/// The slot of each drone, by index, no slot twice, the sum of squared distances least (Jonker–Volgenant, O(n²·m)).
/// Positions and slots in one frame, m, finite. Surplus slots stay empty.
///
/// # Errors
/// [`TooFewSlots`].
pub fn assign(positions: &[Vec2], slots: &[Vec2]) -> Result<Vec<usize>, TooFewSlots> {
    if slots.len() < positions.len() {
        return Err(TooFewSlots { drones: positions.len(), slots: slots.len() });
    }
    let cost = |drone: usize, slot: usize| (positions[drone] - slots[slot]).norm_squared();
    let mut matching = Matching::new(positions.len(), slots.len());
    (0..positions.len()).for_each(|drone| matching.insert(drone, &cost));
    let mut taken = vec![0; positions.len()];
    for (slot, owner) in matching.owner.iter().enumerate() {
        if let Some(drone) = *owner {
            taken[drone] = slot;
        }
    }
    Ok(taken)
}

/// Drones placed so far, and the prices that prove it optimal.
struct Matching {
    owner: Vec<Option<usize>>,
    slot_price: Vec<f64>,
    drone_price: Vec<f64>,
}

impl Matching {
    fn new(drones: usize, slots: usize) -> Self {
        Self { owner: vec![None; slots], slot_price: vec![0.0; slots], drone_price: vec![0.0; drones] }
    }

    /// Places one more drone along a shortest augmenting path (Dijkstra over the slots, by reduced cost).
    fn insert(&mut self, drone: usize, cost: &impl Fn(usize, usize) -> f64) {
        let slots = self.owner.len();
        let mut distance = vec![f64::INFINITY; slots];
        let mut before: Vec<Option<usize>> = vec![None; slots];
        let mut settled: Vec<usize> = Vec::new();
        let mut open = vec![true; slots];
        let (mut reached, mut from, mut hand) = (0.0, None, drone);
        let free = loop {
            for slot in (0..slots).filter(|&slot| open[slot]) {
                let through = reached + cost(hand, slot) - self.drone_price[hand] - self.slot_price[slot];
                if through < distance[slot] {
                    (distance[slot], before[slot]) = (through, from);
                }
            }
            let nearest = (0..slots).filter(|&slot| open[slot]).min_by(|&a, &b| distance[a].total_cmp(&distance[b]));
            let Some(nearest) = nearest else { return };
            reached = distance[nearest];
            open[nearest] = false;
            let Some(owner) = self.owner[nearest] else { break nearest };
            settled.push(nearest);
            (from, hand) = (Some(nearest), owner);
        };
        self.drone_price[drone] += reached;
        for &slot in &settled {
            self.slot_price[slot] -= reached - distance[slot];
            if let Some(owner) = self.owner[slot] {
                self.drone_price[owner] += reached - distance[slot];
            }
        }
        let mut slot = free;
        while let Some(previous) = before[slot] {
            self.owner[slot] = self.owner[previous];
            slot = previous;
        }
        self.owner[slot] = Some(drone);
    }
}
