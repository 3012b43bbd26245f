//! Equation E6 of the paper: the thin-plate spline between two point sets, and its bending energy. Both the reformation and
//! a run's report use it.

use crate::Vec2;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Eigenvalues below this fraction of the largest are treated as zero: they come from coincident or collinear points.
const SINGULAR: f64 = 1e-12;
/// For a sum f of kernels r² ln r with weights w, ∬|D²f|² equals this factor times wᵀKw, because Δ²(r² ln r) = 8π δ.
const BIHARMONIC: f64 = 8.0 * std::f64::consts::PI;

/// The two terms of the paper's equation E6.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BendingEnergy {
    /// Data term Σ‖x_i − f(v_i)‖², m².
    pub data_m2: f64,
    /// Bending term ∬(f_xx² + 2 f_xy² + f_yy²) dx dy, summed over both coordinates of f; dimensionless.
    pub bending: f64,
}

impl BendingEnergy {
    /// The weighted sum of both terms, data + λ · bending, m²; λ in m².
    #[must_use]
    pub fn total_m2(&self, lambda_m2: f64) -> f64 {
        self.data_m2 + lambda_m2 * self.bending
    }
}

/// The energy of the spline that maps each point of `from` to its partner in `to` with the least energy by E6; points and
/// targets in m, λ in m². The energy measures how far `to` is from being an affine image of `from`. `None` if the numbers
/// of points differ, a number is not finite, λ is negative, or the eigenvalue solver does not converge.
#[must_use]
pub fn bending_energy(from: &[Vec2], to: &[Vec2], lambda_m2: f64) -> Option<BendingEnergy> {
    Some(ThinPlate::new(from, lambda_m2)?.fit(to)?.energy(to))
}

/// Whether every coordinate is finite.
#[must_use]
pub fn is_finite(points: &[Vec2]) -> bool {
    points.iter().all(|p| p.x.is_finite() && p.y.is_finite())
}

/// The points relative to their mean.
#[must_use]
pub fn centred(points: &[Vec2]) -> Vec<Vec2> {
    let mean = points.iter().sum::<Vec2>() / points.len().max(1) as f64;
    points.iter().map(|point| point - mean).collect()
}

/// A factorised system for splines over the same points with the same λ. Internally, the points are relative to their mean
/// and scaled so that the greatest distance from it is 1.
#[derive(Clone, Debug)]
pub struct ThinPlate {
    points: Vec<Vec2>,
    size_m: f64,
    /// Unit of the affine coefficients. It keeps the system well conditioned for every λ.
    affine: f64,
    eigen: SymmetricEigen<f64, nalgebra::Dyn>,
}

/// A fitted spline: for each coordinate, one weight per point, then the three affine coefficients.
#[derive(Clone, Debug)]
pub struct Spline<'a> {
    plate: &'a ThinPlate,
    x: DVector<f64>,
    y: DVector<f64>,
}

impl ThinPlate {
    /// Prepares splines over `points` (m) with stiffness λ (m²). `None` if a point or λ is not finite, λ is negative, or the
    /// eigenvalue solver does not converge.
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

    /// The spline of least energy from the points to the targets `to`, m. If the points do not determine it (collinear or
    /// coincident points), the result is the solution with the smallest coefficients. `None` if the number of targets
    /// differs from the number of points, or if a target is not finite.
    #[must_use]
    pub fn fit(&self, to: &[Vec2]) -> Option<Spline<'_>> {
        if to.len() != self.points.len() || !is_finite(to) {
            return None;
        }
        let solve_axis = |coordinate: fn(&Vec2) -> f64| {
            let rows = to.iter().map(coordinate).chain([0.0; 3]);
            self.solve(&DVector::from_iterator(to.len() + 3, rows))
        };
        Some(Spline { plate: self, x: solve_axis(|t| t.x), y: solve_axis(|t| t.y) })
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
    /// The image f(v_i) of each point, m.
    #[must_use]
    pub fn image(&self) -> Vec<Vec2> {
        self.plate.points.iter().map(|&point| self.at(point)).collect()
    }

    /// The image of a point, m. `point` is in the plate's scaled units.
    fn at(&self, point: Vec2) -> Vec2 {
        let kernels = self.plate.points.iter().map(|other| kernel((point - other).norm()));
        let terms = kernels.chain(affine_row(point, self.plate.affine)).enumerate();
        terms.map(|(i, term)| Vec2::new(self.x[i], self.y[i]) * term).sum()
    }

    /// The spline's energy by E6. `to` must be the targets to which the spline was fitted, m.
    #[must_use]
    pub fn energy(&self, to: &[Vec2]) -> BendingEnergy {
        let image = self.image();
        let data_m2 = image.iter().zip(to).map(|(f, t)| (f - t).norm_squared()).sum();
        let points = &self.plate.points;
        let weight = |i: usize| Vec2::new(self.x[i], self.y[i]);
        let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let sum: f64 =
            pairs.map(|(i, j)| 2.0 * kernel((points[i] - points[j]).norm()) * weight(i).dot(&weight(j))).sum();
        // `sum` is in the plate's scaled units. The integral in metres is smaller by the square of the size.
        let bending = (BIHARMONIC * sum).max(0.0) / (self.plate.size_m * self.plate.size_m);
        BendingEnergy { data_m2, bending }
    }
}

/// The kernel r² ln r, 0 at r = 0.
fn kernel(r: f64) -> f64 {
    if r > 0.0 { r * r * r.ln() } else { 0.0 }
}

fn affine_row(point: Vec2, unit: f64) -> [f64; 3] {
    [unit, unit * point.x, unit * point.y]
}

/// The matrix [K + 8πλ·I, P; Pᵀ, 0]. The rows of P are (1, x, y) times `affine`; `stiffness` is 8πλ in scaled units.
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
    fn the_bending_term_equals_the_integral_of_squared_second_derivatives() {
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
        assert!(
            (integral * area / bending - 1.0).abs() < 0.03,
            "numerical integral {}, bending term {bending}",
            integral * area
        );
    }
}
