//! How bodies move in a tick: as commanded, or as their autopilots do without a command.

use super::World;
use crate::body::admissible;
use skein_protocol::DroneId;

/// A drone whose commands stay away goes on with the last one for so long, s; then its autopilot brakes until the next
/// one comes. Shorter than what autopilots take to give up an offboard computer: a command here is an acceleration.
pub(crate) const HOLD_S: f64 = 0.2;

impl World {
    pub(super) fn move_bodies(&mut self) {
        let now = self.now();
        let held_ticks = (HOLD_S / self.params.dt_s()).round() as u32;
        for ((body, process), id) in self.bodies.iter_mut().zip(&self.processes).zip(0..) {
            if !body.alive {
                body.fail_safe(&self.params);
                continue;
            }
            if process.frozen || process.late_ticks > held_ticks {
                body.hover(&self.params);
                continue;
            }
            let command = admissible(process.slot.acceleration_mps2, self.params.acceleration_max_mps2);
            self.totals.rejected_commands += u64::from(command.is_none());
            body.fly(command.unwrap_or_default() + self.faults.wind_mps2(DroneId(id), now), &self.params);
        }
    }
}
