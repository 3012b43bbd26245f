//! The paper's reformation (Algorithm 5): the matching of two point sets by deterministic annealing, with a thin-plate
//! spline between them (TPS-RPM: H. Chui, A. Rangarajan, "A new point matching algorithm for non-rigid registration",
//! 2003).

use crate::matching::cheapest_first;
use crate::tuning::{BALANCED, COOLING, FINAL_TEMPERATURE, INITIAL_TEMPERATURE, SINKHORN_ROUNDS};
use nalgebra::DMatrix;
use skein_protocol::Vec2;
use skein_protocol::thin_plate::{ThinPlate, centred, is_finite};

/// Most slots. A mapping of more takes seconds.
const MAX_SLOTS: usize = 200;

/// The slot of each drone, by index, no slot twice. Positions and slots are in one frame, m.
///
/// A soft assignment (Sinkhorn in the log domain) is annealed until each drone has one slot. With λ > 0 (m²) distances
/// are measured from f(position). The spline f is fitted to the soft assignment at each temperature, so that the order of
/// the formation is kept. With λ = 0 distances are measured from the positions: a spline without cost would follow the
/// soft assignment and decide nothing.
///
/// `None` for more than 200 slots, for fewer slots than drones, and for input that is not finite.
#[must_use]
pub fn assign(positions: &[Vec2], slots: &[Vec2], lambda_m2: f64) -> Option<Vec<usize>> {
    let sane = is_finite(positions) && is_finite(slots) && lambda_m2 >= 0.0;
    if !sane || slots.len() > MAX_SLOTS || slots.len() < positions.len() {
        return None;
    }
    let (from, to) = (centred(positions), centred(slots));
    let plate = if lambda_m2 > 0.0 { Some(ThinPlate::new(&from, lambda_m2)?) } else { None };
    let mut soft = Softassign::new(from.len(), to.len());
    let mut image = from;
    let spread = image.iter().flat_map(|f| to.iter().map(move |t| (f - t).norm_squared())).fold(0.0, f64::max);
    let mut temperature = INITIAL_TEMPERATURE * spread;
    while temperature > FINAL_TEMPERATURE * spread {
        soft.balance(&image, &to, temperature);
        if let Some(plate) = &plate {
            image = plate.fit(&soft.means(&to, temperature))?.image();
        }
        temperature *= COOLING;
    }
    Some(cheapest_first(image.len(), to.len(), &|drone, slot| soft.price(drone, slot)))
}

/// A doubly stochastic matrix m_ij = exp((u_i + v_j − c_ij) / temperature). Surplus slots go to dummy drones, for which all
/// slots cost nothing.
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

    /// Sets the costs to the squared distances. Then scales rows and columns in turn until their sums are one.
    fn balance(&mut self, from: &[Vec2], to: &[Vec2], temperature: f64) {
        let slots = to.len();
        for (i, j) in (0..self.drones).flat_map(|i| (0..slots).map(move |j| (i, j))) {
            self.cost[(i, j)] = (from[i] - to[j]).norm_squared();
        }
        for _ in 0..SINKHORN_ROUNDS {
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

    /// −temperature · ln m_ij: small for a likely pair.
    fn price(&self, drone: usize, slot: usize) -> f64 {
        self.cost[(drone, slot)] - self.row[drone] - self.column[slot]
    }

    /// The mean of the slots of each drone, weighted by the matrix.
    fn means(&self, to: &[Vec2], temperature: f64) -> Vec<Vec2> {
        let mean = |drone: usize| {
            let weights: Vec<f64> = (0..to.len()).map(|j| (-self.price(drone, j) / temperature).exp()).collect();
            let sum: Vec2 = to.iter().zip(&weights).map(|(t, w)| t * *w).sum();
            sum / weights.iter().sum::<f64>()
        };
        (0..self.drones).map(mean).collect()
    }
}

/// −t · ln Σ exp(−x / t), computed relative to the least value to avoid overflow.
fn soft_min(values: impl Iterator<Item = f64> + Clone, temperature: f64) -> f64 {
    let least = values.clone().fold(f64::INFINITY, f64::min);
    least - temperature * values.map(|x| ((least - x) / temperature).exp()).sum::<f64>().ln()
}
