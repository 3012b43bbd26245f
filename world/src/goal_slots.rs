//! The slots at the goal where dead drones hang.

use crate::body::Body;
use crate::params::{End, WorldParams};
use skein_protocol::Vec2;
use skein_protocol::formation::GoalGround;
use skein_protocol::shape::ConvexShape;

/// What keeps slots free where these drones hang dead (world frame, m) and these obstacles are.
pub(crate) fn ground<'a>(params: &WorldParams, dead: &'a [Vec2], obstacles: &'a [ConvexShape]) -> GoalGround<'a> {
    GoalGround { dead, obstacles, safe_distance_m: params.safe_distance_m, clearance_m: params.clearance_m }
}

/// The slots of a formation of so many drones, relative to its front slot, axes of the world frame, m. At the goal, slots that the ground keeps
/// free are left out.
pub(crate) fn slots(params: &WorldParams, drones: usize, ground: &GoalGround<'_>) -> Vec<Vec2> {
    let End::Goal { front_m } = params.end else { return all(params, drones) };
    let course = params.course;
    let free = params.shape.free_slots(drones, params.spacing_m, ground, |slot| front_m + course.to_world(slot));
    free.into_iter().map(|slot| course.to_world(slot)).collect()
}

/// The slots of a formation of so many drones with none left free, relative to its front slot, axes of the world frame, m.
pub(crate) fn all(params: &WorldParams, drones: usize) -> Vec<Vec2> {
    let slots = params.shape.slots(drones, params.spacing_m);
    slots.into_iter().map(|slot| params.course.to_world(slot)).collect()
}

/// Whether a slot at this place may be left free: a leader may take it for blocked. A leader knows dead drones and obstacles with errors, and may
/// plan to keep the planning distance from obstacles. World frame, m.
pub(crate) fn may_be_free(params: &WorldParams, slot: Vec2, ground: &GoalGround<'_>) -> bool {
    let error_m = params.arrival_error_m;
    let beside_m = (params.planning_distance_m - params.clearance_m).max(0.0);
    !ground.is_free(slot, error_m, beside_m + error_m)
}

/// The most slots of a formation at the goal in which so many drones may stand. That is the size that a leader needs which leaves all slots free
/// that may be left free; the greatest size if none is large enough for that.
pub(crate) fn most(params: &WorldParams, drones: usize, ground: &GoalGround<'_>) -> usize {
    let End::Goal { front_m } = params.end else { return drones };
    let beside_dead = GoalGround { obstacles: &[], ..*ground }.most_slots(drones);
    let stays = |slot: &Vec2| !may_be_free(params, front_m + slot, ground);
    let is_enough = |&size: &usize| all(params, size).iter().filter(|slot| stays(slot)).count() >= drones;
    let greatest = ground.most_slots(drones);
    (drones..=greatest).find(is_enough).unwrap_or(greatest).max(beside_dead)
}

/// Where dead drones hang, world frame, m.
pub(crate) fn dead(bodies: &[Body]) -> impl Iterator<Item = Vec2> {
    bodies.iter().filter(|body| !body.is_alive() && body.flies()).map(|body| body.position().xy())
}
