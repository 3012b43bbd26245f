//! The small quadratic program that the safety filters solve. It finds the acceleration nearest to the wanted one that satisfies
//! every half-plane and the acceleration limit. If none exists, it finds one with the least violation, tier by tier.
//!
//! The method is incremental, as in two-dimensional linear programming. Half-planes are added one by one; if one excludes the
//! present optimum, the new optimum lies on its border. Once the work buffers have grown, the solver allocates nothing.

use skein_protocol::Vec2;
use std::ops::Range;

/// The half-plane `normal · a ≥ bound`; `normal` has length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfPlane {
    /// Unit normal that points into the half-plane.
    pub normal: Vec2,
    /// Least component along the normal, m/s².
    pub bound: f64,
}

impl HalfPlane {
    /// By how much `a` violates the half-plane, m/s²; negative inside.
    fn violation(&self, a: Vec2) -> f64 {
        self.bound - self.normal.dot(&a)
    }
}

/// Two borders count as parallel if the sine of the angle between them, or the difference of their normals, is at most this.
const PARALLEL: f64 = 1e-9;
/// Tolerated violation, m/s². It prevents contradictions between two nearly equal borders.
const TOLERANCE_MPS2: f64 = 1e-9;

/// Slack beyond the least possible violation, m/s². Without it the solution would go to the acceleration limit in a direction
/// that hardly reduces the violation.
const SLACK_MPS2: f64 = 0.1;

/// Solver with work buffers that are reused from call to call.
#[derive(Clone, Debug, Default)]
pub struct Program {
    relaxed: Vec<HalfPlane>,
    projected: Vec<HalfPlane>,
}

/// Goal of an optimisation: the point nearest to a given point, or the farthest point in a direction.
#[derive(Clone, Copy)]
enum Goal {
    Nearest(Vec2),
    Farthest(Vec2),
}

impl Program {
    /// Returns the acceleration nearest to `wanted`, with a norm of at most `limit`, that satisfies all `planes`, m/s². If none
    /// exists, earlier tiers have priority over later tiers, and within a tier the largest violation is minimised. `tiers`: end
    /// indices in `planes` of the first two of the three tiers.
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
                for plane in tier {
                    plane.bound -= worst + SLACK_MPS2;
                }
            }
            from = to;
        }
        optimum(&self.relaxed, limit, goal).unwrap_or_else(|(_, a)| a)
    }

    /// Minimises the largest violation within the tier, starting at plane `failed` from point `start`. If a plane is violated
    /// by more than the earlier planes of the tier, its violation is reduced as far as those planes allow. The planes before the
    /// tier stay satisfied.
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
                // Half-plane of the points at which `earlier` is violated by at most as much as `plane`.
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

/// The optimum within the disc of radius `limit` and all planes. If no point is feasible, the error holds the index of the
/// first plane that leaves no point, and the optimum without that plane and all later ones.
fn optimum(planes: &[HalfPlane], limit: f64, goal: Goal) -> Result<Vec2, (usize, Vec2)> {
    let mut best = match goal {
        Goal::Nearest(point) if point.norm() > limit => point * (limit / point.norm()),
        Goal::Nearest(point) => point,
        Goal::Farthest(direction) => direction * limit,
    };
    for (i, plane) in planes.iter().enumerate() {
        if plane.violation(best) > TOLERANCE_MPS2 {
            best = on_border(planes, i, limit, goal).ok_or((i, best))?;
        }
    }
    Ok(best)
}

/// The optimum on the border of plane `i`, within the disc and the planes before `i`. `None` if no point is feasible.
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
        let violation = plane.violation(foot);
        if slope.abs() <= PARALLEL {
            if violation > TOLERANCE_MPS2 {
                return None;
            }
        } else if slope > 0.0 {
            low = low.max(violation / slope);
        } else {
            high = high.min(violation / slope);
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

    /// Points of a fine polar grid in the disc of radius `limit`.
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
                let violation = worst(&planes, a);
                prop_assert!(violation <= least + SLACK_MPS2 + 1e-6, "violation {violation}, least on the grid {least}");
            }
        }
    }

    #[test]
    fn the_first_tier_is_satisfied_even_if_a_later_tier_contradicts_it() {
        let planes = [plane(0.0, 1.0), plane(std::f64::consts::PI, 1.0)];
        let a = Program::default().solve(&planes, [1; 2], 5.0, Vec2::zeros());
        assert!(planes[0].violation(a) <= 1e-9, "{a}");
    }
}
