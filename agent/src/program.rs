//! The small quadratic program behind the safety filter: the acceleration nearest to the wanted one that keeps every
//! half-plane and the greatest acceleration; where that is impossible, one that breaks them least, tier by tier.
//!
//! Incremental, as in two-dimensional linear programming: half-planes are added one by one, and whenever the optimum so
//! far is cut off, the new one lies on the border just added. No allocation once its memory has grown.

use skein_protocol::Vec2;
use std::ops::Range;

/// The half-plane `normal · a ≥ bound`; `normal` has length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfPlane {
    /// Unit normal, pointing inside.
    pub normal: Vec2,
    /// m/s².
    pub bound: f64,
}

impl HalfPlane {
    fn violation(&self, a: Vec2) -> f64 {
        self.bound - self.normal.dot(&a)
    }
}

/// Below this, two borders are parallel.
const PARALLEL: f64 = 1e-9;
/// A border that is missed by less is kept, m/s²: two that are nearly one must not contradict each other.
const KEPT_MPS2: f64 = 1e-9;

/// Where not everything can be kept, this much more than has to be is given up, m/s²: at the very least, a
/// direction that hardly matters would be taken to the utmost.
const GIVE_MPS2: f64 = 0.1;

/// Memory for [`Program::solve`], kept from call to call.
#[derive(Clone, Debug, Default)]
pub struct Program {
    relaxed: Vec<HalfPlane>,
    projected: Vec<HalfPlane>,
}

/// What is looked for on a border: the point nearest to one, or the farthest in a direction.
#[derive(Clone, Copy)]
enum Goal {
    Nearest(Vec2),
    Farthest(Vec2),
}

impl Program {
    /// The acceleration nearest to `wanted` within `limit` that keeps all `planes`. If not all can be kept, those of
    /// one tier, `tiers` being where they end, come before those of the next: within a tier the greatest violation is
    /// made least.
    pub fn solve(&mut self, planes: &[HalfPlane], tiers: [usize; 2], limit: f64, wanted: Vec2) -> Vec2 {
        let goal = Goal::Nearest(wanted);
        if let Ok(a) = optimum(planes, limit, goal) {
            return a;
        }
        self.relaxed.clear();
        self.relaxed.extend_from_slice(planes);
        let mut from = 0;
        for to in tiers.into_iter().chain([planes.len()]) {
            if let Err((failed, a)) = optimum(&self.relaxed[..to], limit, goal) {
                let a = self.least_violation(from..to, limit, (failed, a));
                let tier = &mut self.relaxed[from..to];
                let worst = tier.iter().map(|plane| plane.violation(a)).fold(0.0, f64::max);
                tier.iter_mut().for_each(|plane| plane.bound -= worst + GIVE_MPS2);
            }
            from = to;
        }
        optimum(&self.relaxed, limit, goal).unwrap_or_else(|(_, a)| a)
    }

    /// From plane `failed` on, moves along: each plane of the tier that is broken by more than those before is made as
    /// little broken as the earlier ones allow; those before the tier are kept.
    fn least_violation(&mut self, tier: Range<usize>, limit: f64, (failed, start): (usize, Vec2)) -> Vec2 {
        let (mut best, mut worst) = (start, 0.0);
        for i in failed.max(tier.start)..tier.end {
            let plane = self.relaxed[i];
            if plane.violation(best) <= worst {
                continue;
            }
            self.projected.clear();
            self.projected.extend_from_slice(&self.relaxed[..tier.start]);
            for earlier in &self.relaxed[tier.start..i] {
                // Where `earlier` is broken no more than `plane`.
                let difference = earlier.normal - plane.normal;
                let length = difference.norm();
                if length > PARALLEL {
                    let bound = (earlier.bound - plane.bound) / length;
                    self.projected.push(HalfPlane { normal: difference / length, bound });
                }
            }
            if let Ok(a) = optimum(&self.projected, limit, Goal::Farthest(plane.normal)) {
                best = a;
            }
            worst = plane.violation(best);
        }
        best
    }
}

/// The optimum over the disc and all planes; else the first plane that empties the region, and the optimum before it.
fn optimum(planes: &[HalfPlane], limit: f64, goal: Goal) -> Result<Vec2, (usize, Vec2)> {
    let mut best = match goal {
        Goal::Nearest(point) if point.norm() > limit => point * (limit / point.norm()),
        Goal::Nearest(point) => point,
        Goal::Farthest(direction) => direction * limit,
    };
    for (i, plane) in planes.iter().enumerate() {
        if plane.violation(best) > KEPT_MPS2 {
            best = on_border(planes, i, limit, goal).ok_or((i, best))?;
        }
    }
    Ok(best)
}

/// The optimum on the border of plane `i`, inside the disc and the planes before it.
fn on_border(planes: &[HalfPlane], i: usize, limit: f64, goal: Goal) -> Option<Vec2> {
    let HalfPlane { normal, bound } = planes[i];
    let along = Vec2::new(normal.y, -normal.x);
    let foot = normal * bound;
    let half_chord = limit * limit - bound * bound;
    if half_chord < 0.0 {
        return None;
    }
    let (mut low, mut high) = (-half_chord.sqrt(), half_chord.sqrt());
    for plane in &planes[..i] {
        let slope = plane.normal.dot(&along);
        let missing = plane.violation(foot);
        if slope.abs() <= PARALLEL {
            if missing > KEPT_MPS2 {
                return None;
            }
        } else if slope > 0.0 {
            low = low.max(missing / slope);
        } else {
            high = high.min(missing / slope);
        }
        if low > high {
            return None;
        }
    }
    let t = match goal {
        Goal::Nearest(point) => along.dot(&(point - foot)).clamp(low, high),
        Goal::Farthest(direction) if direction.dot(&along) > 0.0 => high,
        Goal::Farthest(_) => low,
    };
    Some(foot + along * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(angle: f64, bound: f64) -> HalfPlane {
        HalfPlane { normal: Vec2::new(angle.cos(), angle.sin()), bound }
    }

    fn worst(planes: &[HalfPlane], a: Vec2) -> f64 {
        planes.iter().map(|p| p.violation(a)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Points of a fine polar grid in the disc.
    fn grid(limit: f64) -> impl Iterator<Item = Vec2> {
        (0..=80).flat_map(move |r| {
            (0..180).map(move |k| {
                let angle = f64::from(k) * std::f64::consts::TAU / 180.0;
                Vec2::new(angle.cos(), angle.sin()) * (limit * f64::from(r) / 80.0)
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn no_grid_point_is_better(
            raw in prop::collection::vec((0.0..std::f64::consts::TAU, -6.0..6.0), 0..6), wanted in (-9.0..9.0, -9.0..9.0)
        ) {
            let planes: Vec<_> = raw.iter().map(|&(angle, bound)| plane(angle, bound)).collect();
            let (limit, wanted) = (5.0, Vec2::new(wanted.0, wanted.1));
            let a = Program::default().solve(&planes, [0; 2], limit, wanted);
            prop_assert!(a.norm() <= limit + 1e-9);
            if worst(&planes, a) <= 1e-9 {
                let nearest = grid(limit).filter(|&p| worst(&planes, p) <= 0.0).map(|p| (p - wanted).norm());
                prop_assert!((a - wanted).norm() <= nearest.fold(f64::INFINITY, f64::min) + 1e-9);
            } else {
                let least = grid(limit).map(|p| worst(&planes, p)).fold(f64::INFINITY, f64::min);
                prop_assert!(worst(&planes, a) <= least + GIVE_MPS2 + 1e-6, "{} against {least}", worst(&planes, a));
            }
        }
    }

    #[test]
    fn hard_planes_are_kept_when_soft_ones_contradict() {
        let planes = [plane(0.0, 1.0), plane(std::f64::consts::PI, 1.0)];
        let a = Program::default().solve(&planes, [1; 2], 5.0, Vec2::zeros());
        assert!(planes[0].violation(a) <= 1e-9, "{a}");
    }
}
