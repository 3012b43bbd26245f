//! The paper's E6: the thin-plate spline between two point sets, and how much it bends. Pure mathematics that both the
//! reformation and a run's report need.

use crate::Vec2;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

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

/// Whether no coordinate is infinite or no number.
#[must_use]
pub fn is_finite(points: &[Vec2]) -> bool {
    points.iter().all(|p| p.x.is_finite() && p.y.is_finite())
}

/// The points about their mean.
#[must_use]
pub fn centred(points: &[Vec2]) -> Vec<Vec2> {
    let mean = points.iter().sum::<Vec2>() / points.len().max(1) as f64;
    points.iter().map(|point| point - mean).collect()
}

/// Splines over the same points with the same λ. Inside, the points are centred and of size one.
#[derive(Clone, Debug)]
pub struct ThinPlate {
    points: Vec<Vec2>,
    size_m: f64,
    /// The unit of the affine coefficients, so that the system stays well conditioned whatever λ.
    affine: f64,
    eigen: SymmetricEigen<f64, nalgebra::Dyn>,
}

/// One such spline: a weight for each point, then the affine part.
#[derive(Clone, Debug)]
pub struct Spline<'a> {
    plate: &'a ThinPlate,
    x: DVector<f64>,
    y: DVector<f64>,
}

impl ThinPlate {
    /// `None` if λ (m²) or a point is out of range.
    #[must_use]
    pub fn new(points: &[Vec2], lambda_m2: f64) -> Option<Self> {
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
    #[must_use]
    pub fn fit(&self, to: &[Vec2]) -> Option<Spline<'_>> {
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
    #[must_use]
    pub fn image(&self) -> Vec<Vec2> {
        self.plate.points.iter().map(|&point| self.at(point)).collect()
    }

    /// f of a point in the plate's units, m.
    fn at(&self, point: Vec2) -> Vec2 {
        let kernels = self.plate.points.iter().map(|other| kernel((point - other).norm()));
        let terms = kernels.chain(affine_row(point, self.plate.affine)).enumerate();
        terms.map(|(i, term)| Vec2::new(self.x[i], self.y[i]) * term).sum()
    }

    /// Its energy, by E6, over the targets it was fitted to, m.
    #[must_use]
    pub fn energy(&self, to: &[Vec2]) -> BendingEnergy {
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
