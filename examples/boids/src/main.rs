//! Reynolds' boids ("Flocks, herds, and schools", SIGGRAPH 1987) as a pilot. The program has every command of `skein`.

use nalgebra::Vector3;
use skein::{Birth, Command, Inbox, Out, Pilot, PilotError, Senses};

/// A drone that keeps apart from near neighbours, flies as they do, and stays with them.
struct Boid {
    separation: f64,
    alignment: f64,
    cohesion: f64,
    apart_m: f64,
    migration: Vector3<f64>,
}

impl Boid {
    fn new(birth: &Birth) -> Result<Self, PilotError> {
        Ok(Self {
            separation: birth.params.get_f64("separation", 60.0)?,
            alignment: birth.params.get_f64("alignment", 0.5)?,
            cohesion: birth.params.get_f64("cohesion", 0.05)?,
            apart_m: birth.params.get_f64("apart_m", 20.0)?,
            migration: Vector3::new(birth.params.get_f64("speed_mps", 5.0)?, 0.0, 0.0),
        })
    }
}

impl Pilot for Boid {
    fn step(&mut self, senses: &Senses<'_>, _: &Inbox<'_>, out: &mut Out) -> Command {
        let (position, velocity) = (Vector3::from(senses.position_m), Vector3::from(senses.velocity_mps));
        let mut wanted = self.migration - velocity;
        let count = senses.neighbours.len().max(1) as f64;
        for neighbour in senses.neighbours {
            let to = Vector3::from(neighbour.position_m);
            let near = if to.norm() < self.apart_m { self.separation / to.norm_squared().max(1.0) } else { 0.0 };
            wanted += Vector3::from(neighbour.velocity_mps) * (self.alignment / count);
            wanted += to * (self.cohesion / count) - to.normalize() * near;
        }
        for obstacle in senses.obstacles {
            let away = position - Vector3::from(obstacle.nearest_m);
            wanted += away * (self.separation / away.norm_squared().max(1.0));
        }
        out.metric("neighbours", count);
        Command::acceleration(wanted.into())
    }
}

fn main() -> std::process::ExitCode {
    skein::App::new().try_pilot("boids", |birth| Ok(Box::new(Boid::new(birth)?))).main()
}
