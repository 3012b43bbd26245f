//! Pairs of points that are close to each other, found without a test of all pairs.

use skein_protocol::Vec2;

/// A point of a plane or of space, m.
type Point<const D: usize> = nalgebra::SVector<f64, D>;

/// Sweep along that of the two horizontal axes on which the points extend farther. The order is kept from tick to tick, so that sorting is
/// cheap.
#[derive(Default)]
pub(crate) struct Sweep {
    order: Vec<usize>,
    axis: usize,
}

impl Sweep {
    /// The least distance of two points, m; `None` for fewer than two points.
    pub(crate) fn least_distance<const D: usize>(&mut self, points: &[Point<D>]) -> Option<f64> {
        self.sort(points);
        let mut least = f64::INFINITY;
        for (place, &a) in self.order.iter().enumerate() {
            for &b in &self.order[place + 1..] {
                let apart = points[b] - points[a];
                if apart[self.axis].powi(2) > least {
                    break;
                }
                least = least.min(apart.norm_squared());
            }
        }
        least.is_finite().then(|| least.sqrt())
    }

    /// Calls `pair` with the indices and the squared distance of each pair of points closer than `reach`, or of all
    /// pairs if `reach` is `None`.
    pub(crate) fn pairs(&mut self, points: &[Vec2], reach: Option<f64>, mut pair: impl FnMut(usize, usize, f64)) {
        self.sort(points);
        let limit = reach.map_or(f64::INFINITY, |reach| reach * reach);
        for (place, &a) in self.order.iter().enumerate() {
            for &b in &self.order[place + 1..] {
                let apart = points[b] - points[a];
                if apart[self.axis].powi(2) > limit {
                    break;
                }
                let squared = apart.norm_squared();
                if squared < limit {
                    pair(a, b, squared);
                }
            }
        }
    }

    fn sort<const D: usize>(&mut self, points: &[Point<D>]) {
        if self.order.len() != points.len() {
            self.order = (0..points.len()).collect();
        }
        let empty: (Point<D>, Point<D>) = (Point::repeat(f64::INFINITY), Point::repeat(f64::NEG_INFINITY));
        let (low, high) = points.iter().fold(empty, |(low, high), p| (low.inf(p), high.sup(p)));
        self.axis = usize::from((high - low)[1] > (high - low)[0]);
        let axis = self.axis;
        self.order.sort_by(|&a, &b| points[a][axis].total_cmp(&points[b][axis]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_result_equals_that_of_a_test_of_all_pairs(
            points in prop::collection::vec((-9.0..9.0, -3.0..3.0).prop_map(|(x, y)| Vec2::new(x, y)), 0..30),
            reach in 0.0..12.0f64,
        ) {
            let mut sweep = Sweep::default();
            let mut least: Option<f64> = None;
            let mut close = Vec::new();
            for b in 0..points.len() {
                for a in 0..b {
                    let distance = (points[a] - points[b]).norm();
                    least = Some(least.map_or(distance, |least| least.min(distance)));
                    if distance < reach {
                        close.push((a, b));
                    }
                }
            }
            prop_assert_eq!(sweep.least_distance(&points), least);
            let mut found = Vec::new();
            sweep.pairs(&points, Some(reach), |a, b, _| found.push((a.min(b), a.max(b))));
            found.sort_by_key(|&(a, b)| (b, a));
            prop_assert_eq!(found, close);
        }
    }
}
