//! The paper's reformation (Algorithm 5): the matching of two point sets by deterministic annealing, with a thin-plate
//! spline between them (TPS-RPM: H. Chui, A. Rangarajan, "A new point matching algorithm for non-rigid registration",
//! 2003).

use crate::slots::cheapest_first;
use nalgebra::DMatrix;
use skein_protocol::Vec2;
use skein_protocol::thin_plate::{ThinPlate, centred, is_finite};

/// Above so many slots a mapping takes seconds.
const SLOTS_MAX: usize = 200;
/// The annealing starts at this temperature, as a part of the greatest squared distance: hotter, all drones would be
/// sent to the centre and the spline would follow, forgetting where they are; …
const HOT: f64 = 0.1;
/// … ends at this one, …
const COLD: f64 = 1e-5;
/// … and cools by this factor.
const COOLING: f64 = 0.8;
/// Sinkhorn rounds at one temperature, at most.
const ROUNDS: usize = 20;
/// They end when no row's sum is farther from one than this.
const BALANCED: f64 = 1e-3;
/// A matching of drones and slots, the slot of each drone by index, no slot twice. Positions and slots in one frame, m.
///
/// Soft assignment (Sinkhorn in the log domain) whose temperature falls until each drone has one slot. With λ > 0 the
/// distances are measured from f(position), f being fitted to the soft assignment at each temperature, so that the
/// order of the formation is kept. With λ = 0 they are the drones' own: a spline that costs nothing would go wherever
/// the soft assignment is, and decide nothing.
///
/// `None` for more than 200 slots, fewer slots than drones, or input out of range.
#[must_use]
pub fn assign(positions: &[Vec2], slots: &[Vec2], lambda_m2: f64) -> Option<Vec<usize>> {
    let sane = is_finite(positions) && is_finite(slots) && lambda_m2 >= 0.0;
    if !sane || slots.len() > SLOTS_MAX || slots.len() < positions.len() {
        return None;
    }
    let (from, to) = (centred(positions), centred(slots));
    let plate = if lambda_m2 > 0.0 { Some(ThinPlate::new(&from, lambda_m2)?) } else { None };
    let mut soft = Softassign::new(from.len(), to.len());
    let mut image = from;
    let spread = image.iter().flat_map(|f| to.iter().map(move |t| (f - t).norm_squared())).fold(0.0, f64::max);
    let mut temperature = HOT * spread;
    while temperature > COLD * spread {
        soft.balance(&image, &to, temperature);
        if let Some(plate) = &plate {
            image = plate.fit(&soft.means(&to, temperature))?.image();
        }
        temperature *= COOLING;
    }
    Some(cheapest_first(image.len(), to.len(), &|drone, slot| soft.price(drone, slot)))
}

/// A doubly stochastic matrix m_ij = exp((u_i + v_j − c_ij) / temperature). Slots without a drone go to stand-ins, for
/// whom all slots cost nothing.
struct Softassign {
    drones: usize,
    cost: DMatrix<f64>,
    row: Vec<f64>,
    column: Vec<f64>,
}

impl Softassign {
    fn new(drones: usize, slots: usize) -> Self {
        Self { drones, cost: DMatrix::zeros(slots, slots), row: vec![0.0; slots], column: vec![0.0; slots] }
    }

    /// Costs are the squared distances. Scales rows and columns in turn until their sums are one.
    fn balance(&mut self, from: &[Vec2], to: &[Vec2], temperature: f64) {
        let slots = to.len();
        for (i, j) in (0..self.drones).flat_map(|i| (0..slots).map(move |j| (i, j))) {
            self.cost[(i, j)] = (from[i] - to[j]).norm_squared();
        }
        for _ in 0..ROUNDS {
            let mut change = 0.0f64;
            for i in 0..slots {
                let scaled = soft_min((0..slots).map(|j| self.cost[(i, j)] - self.column[j]), temperature);
                change = change.max((scaled - self.row[i]).abs());
                self.row[i] = scaled;
            }
            for j in 0..slots {
                self.column[j] = soft_min((0..slots).map(|i| self.cost[(i, j)] - self.row[i]), temperature);
            }
            if change < BALANCED * temperature {
                return;
            }
        }
    }

    /// −temperature · ln m_ij: the smaller, the surer.
    fn price(&self, drone: usize, slot: usize) -> f64 {
        self.cost[(drone, slot)] - self.row[drone] - self.column[slot]
    }

    /// Where each drone is sent, all its slots weighed.
    fn means(&self, to: &[Vec2], temperature: f64) -> Vec<Vec2> {
        let mean = |drone: usize| {
            let weights: Vec<f64> = (0..to.len()).map(|j| (-self.price(drone, j) / temperature).exp()).collect();
            let sum: Vec2 = to.iter().zip(&weights).map(|(t, w)| t * *w).sum();
            sum / weights.iter().sum::<f64>()
        };
        (0..self.drones).map(mean).collect()
    }
}

/// −t · ln Σ exp(−x / t), about the least value so that nothing overflows.
fn soft_min(values: impl Iterator<Item = f64> + Clone, temperature: f64) -> f64 {
    let least = values.clone().fold(f64::INFINITY, f64::min);
    least - temperature * values.map(|x| ((least - x) / temperature).exp()).sum::<f64>().ln()
}
