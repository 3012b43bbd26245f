//! The flocking law of Olfati-Saber: "Flocking for multi-agent dynamic systems: algorithms and theory", IEEE Transactions on
//! Automatic Control 51 (2006), pages 401 to 420. The forms and the parameters are those of SwarmLab.

use crate::surroundings::{Company, Vec3};
use serde::Deserialize;
use skein::{Command, Inbox, Out, Pilot, Senses};
use std::f64::consts::PI;

/// The parameters. The defaults are SwarmLab's (`param_olfati_saber.m`, `param_swarm.m`).
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Gains {
    /// Velocity of the migration, m/s.
    migration_mps: [f64; 3],
    /// d: distance between neighbours at which they neither attract nor repel, m.
    distance_m: f64,
    /// Whether drones say where they are and hear each other by radio, instead of ranging each other.
    by_radio: bool,
    /// r: drones farther away are no neighbours, m.
    range_m: f64,
    /// Greatest number of neighbours; the nearest count.
    neighbours_max: usize,
    /// c_vm: gain of the velocity matching, 1/s.
    velocity_per_s: f64,
    /// a and b of the pairwise attraction and repulsion, m/s². With a < b near neighbours repel more than far ones attract.
    attraction: [f64; 2],
    /// δ: fraction of the range up to which a neighbour counts fully.
    full_share: f64,
    /// k: exponent of the bump function.
    exponent: i32,
    /// r0: distance at which an obstacle begins to act, m.
    obstacle_range_m: f64,
    /// c_pm_obs: gain of the repulsion from obstacles.
    obstacle_gain: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self {
            migration_mps: [6.0, 0.0, 0.0],
            distance_m: 25.0,
            by_radio: false,
            range_m: 150.0,
            neighbours_max: 10,
            velocity_per_s: 3.0,
            attraction: [1.0, 5.0],
            full_share: 0.2,
            exponent: 2,
            obstacle_range_m: 10.0,
            obstacle_gain: 5.0,
        }
    }
}

impl Gains {
    /// ρ: 1 near by, 0 beyond the range, smooth between.
    fn bump(&self, distance_m: f64) -> f64 {
        let (share, delta) = (distance_m / self.range_m, self.full_share);
        if share < delta {
            1.0
        } else if share < 1.0 {
            ((1.0 + (PI * (share - delta) / (1.0 - delta)).cos()) / 2.0).powi(self.exponent)
        } else {
            0.0
        }
    }

    /// The derivative of [`Self::bump`] by the share of the range.
    fn bump_slope(&self, distance_m: f64) -> f64 {
        let (share, delta) = (distance_m / self.range_m, self.full_share);
        if share < delta || share >= 1.0 {
            return 0.0;
        }
        let angle = PI * (share - delta) / (1.0 - delta);
        let k = self.exponent;
        -PI / (1.0 - delta) * f64::from(k) / 2f64.powi(k) * (1.0 + angle.cos()).powi(k - 1) * angle.sin()
    }

    /// ψ: the potential of a pair, least at the distance `d`.
    fn potential(&self, distance_m: f64) -> f64 {
        let (a, b, c, z) = self.coefficients(distance_m);
        ((a + b) * ((1.0 + (z + c) * (z + c)).sqrt() - (1.0 + c * c).sqrt()) + (a - b) * z) / 2.0
    }

    /// The slope of [`Self::potential`], m/s²: negative where the pair repels.
    fn slope(&self, distance_m: f64) -> f64 {
        let (a, b, c, z) = self.coefficients(distance_m);
        (a + b) / 2.0 * (z + c) / (1.0 + (z + c) * (z + c)).sqrt() + (a - b) / 2.0
    }

    /// φ: the acceleration towards a neighbour at this distance, m/s².
    fn pull(&self, distance_m: f64) -> f64 {
        self.bump_slope(distance_m) * self.potential(distance_m) / self.range_m
            + self.bump(distance_m) * self.slope(distance_m)
    }

    fn coefficients(&self, distance_m: f64) -> (f64, f64, f64, f64) {
        let [a, b] = self.attraction;
        (a, b, (b - a) / (2.0 * (a * b).sqrt()), distance_m - self.distance_m)
    }

    /// The acceleration away from an obstacle at this distance, m/s²: that from a very near neighbour, times the gain. It fades out
    /// with the distance.
    fn push(&self, distance_m: f64) -> f64 {
        let near = 1.0 - (distance_m / self.obstacle_range_m).clamp(0.0, 1.0);
        -self.obstacle_gain * near * self.slope(distance_m - self.distance_m)
    }
}

/// A drone that flies by this law.
pub(crate) struct OlfatiSaber {
    gains: Gains,
    company: Company,
}

impl OlfatiSaber {
    /// A drone with these parameters.
    pub(crate) fn new(gains: Gains) -> Self {
        Self { company: Company::new(gains.by_radio), gains }
    }
}

impl Pilot for OlfatiSaber {
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        let g = &self.gains;
        let (position, velocity) = (Vec3::from(senses.position_m), Vec3::from(senses.velocity_mps));
        let mut acceleration = (Vec3::from(g.migration_mps) - velocity) * g.velocity_per_s;
        for neighbour in self.company.neighbours((senses, inbox, out), g.range_m, g.neighbours_max) {
            acceleration += neighbour.direction * g.pull(neighbour.distance_m);
        }
        for obstacle in senses.obstacles.iter().filter(|o| o.distance_m < g.obstacle_range_m) {
            let away = (position - Vec3::from(obstacle.nearest_m)).try_normalize(1e-9).unwrap_or_default();
            // The β-agent: a point on the obstacle that moves along its surface. Only the approach is braked.
            let approach = away * away.dot(&velocity).min(0.0);
            acceleration += away * g.push(obstacle.distance_m) - approach * g.velocity_per_s;
        }
        Command::acceleration(acceleration.into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_repels_near_by_and_attracts_far_away() {
        let gains = Gains::default();
        assert!(gains.slope(20.0) < 0.0 && gains.slope(30.0) > 0.0);
        assert!(gains.slope(25.0).abs() < 1e-12, "{}", gains.slope(25.0));
        assert!(gains.pull(20.0) < 0.0 && gains.pull(30.0) > 0.0);
        assert_eq!(gains.pull(150.0), 0.0);
    }

    #[test]
    fn the_slopes_are_the_derivatives() {
        let (gains, step) = (Gains::default(), 1e-5);
        for distance_m in [5.0, 24.0, 26.0, 60.0, 120.0] {
            let slope = (gains.potential(distance_m + step) - gains.potential(distance_m - step)) / (2.0 * step);
            assert!((slope - gains.slope(distance_m)).abs() < 1e-6);
            let bump = (gains.bump(distance_m + step) - gains.bump(distance_m - step)) / (2.0 * step) * gains.range_m;
            assert!((bump - gains.bump_slope(distance_m)).abs() < 1e-5);
        }
    }

    #[test]
    fn an_obstacle_pushes_more_the_nearer_it_is() {
        let gains = Gains::default();
        assert_eq!(gains.push(10.0), 0.0);
        assert!(gains.push(1.0) > gains.push(5.0) && gains.push(5.0) > 0.0);
    }
}
