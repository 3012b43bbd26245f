//! What a drone's actuators are to do.

use crate::status::Status;

/// What a drone is to do until its next command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Accelerate: world frame, m/s².
    Acceleration([f64; 3]),
    /// Reach this velocity and keep it: world frame, m/s.
    Velocity([f64; 3]),
}

/// What a pilot returns from a step: a motion, and what the drone reports about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    motion: Motion,
    status: Status,
}

impl Default for Command {
    /// No acceleration.
    fn default() -> Self {
        Self::acceleration([0.0; 3])
    }
}

impl Command {
    /// Accelerate: world frame, m/s². The drone does at most its greatest acceleration (`drone.acceleration_max_mps2`) in this
    /// direction, and it exceeds no speed above its greatest (`drone.speed_max_mps`).
    #[must_use]
    pub fn acceleration(mps2: [f64; 3]) -> Self {
        Self { motion: Motion::Acceleration(mps2), status: Status::default() }
    }

    /// Reach this velocity and keep it: world frame, m/s. An inner loop holds it: in each tick it accelerates by the difference
    /// to the sensed velocity times `guidance.velocity_gain_per_s`.
    #[must_use]
    pub fn velocity(mps: [f64; 3]) -> Self {
        Self { motion: Motion::Velocity(mps), status: Status::default() }
    }

    /// The same motion with this status. The default status is that of a drone without group, leader and plan.
    #[must_use]
    pub fn with_status(self, status: Status) -> Self {
        Self { status, ..self }
    }

    /// What the drone is to do.
    #[must_use]
    pub fn motion(&self) -> Motion {
        self.motion
    }

    /// What the drone reports about itself.
    #[must_use]
    pub fn status(&self) -> &Status {
        &self.status
    }

    /// The acceleration that follows from the command at this sensed velocity (m/s), by an inner loop of this gain, m/s².
    #[must_use]
    #[inline]
    pub fn acceleration_mps2(&self, velocity_mps: [f64; 3], gain_per_s: f64) -> [f64; 3] {
        match self.motion {
            Motion::Acceleration(mps2) => mps2,
            Motion::Velocity(mps) => std::array::from_fn(|axis| gain_per_s * (mps[axis] - velocity_mps[axis])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_velocity_becomes_an_acceleration_towards_it() {
        let command = Command::velocity([3.0, 0.0, -1.0]);
        assert_eq!(command.acceleration_mps2([1.0, 2.0, -1.0], 2.0), [4.0, -4.0, 0.0]);
        assert_eq!(Command::acceleration([1.0, 2.0, 3.0]).acceleration_mps2([9.0; 3], 2.0), [1.0, 2.0, 3.0]);
    }
}
