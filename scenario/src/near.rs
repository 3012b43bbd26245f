//! Points that are too close to each other or to an obstacle. All lengths are in metres.

use skein_protocol::Vec2;
use skein_protocol::shape::ConvexShape;

/// The closest of the pairs that are closer than a limit.
pub(crate) struct ClosePair {
    pub(crate) pair: (usize, usize),
    pub(crate) distance_m: f64,
    /// The number of pairs that are closer than the limit.
    pub(crate) pairs: usize,
}

/// The closest of the slots that are closer to an obstacle than a limit.
pub(crate) struct CloseSlot {
    pub(crate) slot: usize,
    /// 0 inside the obstacle.
    pub(crate) distance_m: f64,
    /// The number of slots that are closer than the limit.
    pub(crate) slots: usize,
}

/// The closest two points, if they are closer than `limit_m`.
pub(crate) fn closest_pair(points: &[Vec2], limit_m: f64) -> Option<ClosePair> {
    // A sweep along the axis on which the points spread the most: fast even for ten thousand points in a line.
    let (low, high) =
        points.iter().fold((Vec2::repeat(f64::MAX), Vec2::repeat(f64::MIN)), |(l, h), p| (l.inf(p), h.sup(p)));
    let axis = usize::from(high.y - low.y > high.x - low.x);
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a][axis].total_cmp(&points[b][axis]));
    let mut close: Option<ClosePair> = None;
    for (i, &a) in order.iter().enumerate() {
        for &b in order[i + 1..].iter().take_while(|&&b| points[b][axis] - points[a][axis] < limit_m) {
            let distance_m = (points[a] - points[b]).norm();
            if distance_m < limit_m {
                let found = ClosePair { pair: (a.min(b), a.max(b)), distance_m, pairs: 1 };
                close = Some(match close {
                    None => found,
                    Some(best) => {
                        let pairs = best.pairs + 1;
                        let nearer = if best.distance_m <= found.distance_m { best } else { found };
                        ClosePair { pairs, ..nearer }
                    }
                });
            }
        }
    }
    close
}

/// The slot closest to the shape, if it is closer than `limit_m`.
pub(crate) fn closest_slot(shape: &ConvexShape, slots: &[Vec2], limit_m: f64) -> Option<CloseSlot> {
    let (low, high) = shape.bounds();
    let boxed = |p: &Vec2| (low - p).max().max((p - high).max()) < limit_m;
    let near = slots.iter().enumerate().filter(|(_, p)| boxed(p)).map(|(slot, &p)| (slot, shape.distance_m(p)));
    let near: Vec<(usize, f64)> = near.filter(|&(_, d)| d < limit_m).collect();
    let &(slot, distance_m) = near.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(CloseSlot { slot, distance_m, slots: near.len() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn the_sweep_finds_what_comparing_all_pairs_finds(
            points in proptest::collection::vec((-20.0..20.0f64, -40.0..40.0f64), 2..20),
            limit_m in 0.5..30.0f64,
        ) {
            let points: Vec<Vec2> = points.into_iter().map(|(x, y)| Vec2::new(x, y)).collect();
            let pairs = (0..points.len()).flat_map(|a| (a + 1..points.len()).map(move |b| (a, b)));
            let all: Vec<f64> = pairs.map(|(a, b)| (points[a] - points[b]).norm()).filter(|d| *d < limit_m).collect();
            let found = closest_pair(&points, limit_m);
            prop_assert_eq!(found.as_ref().map_or(0, |f| f.pairs), all.len());
            if let Some(found) = found {
                prop_assert_eq!(found.distance_m, all.iter().copied().fold(f64::INFINITY, f64::min));
            }
        }
    }
}
