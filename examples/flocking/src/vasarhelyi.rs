//! The flocking law of Vásárhelyi and others: "Optimized flocking of autonomous drones in confined environments", Science
//! Robotics 3 (2018), eaat3536. As SwarmLab does, it adds an attraction beyond the range of the repulsion, and a migration.

use crate::surroundings::{Company, Neighbour, Vec3, limited};
use serde::Deserialize;
use skein::{Command, Inbox, Out, Pilot, Senses};

/// The parameters. The defaults are SwarmLab's (`param_vasarhelyi.m`, `param_swarm.m`).
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Gains {
    /// Velocity of the migration, m/s.
    migration_mps: [f64; 3],
    /// Greatest speed, m/s.
    speed_max_mps: f64,
    /// Whether drones say where they are and hear each other by radio, instead of ranging each other.
    by_radio: bool,
    /// Drones farther away are no neighbours, m.
    range_m: f64,
    /// Greatest number of neighbours; the nearest count.
    neighbours_max: usize,
    /// r0_rep: distance below which neighbours repel and beyond which they attract, m.
    repulsion_range_m: f64,
    /// p_rep: velocity per metre of repulsion or attraction, 1/s.
    repulsion_per_s: f64,
    /// r0_fric: distance at which the braking curve of the alignment begins, m.
    friction_offset_m: f64,
    /// C_fric: share of the velocity difference above the curve that is taken away.
    friction: f64,
    /// v_fric: velocity difference that is always allowed, m/s.
    friction_slack_mps: f64,
    /// p_fric: gain of the linear part of the curve, 1/s.
    friction_per_s: f64,
    /// a_fric: deceleration of the square-root part of the curve, m/s².
    friction_mps2: f64,
    /// r0_shill: distance from an obstacle at which the braking curve of its shill agent begins, m.
    shill_offset_m: f64,
    /// v_shill: speed of the shill agent, away from the obstacle, m/s.
    shill_mps: f64,
    /// p_shill: gain of the linear part of its curve, 1/s.
    shill_per_s: f64,
    /// a_shill: deceleration of the square-root part of its curve, m/s².
    shill_mps2: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self {
            migration_mps: [6.0, 0.0, 0.0],
            speed_max_mps: 7.0,
            by_radio: false,
            range_m: 150.0,
            neighbours_max: 10,
            repulsion_range_m: 25.0,
            repulsion_per_s: 0.03,
            friction_offset_m: 85.3,
            friction: 0.05,
            friction_slack_mps: 0.63,
            friction_per_s: 3.2,
            friction_mps2: 4.16,
            shill_offset_m: 0.3,
            shill_mps: 13.6,
            shill_per_s: 3.55,
            shill_mps2: 3.02,
        }
    }
}

/// A drone that flies by this law.
pub(crate) struct Vasarhelyi {
    gains: Gains,
    company: Company,
}

impl Vasarhelyi {
    /// A drone with these parameters.
    pub(crate) fn new(gains: Gains) -> Self {
        Self { company: Company::new(gains.by_radio), gains }
    }

    /// Repulsion from near neighbours and attraction to far ones, m/s.
    fn spacing(&self, neighbour: &Neighbour) -> Vec3 {
        neighbour.direction * (self.gains.repulsion_per_s * (neighbour.distance_m - self.gains.repulsion_range_m))
    }

    /// Alignment: viscous friction with a neighbour whose velocity differs by more than the braking curve allows, m/s.
    fn friction(&self, neighbour: &Neighbour) -> Vec3 {
        let g = &self.gains;
        let curve = braking_curve(neighbour.distance_m - g.friction_offset_m, g.friction_mps2, g.friction_per_s);
        excess(neighbour.velocity, curve.max(g.friction_slack_mps)) * g.friction
    }

    /// Friction with the shill agent of an obstacle, which moves away from the obstacle, m/s.
    fn shill(&self, away: Vec3, distance_m: f64, velocity: Vec3) -> Vec3 {
        let g = &self.gains;
        excess(away * g.shill_mps - velocity, braking_curve(distance_m - g.shill_offset_m, g.shill_mps2, g.shill_per_s))
    }
}

impl Pilot for Vasarhelyi {
    fn step(&mut self, senses: &Senses<'_>, inbox: &Inbox<'_>, out: &mut Out) -> Command {
        let (position, velocity) = (Vec3::from(senses.position_m), Vec3::from(senses.velocity_mps));
        let mut wanted = Vec3::from(self.gains.migration_mps);
        for neighbour in self.company.neighbours((senses, inbox, out), self.gains.range_m, self.gains.neighbours_max) {
            wanted += self.spacing(&neighbour) + self.friction(&neighbour);
        }
        for obstacle in senses.obstacles {
            let away = (position - Vec3::from(obstacle.nearest_m)).try_normalize(1e-9).unwrap_or_default();
            wanted += self.shill(away, obstacle.distance_m, velocity);
        }
        Command::velocity(limited(wanted, self.gains.speed_max_mps).into())
    }
}

/// The greatest speed from which a drone can stop within `distance_m`, m/s: linear near the stop, with a constant deceleration
/// farther away (the paper's function D).
fn braking_curve(distance_m: f64, deceleration_mps2: f64, gain_per_s: f64) -> f64 {
    if distance_m <= 0.0 {
        0.0
    } else if distance_m * gain_per_s < deceleration_mps2 / gain_per_s {
        distance_m * gain_per_s
    } else {
        (2.0 * deceleration_mps2 * distance_m - (deceleration_mps2 / gain_per_s).powi(2)).sqrt()
    }
}

/// The part of the vector beyond this length.
fn excess(vector: Vec3, length: f64) -> Vec3 {
    vector - limited(vector, length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_braking_curve_is_continuous_and_grows() {
        let knee_m = 4.16 / (3.2 * 3.2);
        let (before, after) = (braking_curve(knee_m - 1e-9, 4.16, 3.2), braking_curve(knee_m + 1e-9, 4.16, 3.2));
        assert!((before - after).abs() < 1e-6 && (before - 4.16 / 3.2).abs() < 1e-6, "{before} {after}");
        assert_eq!(braking_curve(-1.0, 4.16, 3.2), 0.0);
        assert!(braking_curve(50.0, 4.16, 3.2) > braking_curve(10.0, 4.16, 3.2));
    }

    #[test]
    fn near_neighbours_repel_and_far_ones_attract() {
        let pilot = Vasarhelyi::new(Gains::default());
        let at = |distance_m| Neighbour { direction: Vec3::x(), distance_m, velocity: Vec3::zeros() };
        assert!(pilot.spacing(&at(10.0)).x < 0.0 && pilot.spacing(&at(40.0)).x > 0.0);
        assert_eq!(pilot.spacing(&at(25.0)), Vec3::zeros());
    }

    #[test]
    fn an_obstacle_ahead_slows_the_drone_and_one_far_away_does_not() {
        let pilot = Vasarhelyi::new(Gains::default());
        let velocity = Vec3::new(6.0, 0.0, 0.0);
        assert!(pilot.shill(-Vec3::x(), 5.0, velocity).x < -10.0);
        assert_eq!(pilot.shill(-Vec3::x(), 90.0, velocity), Vec3::zeros());
    }
}
