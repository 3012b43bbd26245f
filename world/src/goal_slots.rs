//! The slots at the goal where dead drones hang.

use crate::body::Body;
use crate::params::{End, WorldParams};
use skein_protocol::Vec2;
use skein_protocol::formation::SLOT_BERTH;

/// The slots of a formation of so many drones, relative to its front slot, axes of the world frame, m. A slot at the goal is left free if one of these dead drones
/// (world frame, m) hangs so close to it that no other drone may come there.
pub(crate) fn slots(params: &WorldParams, drones: usize, dead: &[Vec2]) -> Vec<Vec2> {
    let End::Goal { front_m } = params.end else { return all(params, drones) };
    let course = params.course;
    let dead: Vec<Vec2> = dead.iter().map(|&place| course.from_world(place)).collect();
    let front_m = course.from_world(front_m);
    let free = params.shape.free_slots(drones, params.spacing_m, front_m, &dead, params.safe_distance_m);
    free.into_iter().map(|slot| course.to_world(slot)).collect()
}

/// The slots of a formation of so many drones with none left free, relative to its front slot, axes of the world frame, m.
pub(crate) fn all(params: &WorldParams, drones: usize) -> Vec<Vec2> {
    let slots = params.shape.slots(drones, params.spacing_m);
    slots.into_iter().map(|slot| params.course.to_world(slot)).collect()
}

/// Whether a slot at this place may be left free: a dead drone hangs so close to it that a leader may take it for blocked. World frame, m.
pub(crate) fn may_be_free(params: &WorldParams, slot: Vec2, dead: &[Vec2]) -> bool {
    let keep_m = SLOT_BERTH * params.safe_distance_m + params.arrival_error_m;
    dead.iter().any(|place| (slot - place).norm() < keep_m)
}

/// Where dead drones hang, world frame, m.
pub(crate) fn dead(bodies: &[Body]) -> impl Iterator<Item = Vec2> {
    bodies.iter().filter(|body| !body.is_alive() && body.flies()).map(|body| body.position().xy())
}
