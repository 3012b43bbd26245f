//! The paper's reformation (Algorithm 5, E6): a thin-plate spline between two point sets, and the matching of the sets
//! by deterministic annealing (TPS-RPM: H. Chui, A. Rangarajan, "A new point matching algorithm for non-rigid
//! registration", 2003).

use crate::slots::cheapest_first;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use skein_protocol::Vec2;

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
/// Eigenvalues smaller than this, as a part of the greatest, are those of coincident or collinear points.
const SINGULAR: f64 = 1e-12;
/// ∬|D²f|² of a sum of kernels r² ln r with weights w is so many times wᵀKw: Δ²(r² ln r) = 8π δ.
const BIHARMONIC: f64 = 8.0 * std::f64::consts::PI;

/// The terms of the paper's E6.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BendingEnergy {
    /// Σ‖x_i − f(v_i)‖², m².
    pub data_m2: f64,
    /// ∬(f_xx² + 2 f_xy² + f_yy²) dx dy, both coordinates of f summed; dimensionless.
    pub bending: f64,
}

impl BendingEnergy {
    /// Both terms together, m².
    #[must_use]
    pub fn total_m2(&self, lambda_m2: f64) -> f64 {
        self.data_m2 + lambda_m2 * self.bending
    }
}

/// The energy of the spline that takes `from` to `to`, pair by pair, best by E6: how far the second is from being an
/// affine image of the first. `None` if the numbers of points differ, something is not finite, or λ is negative.
#[must_use]
pub fn bending_energy(from: &[Vec2], to: &[Vec2], lambda_m2: f64) -> Option<BendingEnergy> {
    Some(ThinPlate::new(from, lambda_m2)?.fit(to)?.energy(to))
}

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

fn is_finite(points: &[Vec2]) -> bool {
    points.iter().all(|p| p.x.is_finite() && p.y.is_finite())
}

fn centred(points: &[Vec2]) -> Vec<Vec2> {
    let mean = points.iter().sum::<Vec2>() / points.len().max(1) as f64;
    points.iter().map(|point| point - mean).collect()
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

/// Splines over the same points with the same λ. Inside, the points are centred and of size one.
struct ThinPlate {
    points: Vec<Vec2>,
    size_m: f64,
    /// The unit of the affine coefficients, so that the system stays well conditioned whatever λ.
    affine: f64,
    eigen: SymmetricEigen<f64, nalgebra::Dyn>,
}

/// One such spline: a weight for each point, then the affine part.
struct Spline<'a> {
    plate: &'a ThinPlate,
    x: DVector<f64>,
    y: DVector<f64>,
}

impl ThinPlate {
    /// `None` if λ or a point is out of range.
    fn new(points: &[Vec2], lambda_m2: f64) -> Option<Self> {
        if !is_finite(points) || !lambda_m2.is_finite() || lambda_m2 < 0.0 {
            return None;
        }
        let points = centred(points);
        let largest = points.iter().map(|p| p.norm()).fold(0.0, f64::max);
        let size_m = if largest > 0.0 { largest } else { 1.0 };
        let points: Vec<Vec2> = points.iter().map(|p| p / size_m).collect();
        let stiffness = BIHARMONIC * lambda_m2 / (size_m * size_m);
        let affine = stiffness.max(1.0);
        let eigen = SymmetricEigen::try_new(system(&points, stiffness, affine), f64::EPSILON, 10_000)?;
        Some(Self { points, size_m, affine, eigen })
    }

    /// The spline of least energy. Where the points leave it open (collinear, coincident), the one with the smallest
    /// coefficients. `None` if the targets are not as many as the points, or out of range.
    fn fit(&self, to: &[Vec2]) -> Option<Spline<'_>> {
        if to.len() != self.points.len() || !is_finite(to) {
            return None;
        }
        let side = |of: fn(&Vec2) -> f64| {
            let rows = to.iter().map(of).chain([0.0; 3]);
            self.solve(&DVector::from_iterator(to.len() + 3, rows))
        };
        Some(Spline { plate: self, x: side(|t| t.x), y: side(|t| t.y) })
    }

    fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let least = SINGULAR * self.eigen.eigenvalues.amax();
        let mut parts = self.eigen.eigenvectors.tr_mul(right);
        for (part, value) in parts.iter_mut().zip(&self.eigen.eigenvalues) {
            *part = if value.abs() > least { *part / value } else { 0.0 };
        }
        &self.eigen.eigenvectors * parts
    }
}

impl Spline<'_> {
    /// f of each point, m.
    fn image(&self) -> Vec<Vec2> {
        self.plate.points.iter().map(|&point| self.at(point)).collect()
    }

    /// f of a point in the plate's units, m.
    fn at(&self, point: Vec2) -> Vec2 {
        let kernels = self.plate.points.iter().map(|other| kernel((point - other).norm()));
        let terms = kernels.chain(affine_row(point, self.plate.affine)).enumerate();
        terms.map(|(i, term)| Vec2::new(self.x[i], self.y[i]) * term).sum()
    }

    fn energy(&self, to: &[Vec2]) -> BendingEnergy {
        let image = self.image();
        let data_m2 = image.iter().zip(to).map(|(f, t)| (f - t).norm_squared()).sum();
        let points = &self.plate.points;
        let weight = |i: usize| Vec2::new(self.x[i], self.y[i]);
        let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let sum: f64 =
            pairs.map(|(i, j)| 2.0 * kernel((points[i] - points[j]).norm()) * weight(i).dot(&weight(j))).sum();
        // In the plate's units of length; the integral of second derivatives in metres is smaller by the size squared.
        let bending = (BIHARMONIC * sum).max(0.0) / (self.plate.size_m * self.plate.size_m);
        BendingEnergy { data_m2, bending }
    }
}

/// r² ln r.
fn kernel(r: f64) -> f64 {
    if r > 0.0 { r * r * r.ln() } else { 0.0 }
}

fn affine_row(point: Vec2, unit: f64) -> [f64; 3] {
    [unit, unit * point.x, unit * point.y]
}

/// [K + 8πλ·I, P; Pᵀ, 0] with the rows (1, x, y) in P.
fn system(points: &[Vec2], stiffness: f64, affine: f64) -> DMatrix<f64> {
    let count = points.len();
    let entry = |i: usize, j: usize| match (points.get(i), points.get(j)) {
        (Some(_), Some(_)) if i == j => stiffness,
        (Some(a), Some(b)) => kernel((a - b).norm()),
        (Some(p), None) | (None, Some(p)) => affine_row(*p, affine)[i.max(j) - count],
        (None, None) => 0.0,
    };
    DMatrix::from_fn(count + 3, count + 3, entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bending_term_is_the_integral_of_the_second_derivatives() {
        let from = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (0.0, 0.0)].map(|(x, y)| Vec2::new(x, y));
        let mut to = from;
        to[4].x += 1.0;
        let plate = ThinPlate::new(&from, 0.5).unwrap();
        let spline = plate.fit(&to).unwrap();
        let step = 0.02;
        let f = |x: i32, y: i32| spline.at(Vec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * step).x;
        let density = |x: i32, y: i32| {
            let xx = f(x + 1, y) - 2.0 * f(x, y) + f(x - 1, y);
            let yy = f(x, y + 1) - 2.0 * f(x, y) + f(x, y - 1);
            let xy = (f(x + 1, y + 1) - f(x + 1, y - 1) - f(x - 1, y + 1) + f(x - 1, y - 1)) / 4.0;
            (xx * xx + 2.0 * xy * xy + yy * yy) / step.powi(4)
        };
        let area = (step / plate.size_m).powi(2);
        let integral: f64 =
            (-250..250).flat_map(|x| (-250..250).map(move |y| (x, y))).map(|(x, y)| density(x, y)).sum();
        let bending = spline.energy(&to).bending;
        assert!((integral * area / bending - 1.0).abs() < 0.03, "{} is not {bending}", integral * area);
    }
}
