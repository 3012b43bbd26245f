//! Means and rates with 95 % confidence intervals.

use serde::{Deserialize, Serialize};

/// Two-sided 95 % point of the normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// A mean or a rate with its 95 % confidence interval. Without one, both ends are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Number of values.
    pub n: usize,
    /// The mean, or the rate.
    pub mean: f64,
    /// Lower end of the interval.
    pub low: Option<f64>,
    /// Upper end of the interval.
    pub high: Option<f64>,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
}

impl Estimate {
    /// Both ends of the interval.
    #[must_use]
    pub fn interval(&self) -> Option<[f64; 2]> {
        Some([self.low?, self.high?])
    }

    /// The same without its interval: its values are not independent of each other.
    #[must_use]
    pub fn without_interval(self) -> Self {
        Self { low: None, high: None, ..self }
    }
}

/// A success rate with Wilson's score interval; `None` if `n` is 0.
#[must_use]
pub fn rate(successes: usize, n: usize) -> Option<Estimate> {
    if n == 0 {
        return None;
    }
    let (count, p) = (n as f64, successes as f64 / n as f64);
    let z2 = Z * Z;
    let middle = (p + z2 / (2.0 * count)) / (1.0 + z2 / count);
    let half = Z * (p * (1.0 - p) / count + z2 / (4.0 * count * count)).sqrt() / (1.0 + z2 / count);
    let (min, max) = (if successes < n { 0.0 } else { 1.0 }, if successes > 0 { 1.0 } else { 0.0 });
    // Exact at both ends, where rounding would push the bound beyond the rate itself.
    let low = if successes == 0 { 0.0 } else { middle - half };
    let high = if successes == n { 1.0 } else { middle + half };
    Some(Estimate { n, mean: p, low: Some(low), high: Some(high), min, max })
}

/// With 95 % confidence, at most this share of runs fails if none of `n` has failed: the exact bound of Clopper and Pearson,
/// 1 - 0.05^(1/n), which is close to 3 / n (the rule of three). `None` if `n` is 0.
#[must_use]
pub fn failures_at_most(n: usize) -> Option<f64> {
    (n > 0).then(|| 1.0 - 0.05_f64.powf(1.0 / n as f64))
}

/// A mean with Student's t interval; `None` if there are no values. A single value has no interval.
#[must_use]
pub fn mean(values: &[f64]) -> Option<Estimate> {
    if values.is_empty() {
        return None;
    }
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n as f64;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let half = (n > 1).then(|| student(n - 1) * (squares / (n - 1) as f64 / n as f64).sqrt());
    let (min, max) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    Some(Estimate { n, mean, low: half.map(|half| mean - half), high: half.map(|half| mean + half), min, max })
}

/// Two-sided 95 % point of Student's t distribution: from a table up to 10 degrees of freedom, above by the Cornish-Fisher
/// expansion around the normal distribution, whose error is at most 0.001 there.
fn student(freedom: usize) -> f64 {
    const TABLE: [f64; 10] = [12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281];
    if let Some(&point) = TABLE.get(freedom.wrapping_sub(1)) {
        return point;
    }
    let nu = freedom as f64;
    let (z3, z5, z7) = (Z.powi(3), Z.powi(5), Z.powi(7));
    Z + (z3 + Z) / (4.0 * nu)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * Z) / (96.0 * nu.powi(2))
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * Z) / (384.0 * nu.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Published values: Newcombe 1998, table I (81 of 263, 15 of 148, 0 of 20, 1 of 29).
    #[test]
    fn wilson_intervals_are_the_published_ones() {
        for (r, n, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let found = rate(r, n).unwrap();
            let [from, to] = found.interval().unwrap();
            assert!((from - low).abs() < 5e-5 && (to - high).abs() < 5e-5, "{r} of {n}: {found:?}");
        }
        let all = rate(30, 30).unwrap();
        assert_eq!((all.mean, all.high), (1.0, Some(1.0)));
        assert!((all.low.unwrap() - 0.8865).abs() < 5e-5, "{all:?}");
        assert_eq!(rate(0, 0), None);
    }

    #[test]
    fn without_a_failure_the_bound_is_that_of_clopper_and_pearson() {
        // None of 10, 30, 1000: 25.89 %, 9.503 %, 0.2991 % (exact tables).
        for (n, bound) in [(10, 0.2589), (30, 0.09503), (1000, 0.002991)] {
            let found = failures_at_most(n).unwrap();
            assert!((found - bound).abs() < 5e-5, "{n}: {found}");
            // The chance of no failure at that share is 5 %.
            assert!(((1.0 - found).powi(n as i32) - 0.05).abs() < 1e-9);
        }
        assert_eq!(failures_at_most(0), None);
    }

    #[test]
    fn student_points_are_the_tabled_ones() {
        for (freedom, point) in [(1, 12.7062), (5, 2.5706), (11, 2.2010), (29, 2.0452), (60, 2.0003), (1000, 1.9623)] {
            assert!((student(freedom) - point).abs() < 1e-3, "{freedom}: {}", student(freedom));
        }
    }

    #[test]
    fn mean_and_interval_of_known_values() {
        // 2, 4, 6: standard deviation 2, 4.3027 · 2 / √3 = 4.9683.
        let found = mean(&[2.0, 4.0, 6.0]).unwrap();
        assert!((found.mean - 4.0).abs() < 1e-12 && (found.high.unwrap() - 8.9683).abs() < 1e-3, "{found:?}");
        assert_eq!((found.n, found.min, found.max), (3, 2.0, 6.0));
        let one = mean(&[5.0]).unwrap();
        assert_eq!((one.mean, one.interval()), (5.0, None));
        assert_eq!(mean(&[]), None);
    }
}
